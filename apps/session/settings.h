// What was asked for: settings by rows, and the options of the walk that follow from them.
#pragma once

#include "ao/base/method.h"
#include "ao/base/quality.h"
#include "ao/cloud/cloud_ao.h"
#include "ao/fit_plane/fit_plane.h"
#include "ao/sequence/sequence_ao.h"
#include "apps/command.h"
#include "apps/frame/frame_options.h"
#include "apps/method_settings.h"
#include "apps/session/limits.h"
#include "apps/session/presets.h"

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace scanshade {

/// Whether frames of a recording are computed together; automatic: if at least two frames have a pose.
enum class SequenceUse { off, on, automatic };

/// Settings as typed, or their defaults. The parser fills them through the rows of stages(); then call resolve() once.
class RunSettings {
  public:
    RunSettings();

    std::vector<std::string> paths;
    std::string frames, camera, colour, poses, depth_scale;
    Registration registered = Registration::unknown; ///< unknown: as the capture says
    std::string depth_noise = "auto", depth_range;
    bool drop_flying = true;
    double depth_smoothing = 1;
    double association_limit_s = 0.02;
    std::string topic;
    int confidence_min = 1;
    bool copc = true;
    Preset preset = Preset::fast;
    SequenceUse sequence = SequenceUse::off;
    std::string method = "cacao", device, settings;
    std::optional<double> radius;
    double relative_radius = 0.1; ///< of the median depth, where the unit is arbitrary
    std::optional<Quality> quality;
    CloudTiles cloud_tiles = CloudTiles::automatic;
    CloudWalk clouds = CloudWalk::automatic;
    int in_flight = 0;
    Budget budget;
    std::string out, write = "auto", dump;
    AoFormat format = AoFormat::png16;
    std::optional<AoFormat> colour_format = {};
    bool colour_view = false;
    TextureOutput texture = {};
    std::string tiles_crs;
    Shade shade = Shade::multiply;
    std::string light = "auto";
    double shade_strength = 1;
    std::string recording_cloud;
    double cloud_resolution_m = 0;
    CloudColours colour_cloud = CloudColours::kept;
    bool page = true;
    std::string page_points = "1000000";
    int frames_in_tar = 0;
    bool overwrite = false, resume = false, retry = false;
    std::string shard, scratch;
    bool no_locks = false;
    double scratch_limit_gb = 0;
    bool strict = false, quiet = false, log_json = false;
    CloudAoOptions clouds_by_points;
    SequenceAoOptions sequences;

    /// All rows, grouped as in the help.
    [[nodiscard]] std::vector<Stage> stages();
    /// All rows except those of other methods: these shape the results and are in the report.
    [[nodiscard]] std::vector<Stage> stages_in_use() { return stages_in_use(chosen_setup()); }
    /// The same with the method's settings as a capture is computed with; see setup_with().
    [[nodiscard]] std::vector<Stage> stages_in_use(MethodSetup& setup);

    /// Changes defaults to those of `preset`; call it before anything else is set.
    void take_preset();
    /// Call it once everything is set. Puts --radius and --quality into the chosen method's settings and splits lists.
    /// Throws Misuse for settings that contradict each other.
    void resolve();
    /// Replaces method and settings of a budget's last choice by those of the new one.
    void choose(const Configuration& picked);

    // Results of resolve().
    [[nodiscard]] const Outputs& outputs() const { return outputs_; } ///< without a folder
    [[nodiscard]] const ProjectOptions& range() const { return range_; }
    [[nodiscard]] std::optional<Registration> registration() const;
    [[nodiscard]] FitPlaneOptions preparation() const; ///< of noisy depth
    /// --radius applies to clouds, too; --cloud.radius overrides it.
    [[nodiscard]] const CloudAoOptions& cloud_ao() const { return cloud_options_; }
    [[nodiscard]] MethodSetup& chosen_setup() const { return setup_of(method); }
    [[nodiscard]] double radius_m() const; ///< the chosen method's
    /// Whether somebody chose the radius, or other lengths of the method, which go with it.
    [[nodiscard]] bool gives_radius() const;
    /// The chosen method's settings with that radius, for one capture.
    [[nodiscard]] std::unique_ptr<MethodSetup> setup_with(double radius_m) const;
    /// "--radius 0.5": what was set in metres, or is chosen by sensors' noise in metres. None of it can be used for a
    /// capture in an arbitrary unit.
    [[nodiscard]] std::vector<std::string> given_in_metres();
    /// Of such a capture, in the walk's lengths: the method's radius is then the asked part of it.
    [[nodiscard]] double median_depth() const;
    [[nodiscard]] bool in_sequence(const Capture& capture) const;
    /// Whether the capture needs a Vulkan device even if its clouds are computed from their points.
    [[nodiscard]] bool asks_for_device(const Capture& capture) const;

  private:
    [[nodiscard]] std::vector<Stage> common_stages();
    [[nodiscard]] Stage cloud_stage();    ///< --cloud.rays and so on
    [[nodiscard]] Stage sequence_stage(); ///< --sequence.layers and so on
    [[nodiscard]] MethodSetup& setup_of(std::string_view name) const;
    void refuse_settings_of_others() const;
    void put_common_settings();

    std::vector<std::pair<std::string, std::unique_ptr<MethodSetup>>> setups_;
    Outputs outputs_;
    ProjectOptions range_;
    CloudAoOptions cloud_options_;               ///< as typed; see cloud_ao()
    std::optional<Configuration> before_choice_; ///< the method of a budget's last choice, as it was before
};

/// Whether at least two depth frames have a pose, so that frames can be computed together.
[[nodiscard]] bool has_poses(const Capture& capture);

} // namespace scanshade
