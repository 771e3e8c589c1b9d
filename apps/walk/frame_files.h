// The last step of the walk: a frame's pictures and files.
#pragma once

#include "apps/frame/frame_images.h"
#include "apps/results/recording_cloud.h"

namespace scanshade {

/// Writes every file that `outputs` asks for, for a frame with a view; row.files lists them.
void write_all(Work& work, const FrameImages& images, const Outputs& outputs);
/// Writes a picture of a cloud without a view: cloud_picture(), in the folder of shaded pictures or else of panels.
/// Returns its name.
[[nodiscard]] std::filesystem::path write_cloud_picture(const Work& work, const Outputs& outputs);
/// Writes points/NAME.000.js and on: a cloud computed from its points, as the page draws it. Returns their names.
[[nodiscard]] std::vector<std::filesystem::path> write_page_points(const Work& work, const Outputs& outputs);
/// Removes the files of a failed frame, and those of an earlier run: files never contradict the row.
void remove_files(Work& work, const Outputs& outputs);

/// Writes every array as .npy, and an index.csv that describes them.
void write_intermediates(const std::filesystem::path& folder, const std::vector<Intermediate>& all);

/// Adds the frame's surface with its values. Frames without a pose add nothing.
void add_to(RecordingCloud& cloud, const Work& work);

} // namespace scanshade
