// Loading: a cloud, and the camera that sees it.
#include "io/captures/loading.h"

#include "io/clouds/cloud_file.h"
#include "io/clouds/cloud_records.h"
#include "projection/base/error.h"
#include "projection/base/statistics.h"
#include "projection/pixel_cloud.h"

#include <cmath>
#include <fmt/format.h>

namespace scanshade {
namespace {

/// A depth image that was written as a cloud is one again. Not where its unit can hardly be metres: rays from points
/// need no unit.
void see_pixels(Frame& frame) {
    constexpr double nearest_m = 0.15, farthest_m = 30;
    Cloud& cloud = *frame.cloud;
    const std::optional<PixelCloud> found = pixel_cloud(cloud);
    if (!found)
        return;
    std::vector<double> depths_m;
    for (const Eigen::Vector3d& point : cloud.points)
        if (point.allFinite() && point.z() != 0)
            depths_m.push_back(std::abs(point.z()));
    if (const double middle_m = median(std::move(depths_m)); middle_m < nearest_m || middle_m > farthest_m)
        return;
    if (found->flipped)
        for (Eigen::Vector3d& point : cloud.points)
            point = {point.x(), -point.y(), -point.z()};
    cloud.pixels_of_one_image = true;
    frame.camera = {found->fit.camera,
                    {},
                    fmt::format("recovered from the points, which are the pixels of one image{}; rms {:.4f} px",
                                found->flipped ? " seen along -z, with y up" : "", found->fit.rms_px)};
}

} // namespace

void load_cloud(const Capture& capture, const CaptureEntry& entry, Frame& frame) {
    frame.cloud = read_cloud(entry.cloud, frame.warnings);
    if (frame.cloud->records->viewpoint)
        frame.world_from_camera = frame.cloud->records->viewpoint;
    if (!capture.camera) {
        if (!frame.cloud->organised() && triangles_of(*frame.cloud).empty())
            see_pixels(frame);
        return;
    }
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
