// Everything that `scanshade run` can be told, and what that means to the walk.
#pragma once

#include "ao/fit_plane/fit_plane.h"
#include "ao/method.h"
#include "ao/sequence/neighbourhood.h"
#include "apps/command.h"
#include "apps/measure/budget.h"
#include "apps/walk/batch.h"

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace scanshade {

/// What was typed, or its default; the rows of stages() are bound to it.
class RunSettings {
  public:
    RunSettings();

    std::vector<std::string> paths;
    std::string frames, camera, poses, depth_scale, registered = "auto";
    std::string depth_noise = "auto", depth_range, flying_pixels = "drop";
    double depth_smoothing = 1;
    double association_limit_s = 0.02;
    std::string sequence = "off", method = "cacao", radius, quality, device, settings, clouds = "auto";
    int in_flight = 0;
    Budget budget;
    std::string out, write = "auto", format = "png16", view = "depth", dump;
    double shade_strength = 1;
    std::string recording_cloud;
    double cloud_resolution_m = 0;
    bool colour_cloud = false, overwrite = false, resume = false, retry = false;
    std::string shard, log = "text";
    CloudAoOptions clouds_by_points;
    NeighbourhoodOptions sequences;

    /// Every row there is, as the help groups them.
    [[nodiscard]] std::vector<Stage> stages();
    /// Without those of methods that were not chosen: what a report holds, and results depend on.
    [[nodiscard]] std::vector<Stage> stages_in_use();
    /// Throws Misuse where settings do not go together.
    void check() const;

    [[nodiscard]] Outputs outputs() const; ///< without a folder
    [[nodiscard]] ProjectOptions range() const;
    [[nodiscard]] std::optional<Registration> registration() const;
    [[nodiscard]] CloudWalk cloud_walk() const;
    [[nodiscard]] FitPlaneOptions preparation() const; ///< of noisy depth
    /// As given; --radius holds for clouds, too, and --cloud.radius before it.
    [[nodiscard]] CloudAoOptions cloud_ao() const;
    /// The chosen method's settings, --radius and --quality put in their rows.
    [[nodiscard]] MethodSetup& chosen_setup();
    [[nodiscard]] double radius_m(); ///< the chosen method's

  private:
    [[nodiscard]] std::vector<Stage> common_stages();
    [[nodiscard]] Stage cloud_stage();    ///< --cloud.rays and so on
    [[nodiscard]] Stage sequence_stage(); ///< --sequence.layers and so on
    /// What --radius and --quality are when not given, as their help says it.
    [[nodiscard]] std::pair<std::string, std::string> method_defaults();
    [[nodiscard]] MethodSetup& setup_of(std::string_view name);

    std::vector<std::pair<std::string, std::unique_ptr<MethodSetup>>> setups_;
};

} // namespace scanshade
