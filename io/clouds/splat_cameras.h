// The cameras that Gaussian splats were made with, as their authors' program writes them beside its results.
#pragma once

#include "projection/found_frames.h"

#include <filesystem>
#include <string>
#include <vector>

namespace scanshade {

/// From cameras.json in the folder of the splats' file, or in the nearest of the three above that has one
/// (MODEL/point_cloud/iteration_N/point_cloud.ply): a list of `width height fx fy`, `position` of the camera in the
/// splats' axes and `rotation`, world_from_camera row by row (Kerbl et al. 2023, utils/camera_utils.py). Principal
/// points are in the middle; no points are theirs. Empty where there is none, or where `warnings` says why it is not
/// believed.
[[nodiscard]] std::vector<FoundFrame> splat_cameras(const std::filesystem::path& splats,
                                                    std::vector<std::string>& warnings);

} // namespace scanshade
