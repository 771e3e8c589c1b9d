// What the fuzz targets share: an input as a file, and what a reader may do with it. Each target is an entry point that
// libFuzzer drives (tests/fuzz/run); whatever is found becomes a row of tests/io/broken_inputs_test.cpp.
#pragma once

#include "projection/base/error.h"

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
#include <tbb/global_control.h>
#include <unistd.h>
#include <utility>
#include <vector>

namespace scanshade::fuzz {

/// Targets run side by side, one a processor: threads of each for every processor would mostly wait for each other.
inline const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);

/// A folder of this process's own, under TMPDIR.
inline const std::filesystem::path& folder() {
    static const std::filesystem::path own =
        std::filesystem::temp_directory_path() / ("scanshade-fuzz-" + std::to_string(::getpid()));
    return own;
}

inline std::string_view text_of(const std::uint8_t* data, std::size_t size) {
    return {reinterpret_cast<const char*>(data), size};
}

/// The bytes as a file of that name in folder().
inline std::filesystem::path as_file(std::string_view bytes, const std::filesystem::path& name) {
    const std::filesystem::path file = folder() / name;
    std::filesystem::create_directories(file.parent_path());
    std::ofstream(file, std::ios::binary) << bytes;
    return file;
}

/// Several files in one input, between lines of "=====": as many as `count`, those that are missing empty.
inline std::vector<std::string_view> parts_of(std::string_view bytes, std::size_t count) {
    constexpr std::string_view between = "=====\n";
    std::vector<std::string_view> parts;
    while (parts.size() + 1 < count) {
        const auto at = bytes.find(between);
        parts.push_back(bytes.substr(0, at));
        bytes = at == std::string_view::npos ? std::string_view() : bytes.substr(at + between.size());
    }
    parts.push_back(bytes);
    return parts;
}

/// Runs a reader, which may refuse with an Error and with nothing else. True where it did not.
template <class Action>
bool accepted(Action&& action) {
    try {
        std::forward<Action>(action)();
        return true;
    } catch (const Error&) {
        return false;
    }
}

/// A promise of the code under test: where it is broken, the run ends here.
inline void must_hold(bool promise) {
    if (!promise)
        std::abort();
}

} // namespace scanshade::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);
