// Before a capture's first frame: what a few of its frames show, and what follows for the radius, for clouds and for
// doubts. Program and library ask here, so that both compute the same.
#pragma once

#include "apps/frame/frame_options.h"
#include "apps/session/settings.h"
#include "projection/base/finding.h"
#include "projection/project.h"

#include <functional>
#include <span>
#include <string>
#include <vector>

namespace scanshade {

struct CaptureLook {
    DepthNoise noise;
    double extent_m = 0;   ///< of the scene: the median of SceneExtent::diagonal_m; 0 = not looked at
    bool as_views = false; ///< its clouds are noisy images of one camera each, though they have no grid
};

/// Measures noise and extent on some of `frames`, as far as the settings leave them open. `loaded` receives frames that
/// were decoded, with their colour if `with_colour`.
[[nodiscard]] CaptureLook look_at(const Capture& capture, const std::vector<std::size_t>& frames,
                                  const RunSettings& asked, LoadedFrames& loaded, bool with_colour = false);
/// Whether depth images have to be looked at: the settings leave their noise or the radius open.
[[nodiscard]] bool needs_look(const RunSettings& asked);
/// The same as look_at() of depth images in memory, some of a recording's; none where none has to be looked at.
[[nodiscard]] CaptureLook look_at(std::span<const DepthImage> seen, const RunSettings& asked);

/// How the capture's clouds are computed: as asked, but from their points by methods that need no view, and as views
/// where these are better.
[[nodiscard]] CloudWalk cloud_walk_for(const RunSettings& asked, const CaptureLook& look);
/// Whether the capture holds clouds that are computed from their points. Judged by the clouds in memory; those that
/// were not kept have no grid, or the noise was not measured.
[[nodiscard]] bool computes_points(const Capture& capture, const LoadedFrames& loaded, CloudWalk walk);

/// The radius that was set; where none was, and the scene is too small for the usual one, a radius that suits it.
[[nodiscard]] double radius_for(const RunSettings& asked, const CaptureLook& look);

/// Sentences about choices that nobody asked for: `radius_m` of a small scene, clouds that are computed as images.
[[nodiscard]] std::vector<std::string> warnings_about(const RunSettings& asked, const CaptureLook& look,
                                                      double radius_m);

/// Who gave the noise of the depth: "measured", or the flag.
[[nodiscard]] std::string noise_origin(const RunSettings& asked);
/// The depth's noise, in metres or the capture's unit, and how the depth is prepared.
[[nodiscard]] std::string noise_sentence(const DepthNoise& noise, const RunSettings& asked,
                                         const LengthUnit& unit = {});

/// What is wrong with the capture as a whole.
struct CaptureFindings {
    std::vector<std::string> warnings;
    Findings findings; ///< their doubts are also among the warnings; each of the capture's images has them
};
/// Checks depths against poses. `load`: of images in memory; see check_poses().
[[nodiscard]] CaptureFindings findings_about(const Capture& capture, const std::vector<std::size_t>& frames,
                                             const RunSettings& asked,
                                             const std::function<Frame(std::size_t)>& load = {});

} // namespace scanshade
