// Files from text, their bytes, and lists of warnings, for the tests of io.
#pragma once

#include "tests/support/says.h"
#include "tests/support/small_capture.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <gtest/gtest.h>
#include <iterator>
#include <string>
#include <vector>

namespace scanshade::tests {

/// Writes a file and its folders; returns its path.
inline std::filesystem::path write_file(const std::filesystem::path& file, const std::string& bytes) {
    std::filesystem::create_directories(file.parent_path());
    std::ofstream(file, std::ios::binary) << bytes;
    return file;
}

inline std::string file_bytes(const std::filesystem::path& file) {
    std::ifstream stream(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
}

inline std::string joined(const std::vector<std::string>& texts) {
    std::string all;
    for (const std::string& text : texts)
        all += "\n  " + text;
    return all;
}

/// Whether any of the warnings contains `part`; shows them all where none does.
inline testing::AssertionResult warned(const std::vector<std::string>& warnings, const std::string& part) {
    if (std::any_of(warnings.begin(), warnings.end(),
                    [&](const std::string& w) { return w.find(part) != std::string::npos; }))
        return testing::AssertionSuccess();
    return testing::AssertionFailure() << "none says \"" << part << "\":" << joined(warnings);
}

} // namespace scanshade::tests
