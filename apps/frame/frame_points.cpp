#include "apps/frame/frame_points.h"

#include "apps/picture.h"
#include "projection/colour_view.h"
#include "projection/undistort.h"

#include <algorithm>
#include <cmath>

namespace scanshade {
namespace {

std::vector<cv::Vec3b> shaded_colours(const std::vector<cv::Vec3b>& colours, const std::vector<float>& visibility,
                                      double strength) {
    const cv::Size row(static_cast<int>(colours.size()), 1);
    if (row.empty())
        return {};
    const cv::Mat3b shaded = shade(on_grid(colours, row), on_grid(visibility, row), strength);
    return {shaded.begin(), shaded.end()};
}

/// Clouds store confidence 0 where it is not known.
float known_or_none(float confidence) { return std::isnan(confidence) ? 0.0F : confidence; }

template <class Pixel>
cv::Mat_<Pixel> undistorted(const cv::Mat_<Pixel>& image, const Camera& camera) {
    if (image.empty() || !camera.distortion.any())
        return image;
    const auto maps = Undistortion::of(camera);
    cv::Mat_<Pixel> straight(maps->straight_camera().size);
    std::transform(maps->recorded_pixel().begin(), maps->recorded_pixel().end(), straight.begin(),
                   [&](int pixel) { return pixel < 0 ? Pixel() : image(pixel / image.cols, pixel % image.cols); });
    return straight;
}

} // namespace

cv::Mat3b undistorted_image(const cv::Mat3b& image, const Camera& camera) { return undistorted(image, camera); }
cv::Mat1b undistorted_image(const cv::Mat1b& image, const Camera& camera) { return undistorted(image, camera); }

std::vector<cv::Vec3b> cloud_colours(const std::vector<cv::Vec3b>& own, const std::vector<float>& visibility,
                                     const Outputs& outputs) {
    if (own.empty())
        return outputs.colour_cloud == CloudColours::grey ? greys(visibility) : std::vector<cv::Vec3b>();
    return shaded_colours(own, visibility, outputs.shade_strength);
}

FramePoints points_of_depth(const Work& work, const Scene& shown, const Outputs& outputs) {
    const Pinhole& camera = work.depth.camera;
    const cv::Mat1f& z_m = work.depth.z_m;
    const bool warped = has_secondary_camera(work.frame);
    const Scene scene = warped && outputs.colour_view ? scene_of(work, false) : shown;
    const cv::Mat3b colour = undistorted(scene.colour, work.frame.camera);
    const cv::Mat1b colour_known = undistorted(scene.colour_known, work.frame.camera);
    FramePoints all;
    for (int v = 0; v < z_m.rows; ++v) {
        for (int u = 0; u < z_m.cols; ++u) {
            const double z = z_m(v, u);
            if (z <= 0)
                continue;
            all.made.push_back(camera.point(u, v, outputs.unit.told(z)));
            all.visibility.push_back(work.ao.visibility(v, u));
            all.confidence.push_back(known_or_none(work.confidence_in_view(v, u)));
            if (outputs.error)
                all.error.push_back(work.error_in_view(v, u));
            if (!colour.empty())
                all.colours.push_back(colour(v, u));
            if (!colour_known.empty())
                all.colour_known.push_back(colour_known(v, u) > 0 ? 1.0F : 0.0F);
        }
    }
    if (outputs.colour_cloud != CloudColours::kept)
        all.colours = cloud_colours(all.colours, all.visibility, outputs);
    all.points = all.made;
    return all;
}

FramePoints points_of_cloud(const Work& work, const Outputs& outputs) {
    const Cloud& cloud = *work.frame.cloud;
    FramePoints all;
    all.points = cloud.points;
    all.visibility = work.attached.per_point;
    all.confidence = work.confidence.per_point;
    std::ranges::transform(all.confidence, all.confidence.begin(), known_or_none);
    if (outputs.error)
        all.error = work.error.per_point;
    if (has_colours(cloud))
        all.colours = cloud.colours;
    if (outputs.colour_cloud != CloudColours::kept)
        all.colours = cloud_colours(all.colours, all.visibility, outputs);
    return all;
}

} // namespace scanshade
