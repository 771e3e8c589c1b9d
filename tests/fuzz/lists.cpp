// Fuzz target: the lists of a capture's folder. The first byte chooses the layout; its files follow, between lines of
// "=====". Whatever a list says, nothing outside the folder may be opened.
#include "io/captures/capture.h"
#include "tests/fuzz/fuzz.h"

#include <array>
#include <opencv2/core.hpp>

namespace {

using namespace scanshade;
using namespace scanshade::fuzz;

void must_lie_in(const std::filesystem::path& file, const std::filesystem::path& root) {
    const auto relative = std::filesystem::canonical(file).lexically_relative(std::filesystem::canonical(root));
    must_hold(!relative.empty() && *relative.begin() != "..");
}

void open(const std::filesystem::path& root) {
    Capture capture;
    if (!accepted([&] { capture = open_capture(root); }))
        return;
    for (std::size_t i = 0; i < capture.entries.size(); ++i) {
        const CaptureEntry& entry = capture.entries[i];
        must_hold(!entry.name.empty() && entry.name.find('/') == std::string::npos);
        if (!entry.problem.empty())
            continue;
        must_lie_in(entry.depth, root);
        if (!entry.colour.empty())
            must_lie_in(entry.colour, root);
        if (i < 3)
            (void)accepted([&] { (void)capture.load(i); });
    }
}

} // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    if (size == 0)
        return 0;
    static constexpr std::array<std::array<const char*, 4>, 3> layouts{
        {{"depth.txt", "rgb.txt", "groundtruth.txt", "camera.json"},
         {"rgbd.match", "trajectory.log", "camera_intrinsic.json", "info.txt"},
         {"pose.txt", "intrinsics.txt", "camera.json", "info.txt"}}};
    const std::size_t layout = data[0] % layouts.size();
    const std::filesystem::path root = "capture" + std::to_string(layout);
    static const bool outside = as_file("P5 2 2 65535\n12345678", "outside.pgm").has_filename();
    (void)outside;
    for (const char* image : {"depth/1.pgm", "depth/2.pgm", "color/1.pgm", "color/2.pgm"})
        (void)as_file("P5 2 2 65535\n12345678", root / image);
    const auto parts = parts_of(text_of(data + 1, size - 1), layouts[layout].size());
    for (std::size_t i = 0; i < parts.size(); ++i) {
        const auto file = as_file(parts[i], root / layouts[layout][i]);
        if (parts[i].empty())
            std::filesystem::remove(file);
    }
    open(folder() / root);
    return 0;
}
