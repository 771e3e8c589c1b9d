// Messages of the Vulkan validation layer fail the test that caused them.
#pragma once

#include "ao/gpu/device.h"

#include <cstddef>
#include <gtest/gtest.h>
#include <string>
#include <vector>

namespace scanshade::tests {

/// Looks at a device's messages after every test. It must outlive the tests.
class Watch : public testing::EmptyTestEventListener {
  public:
    explicit Watch(const gpu::Device& device) : device_(device) {}
    void OnTestEnd(const testing::TestInfo&) override {
        const std::vector<std::string> messages = device_.validation_messages();
        for (; seen_ < messages.size(); ++seen_)
            ADD_FAILURE() << messages[seen_];
    }

  private:
    const gpu::Device& device_;
    std::size_t seen_ = 0;
};

/// The device of all tests in a program, watched from its first use on.
inline gpu::Device& watched_device() {
    static gpu::Device& watched = []() -> gpu::Device& {
        static gpu::Device device;
        testing::UnitTest::GetInstance()->listeners().Append(new Watch(device)); // the list owns it
        return device;
    }();
    return watched;
}

} // namespace scanshade::tests
