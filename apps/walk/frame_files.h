// The last step of the walk: a frame's pictures and files.
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
/// A point has its own colour. A depth pixel has a colour only if the images are registered, or if the pose of the
/// secondary camera is known.
[[nodiscard]] Scene scene_of(const Work& work, bool colour_view);

/// Colour times visibility; clay where there is no colour, or the colour camera did not see.
[[nodiscard]] cv::Mat3b shaded_picture(const Scene& scene, double strength);

/// Writes every file that `outputs` asks for, for a frame with a view; row.files lists them.
void write_all(Work& work, const Scene& scene, const cv::Mat3b& shaded, const Outputs& outputs);
/// Writes a picture of a cloud without a view: cloud_picture(), in the folder of shaded pictures or else of panels.
void write_cloud_picture(Work& work, const Outputs& outputs);
/// Removes the files of a failed frame, and those of an earlier run: files never contradict the row.
void remove_files(Work& work, const Outputs& outputs);

/// Writes every array as .npy, and an index.csv that describes them.
void write_intermediates(const std::filesystem::path& folder, const std::vector<Intermediate>& all);

/// Adds the frame's surface with its values. Frames without a pose add nothing.
void add_to(RecordingCloud& cloud, const Work& work);

} // namespace scanshade
