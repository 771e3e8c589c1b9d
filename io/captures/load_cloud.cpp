// Loading: a cloud, and the camera that sees it.
#include "io/captures/loading.h"

#include "io/clouds/cloud_file.h"
#include "io/clouds/cloud_records.h"
#include "projection/base/error.h"

#include <cmath>
#include <fmt/format.h>

namespace scanshade {

void load_cloud(const Capture& capture, const CaptureEntry& entry, Frame& frame) {
    frame.cloud = read_cloud(entry.cloud, frame.warnings);
    if (frame.cloud->records->viewpoint)
        frame.world_from_camera = frame.cloud->records->viewpoint;
    if (!capture.camera)
        return;
    frame.camera = *capture.camera;
    Pinhole& pinhole = frame.camera.pinhole;
    const cv::Size grid = frame.cloud->grid;
    if (frame.cloud->organised()) {
        if (pinhole.size.empty())
            pinhole.size = grid;
        if (pinhole.size != grid)
            throw Error(fmt::format("{}: the cloud's grid is {}, but its camera is for {} ({})", entry.cloud,
                                    size_text(grid), size_text(pinhole.size), frame.camera.origin));
    } else if (pinhole.size.empty()) {
        // Four numbers do not include the image size; a principal point is usually in the middle.
        constexpr double widest = 1 << 14;
        if (!(pinhole.cx >= 0 && pinhole.cy >= 0 && pinhole.cx < widest / 2 && pinhole.cy < widest / 2))
            throw Error(fmt::format("{}: an image size is needed with this camera ({}); give a camera file",
                                    entry.cloud, frame.camera.origin));
        pinhole.size = {static_cast<int>(std::lround(2 * pinhole.cx + 1)),
                        static_cast<int>(std::lround(2 * pinhole.cy + 1))};
        frame.warnings.push_back(fmt::format("the camera names no image size; {} is taken from its principal point.",
                                             size_text(pinhole.size)));
    }
    check(frame.camera);
}

} // namespace scanshade
