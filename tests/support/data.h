// Recorded and damaged data that are no part of the repository: where they are, and what a test says without them.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <gtest/gtest.h>

namespace scanshade::tests {

/// The folder with recorded and damaged data; the tests that need it are skipped where it is not.
inline std::filesystem::path data_folder() {
    const char* named = std::getenv("SCANSHADE_DATA");
    return named && *named ? std::filesystem::path(named) : std::filesystem::path("SCANSHADE_DATA is not set");
}

} // namespace scanshade::tests

/// Skips a test whose data are not at hand.
#define NEEDS(path)                                                                                                    \
    if (!std::filesystem::exists(path))                                                                                \
    GTEST_SKIP() << (path) << " is not there; SCANSHADE_DATA names the folder of recorded data"
