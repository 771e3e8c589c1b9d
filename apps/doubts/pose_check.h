// Before the walk: whether a recording's depths fit its poses.
#pragma once

#include "io/captures/capture.h"

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

namespace scanshade {

struct PoseCheck {
    std::string warning;        ///< empty = nothing is wrong, or nothing can be told
    bool doubts_depths = false; ///< depths may be in a wrong unit: then all results of the capture are doubtful
};

/// Whether pairs of the frames agree that all depths are too long or too short for the poses' motion, or that the poses
/// must be read in another way. By a factor of more than 20, poses in another unit are likelier than depths.
/// Decodes up to six depth images, by `load` where the capture is a list of images in memory.
[[nodiscard]] PoseCheck check_poses(const Capture& capture, const std::vector<std::size_t>& frames,
                                    const std::function<Frame(std::size_t)>& load = {});

} // namespace scanshade
