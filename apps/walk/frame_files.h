// The last step of the walk: what a frame's values look like, and its files.
#pragma once

#include "apps/walk/work.h"

namespace scanshade {

/// What the pictures of a frame show, all on one pixel grid.
struct Scene {
    cv::Mat1f z_m, visibility;
    cv::Mat3b colour; ///< empty unless it fits the depth
    Pinhole camera;
    cv::Mat1b colour_known = {}; ///< 0 where `colour` has none; empty = known everywhere
    cv::Mat1f confidence = {};   ///< in the colour view; empty = as attached
};

/// A depth frame is shown on its recorded pixels, an organised cloud on its grid, other clouds as projected.
/// A point's colour is its own; a depth pixel's colour is claimed only where the images are registered, or where it is
/// known how the colour camera stands beside the depth camera.
[[nodiscard]] Scene scene_of(const Work& work, bool colour_view);

/// Colour times visibility; clay where there is no colour, or the colour camera did not see.
[[nodiscard]] cv::Mat3b shaded_picture(const Scene& scene, double strength);

/// Everything that `outputs` asks for of a frame with a view; row.files tells what.
void write_all(Work& work, const Scene& scene, const cv::Mat3b& shaded, const Outputs& outputs);
/// A cloud without a view, as it looks from two opposite sides.
void write_sides(Work& work, const Outputs& outputs);
/// A failed frame leaves neither part of its own files nor those of an earlier run: what lies there is what the row
/// says.
void remove_files(Work& work, const Outputs& outputs);

/// Every array as .npy, and index.csv that says what they are.
void write_intermediates(const std::filesystem::path& folder, const std::vector<Intermediate>& all);

/// The frame's surface with its values, as a view of the recording. Frames without a pose add nothing.
void add_to(RecordingCloud& cloud, const Work& work);

} // namespace scanshade
