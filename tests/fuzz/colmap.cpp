// Fuzz target: COLMAP's dense workspaces. The first byte chooses which of their files the input is; the others are
// sound. Whatever a list says, nothing outside the folder may be opened.
#include "io/captures/capture.h"
#include "tests/fuzz/fuzz.h"

#include <array>
#include <cmath>
#include <opencv2/core.hpp>

namespace {

using namespace scanshade;
using namespace scanshade::fuzz;

struct File {
    const char* name;
    std::string_view sound;
};

const std::string depth_map = "2&2&1&" + std::string(16, '\x40');
const std::array files = {
    File{"sparse/images.txt", "1 1 0 0 0 0 0 0 1 a.pgm\n\n2 1 0 0 0 0 0 1 1 b/c.pgm\n\n"},
    File{"sparse/cameras.txt", "1 PINHOLE 2 2 2 2 1 1\n"},
    File{"stereo/depth_maps/a.pgm.geometric.bin", depth_map},
    File{"sparse/images.bin", ""}, // these win where they are there
    File{"sparse/cameras.bin", ""},
};

void must_lie_in(const std::filesystem::path& file, const std::filesystem::path& root) {
    const auto relative = std::filesystem::canonical(file).lexically_relative(std::filesystem::canonical(root));
    must_hold(!relative.empty() && *relative.begin() != "..");
}

void open(const std::filesystem::path& root) {
    Capture capture;
    if (!accepted([&] { capture = open_capture(root); }))
        return;
    must_hold(!capture.depth.arbitrary || capture.unit.units_per_length > 0);
    for (std::size_t i = 0; i < capture.entries.size(); ++i) {
        const CaptureEntry& entry = capture.entries[i];
        must_hold(!entry.name.empty() && entry.name.find('/') == std::string::npos);
        if (!entry.problem.empty())
            continue;
        must_lie_in(entry.depth, root);
        if (!entry.colour.empty())
            must_lie_in(entry.colour, root);
        if (i < 3)
            (void)accepted([&] {
                const Frame frame = capture.load(i);
                for (const float z : frame.depth_m)
                    must_hold(z >= 0);
                must_hold(!frame.world_from_camera || frame.world_from_camera->matrix().allFinite());
            });
    }
}

} // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    if (size == 0)
        return 0;
    static const bool outside = as_file(depth_map, "outside.pgm.geometric.bin").has_filename();
    (void)outside;
    const std::filesystem::path root = "workspace";
    (void)as_file("P5 2 2 255\n1234", root / "images/a.pgm");
    (void)as_file(depth_map, root / "stereo/depth_maps/b/c.pgm.photometric.bin");
    const std::size_t chosen = data[0] % files.size();
    for (std::size_t i = 0; i < files.size(); ++i) {
        const auto file = as_file(i == chosen ? text_of(data + 1, size - 1) : files[i].sound, root / files[i].name);
        if (i != chosen && files[i].sound.empty())
            std::filesystem::remove(file);
    }
    open(folder() / root);
    return 0;
}
