// After a frame is computed: values on the recorded pixels or points, confidence, maps and pictures.
#pragma once

#include "apps/frame/work.h"

namespace scanshade {

/// What the pictures of a frame show, all on one pixel grid.
struct Scene {
    cv::Mat1f z_m, visibility;
    cv::Mat3b colour; ///< empty unless it fits the depth
    Pinhole camera;
    cv::Mat1b colour_known = {}; ///< 0 where `colour` has none; empty = known everywhere
    cv::Mat1f confidence = {};   ///< in the colour view; empty = as attached
    cv::Mat1f error = {};        ///< likewise
    cv::Mat3w deep_colour = {};  ///< `colour` where it was recorded with 16 bits
};

/// Values of an organised cloud's points as an image; shares their memory.
template <class Pixel>
[[nodiscard]] cv::Mat_<Pixel> on_grid(const std::vector<Pixel>& values, cv::Size grid) {
    return cv::Mat_<Pixel>(grid.height, grid.width, const_cast<Pixel*>(values.data()));
}

/// Whether a secondary camera took the colour images, so that they must be warped.
[[nodiscard]] bool has_secondary_camera(const Frame& frame);

/// A depth frame is shown on its recorded pixels, an organised cloud on its grid, other clouds as projected.
/// A point has its own colour. A depth pixel has a colour only if the images are registered, or if the pose of the
/// secondary camera is known.
[[nodiscard]] Scene scene_of(const Work& work, bool colour_view);

/// What is encoded: a scene, and what was made of it. Empty images were not asked for, or there is no device; values
/// are then quantised where they are written.
struct FrameImages {
    Scene scene;
    cv::Mat map;              ///< of visibility, as the format's integers
    cv::Mat1b confidence_map; ///< likewise
    cv::Mat3b shaded;         ///< colour times visibility; clay where there is no colour, or its camera did not see
    cv::Mat3b unshaded = {}, ambient = {}, direct = {}, indirect = {}; ///< where there is colour
    LinearLight linear = {};                ///< in their place, for files of more than 8 bits
    AoFormat light_format = AoFormat::png8; ///< of these files
};

/// Attaches visibility and confidence to what was recorded, and makes the images that `outputs` asks for, on the device
/// that computed the frame. `every_error`: the expected error of each pixel is needed whatever files are.
[[nodiscard]] FrameImages finish(Work& work, const FrameOptions& options, const Outputs& outputs,
                                 bool every_error = false);

} // namespace scanshade
