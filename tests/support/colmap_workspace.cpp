#include "tests/support/colmap_workspace.h"

#include "io/images/image_file.h"
#include "tests/support/files.h"

#include <fmt/format.h>

namespace scanshade::tests {

namespace {

template <class... Values>
std::string raw(Values... values) {
    std::string bytes;
    (bytes.append(reinterpret_cast<const char*>(&values), sizeof values), ...);
    return bytes;
}

} // namespace

std::string colmap_map(const cv::Mat1f& map) {
    return fmt::format("{}&{}&1&", map.cols, map.rows) +
           std::string(reinterpret_cast<const char*>(map.data), map.total() * sizeof(float));
}

void write_colmap(const std::filesystem::path& folder, const ColmapWorkspace& workspace) {
    const Pinhole camera = small_camera().pinhole;
    const int scale = workspace.image_scale, width = camera.size.width * scale, height = camera.size.height * scale;
    const double fx = camera.fx * scale, fy = camera.fy * scale, cx = (camera.cx + 0.5) * scale,
                 cy = (camera.cy + 0.5) * scale;
    std::string images = raw(std::uint64_t(workspace.frames)), lines = "# images\n";
    for (int i = 0; i < workspace.frames; ++i) {
        const std::string name = fmt::format("{}{}.jpg", workspace.images_in, i);
        cv::Mat1f depth = corner_depth(0), noise(depth.size());
        cv::RNG random(static_cast<std::uint64_t>(i) + 1);
        random.fill(noise, cv::RNG::NORMAL, 1, workspace.noise);
        cv::multiply(depth, noise, depth, workspace.unit);
        write_file(folder / ("stereo/depth_maps/" + name + workspace.kind), colmap_map(depth));
        std::filesystem::create_directories((folder / "images" / name).parent_path());
        write_picture(folder / "images" / name, cv::Mat3b(height, width, cv::Vec3b(40, 120, 200)));
        const double x = 0.01 * i * workspace.unit; // of the world in the camera
        const int id = workspace.frames - i;
        images += raw(std::uint32_t(id), 1.0, 0.0, 0.0, 0.0, x, 0.0, 0.0, std::uint32_t(7)) + name + '\0' +
                  raw(std::uint64_t(1), 0.5, 0.5, std::int64_t(-1));
        lines += fmt::format("{} 1 0 0 0 {} 0 0 7 {}\n{}\n", id, x, name, i == 0 ? "" : "1.5 2.5 -1");
    }
    if (workspace.text) {
        write_file(folder / "sparse/cameras.txt",
                   fmt::format("# cameras\n7 PINHOLE {} {} {} {} {} {}\n", width, height, fx, fy, cx, cy));
        write_file(folder / "sparse/images.txt", lines);
        return;
    }
    write_file(folder / "sparse/cameras.bin", raw(std::uint64_t(1), std::uint32_t(7), std::int32_t(1),
                                                  std::uint64_t(width), std::uint64_t(height), fx, fy, cx, cy));
    write_file(folder / "sparse/images.bin", images);
}

} // namespace scanshade::tests
