// How a frame or cloud is computed, and what is made of it.
#pragma once

#include "ao/base/method.h"
#include "ao/finish/light.h"
#include "apps/frame/outputs.h"
#include "io/captures/capture.h"
#include "projection/base/finding.h"
#include "projection/project.h"
#include "projection/sensor/noise.h"

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace scanshade {

/// How clouds are computed: rays from each point, one camera's view, or points unless one camera saw them all.
enum class CloudWalk { automatic, points, view };

/// Whether cloud files of one capture are tiles of one survey, whose points see each other: as their boxes tell, all of
/// them, or none.
enum class CloudTiles { automatic, join, separate };

struct FrameOptions {
    Outputs outputs;
    ProjectOptions range;          ///< depth outside counts as a hole
    double radius_m = 0;           ///< the method's
    DepthNoise noise;              ///< the depth's, on which confidence depends
    Findings findings;             ///< about the capture as a whole: each of its images has them
    std::optional<Light> light;    ///< of the colour images, where outputs need it
    PointMethod* points = nullptr; ///< computes clouds and meshes where `cloud_walk` asks for points
    CloudWalk cloud_walk = CloudWalk::automatic;
};

/// A frame that was decoded before the walk began, so that the walk need not decode it again.
struct LoadedFrame {
    Frame frame;
    double took_ms = 0;
};
using LoadedFrames = std::map<std::size_t, LoadedFrame>; ///< by index in the capture

} // namespace scanshade
