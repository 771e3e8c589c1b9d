// Fuzz target: recordings in one file: bags, MCAP and SQLite files of ROS, .sens; told apart by their first bytes.
#include "io/captures/capture.h"
#include "tests/fuzz/fuzz.h"

#include <algorithm>
#include <opencv2/core.hpp>

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace scanshade;
    using namespace scanshade::fuzz;
    const std::filesystem::path file = as_file(text_of(data, size), "recording");
    Capture capture;
    if (!accepted([&] { capture = open_capture(file); }))
        return 0;
    for (std::size_t i = 0; i < std::min<std::size_t>(capture.entries.size(), 4); ++i)
        accepted([&] { (void)capture.load(i); });
    return 0;
}
