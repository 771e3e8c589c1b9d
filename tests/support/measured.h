// Tests of the commands that measure: a generated capture and a run of it.
#pragma once

#include "apps/json.h"
#include "tests/support/small_capture.h"

#include <filesystem>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

namespace scanshade::tests {

/// A generated capture of two frames, 64x48, and a run of it. Both are made once.
class MeasureTest : public testing::Test {
  protected:
    static void SetUpTestSuite() {
        ASSERT_EQ(
            run_program(
                fmt::format("generate office -o {} --sensor ideal --frames 2 --size 64x48 --truth-rays 16", capture()))
                .exit_code,
            0);
        ASSERT_EQ(run_program(fmt::format("run {} -o {} --write ao,confidence --depth-noise none", capture(), made()))
                      .exit_code,
                  0);
    }
    static void TearDownTestSuite() { shared_folder().reset(); }

    static std::unique_ptr<TemporaryFolder>& shared_folder() {
        static auto folder = std::make_unique<TemporaryFolder>();
        return folder;
    }
    static std::string capture() { return (*shared_folder() / "capture").string(); }
    static std::string made() { return (*shared_folder() / "made").string(); }
    [[nodiscard]] std::string out() const { return (folder / "out").string(); }
    [[nodiscard]] json read(const std::filesystem::path& file) const { return json::parse(read_bytes(file)); }

    TemporaryFolder folder;
};

} // namespace scanshade::tests
