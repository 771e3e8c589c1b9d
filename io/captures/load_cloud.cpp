// Loading: a cloud, and the camera that sees it.
#include "io/captures/loading.h"

#include "io/clouds/cloud_file.h"
#include "io/clouds/cloud_records.h"
#include "projection/base/error.h"
#include "projection/pixel_cloud.h"

#include <cmath>
#include <fmt/format.h>

namespace scanshade {
namespace {

/// Depth cameras see 0.1 to 30 m. What they see at 100 to 30,000 is in millimetres.
bool may_be_metres(double middle) { return middle >= 0.1 && middle <= 30; }
bool may_be_millimetres(double middle) { return middle > 100 && middle <= 30000; }

void take_for_millimetres(Frame& frame, double middle) {
    constexpr double metres = 0.001;
    for (Eigen::Vector3d& point : frame.cloud->points)
        point *= metres;
    if (frame.world_from_camera)
        frame.world_from_camera->translation() *= metres;
    frame.warnings.push_back(fmt::format("the points of this image are taken for millimetres, since half of them are "
                                         "farther than {:.4g}; the radius is in metres.",
                                         middle));
}

/// A depth image that was written as a cloud is one again. Not where its unit can hardly be told: rays from points need
/// none.
void see_pixels(Frame& frame) {
    Cloud& cloud = *frame.cloud;
    const double middle = middle_depth(cloud);
    if (!may_be_metres(middle) && !may_be_millimetres(middle))
        return;
    const std::optional<PixelCloud> found = pixel_cloud(cloud);
    if (!found)
        return;
    if (found->flipped) {
        for (Eigen::Vector3d& point : cloud.points)
            point = {point.x(), -point.y(), -point.z()};
        if (frame.world_from_camera)
            frame.world_from_camera->linear() *= Eigen::Vector3d(1, -1, -1).asDiagonal();
    }
    cloud.pixels_of_one_image = true;
    frame.camera = {found->fit.camera,
                    {},
                    fmt::format("recovered from the points, which are the pixels of one image{}; rms {:.4f} px",
                                found->flipped ? " seen along -z, with y up" : "", found->fit.rms_px)};
    if (may_be_millimetres(middle))
        take_for_millimetres(frame, middle);
}

/// An organised cloud of a pinhole camera in millimetres.
bool is_image_in_millimetres(const Cloud& cloud, double middle) {
    if (!may_be_millimetres(middle))
        return false;
    try {
        (void)fit_pinhole(cloud);
        return true;
    } catch (const Error&) {
        return false;
    }
}

} // namespace

void load_cloud(const Capture& capture, const CaptureEntry& entry, Frame& frame) {
    frame.cloud = read_cloud(entry.cloud, frame.warnings);
    during(entry.cloud, [&] { // nobody else has these records yet
        settle_octree(const_cast<CloudRecords&>(*frame.cloud->records), capture.copc);
    });
    if (frame.cloud->records->viewpoint)
        frame.world_from_camera = frame.cloud->records->viewpoint;
    if (frame.cloud->organised()) {
        if (const double middle = middle_depth(*frame.cloud); is_image_in_millimetres(*frame.cloud, middle))
            take_for_millimetres(frame, middle);
    } else if (!capture.camera && frame.cloud->records->splats.empty()) {
        see_pixels(frame);
    }
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
