// Fuzz target: camera files of every format, written in every format that can say what they hold, and read again.
#include "io/cameras/camera_file.h"
#include "tests/fuzz/fuzz.h"

#include <cmath>

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace scanshade;
    using namespace scanshade::fuzz;
    const auto file = as_file(text_of(data, size), "camera");
    CameraFile camera;
    if (!accepted([&] { camera = read_camera_file(file); }))
        return 0;
    for (const std::string& name : camera_format_names()) {
        const auto written = folder() / ("camera." + name);
        if (!accepted([&] { write_camera_file(written, camera, camera_format(written, name)); }))
            continue;
        const Pinhole again = read_camera_file(written).camera.pinhole, was = camera.camera.pinhole;
        must_hold(again.size == was.size && again.fx == was.fx && again.fy == was.fy);
        must_hold(std::abs(again.cx - was.cx) <= 1e-9 * std::abs(was.cx) + 1e-9);
    }
    return 0;
}
