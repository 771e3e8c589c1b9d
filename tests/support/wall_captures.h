// The wall as files: pairs of colour and depth, a capture in TUM's layout, a camera that fits.
#pragma once

#include "io/cameras/camera_file.h"
#include "io/images/image_file.h"
#include "tests/support/files.h"
#include "tests/support/wall.h"

#include <filesystem>
#include <fmt/format.h>
#include <string>

namespace scanshade::tests {

inline void write_pair(const std::filesystem::path& colour, const std::filesystem::path& depth, double units) {
    write_picture(colour, picture());
    write_depth_png(depth, wall(), units);
}

/// A capture in TUM's layout: colour a little before depth, poses at other times again.
inline void write_tum(const std::filesystem::path& folder, int frames) {
    std::string rgb = "# colour\n", depth = "# depth\n", poses = "# poses\n";
    for (int i = 0; i < frames; ++i) {
        const std::string colour_name = fmt::format("rgb/{:.6f}.png", 10 + i * 0.1),
                          depth_name = fmt::format("depth/{:.6f}.png", 10.01 + i * 0.1);
        write_pair(folder / colour_name, folder / depth_name, 5000);
        rgb += fmt::format("{:.6f} {}\n", 10 + i * 0.1, colour_name);
        depth += fmt::format("{:.6f} {}\n", 10.01 + i * 0.1, depth_name);
        poses += fmt::format("{:.4f} {} 2 3 0 0 0.7071 0.7071\n", 10.005 + i * 0.1, i);
    }
    write_file(folder / "rgb.txt", rgb);
    write_file(folder / "depth.txt", depth);
    write_file(folder / "groundtruth.txt", poses);
}

inline void write_camera(const std::filesystem::path& file) {
    CameraFile camera;
    camera.camera.pinhole = {60, 60, 31.5, 23.5, {64, 48}};
    camera.registration = Registration::yes;
    write_camera_file(file, camera);
}

} // namespace scanshade::tests
