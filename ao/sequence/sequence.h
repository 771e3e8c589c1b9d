// Frames of one recording, each looked at together with those around it: what hides from one view, another has seen.
#pragma once

#include "ao/fit_plane/fit_plane.h"
#include "ao/method.h"
#include "ao/sequence/agreement.h"
#include "ao/sequence/gather.h"
#include "ao/sequence/pack.h"

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace scanshade {

struct SequenceOptions {
    int layers = 0;  ///< other views whose surfaces occlude; 0 = none
    int reach = 9;   ///< how many frames away they may be
    int fuse = 0;    ///< frames around it that noisy depth is averaged with; 0 = none
    int average = 0; ///< frames around it whose visibility is averaged with its own; 0 = none

    [[nodiscard]] std::vector<Parameter> parameters();
    [[nodiscard]] bool any() const { return layers > 0 || fuse > 0 || average > 0; }
};

/// What came of one frame, and which others it was looked at with.
struct SequenceResult {
    AoMap ao;
    DepthImage depth; ///< as it was looked at: of noisy depth, the fitted planes'
    Timings timings;
    std::vector<std::size_t> neighbours; ///< places of the views whose surfaces occlude
    std::vector<std::string> notes;      ///< what was left out, and why
};

/// Not thread-safe: one call at a time. A frame's result depends on the frames within reach() of it and on nothing else.
class Sequence {
  public:
    /// Keeps references to device and method.
    Sequence(gpu::Device& device, Method& method, double radius_m, const DepthNoise& noise, const FitPlaneOptions& fit,
             const SequenceOptions& options);

    /// How many frames before and behind it a frame's result depends on.
    [[nodiscard]] std::size_t reach() const { return static_cast<std::size_t>((options_.layers > 0 ? options_.reach : 0) + (options_.fuse + 1) / 2 + (options_.average + 1) / 2); }
    /// Frame `place` of the recording. Without a pose it is looked at by itself.
    void add(std::size_t place, const DepthImage& depth, const std::optional<Eigen::Isometry3d>& world_from_camera);
    /// Of an added frame; what lies within reach of it has been added, too, or is missing for good.
    [[nodiscard]] SequenceResult compute(std::size_t place);
    /// Frames before `place` are needed no more.
    void forget_before(std::size_t place);

  private:
    /// A frame that fits together with another, and from where it saw it.
    struct Fitting {
        std::size_t place;
        Eigen::Isometry3d here_from_there;
        double misfit_m;
    };
    struct Slot {
        DepthImage depth;
        std::optional<Eigen::Isometry3d> world_from_camera;
        std::optional<DepthImage> kept; ///< without flying pixels
        std::optional<Facets> facets;
        std::optional<FittedDepth> fitted;
        std::optional<PackedSurfaces> packed;
        std::optional<AoMap> ao; ///< before any averaging
        std::map<std::size_t, std::optional<Fitting>> fittings;
        std::vector<std::size_t> neighbours;
        std::vector<std::string> notes;
    };
    [[nodiscard]] const DepthImage& kept(Slot& slot);
    [[nodiscard]] const Facets& facets(Slot& slot);
    [[nodiscard]] View view_of(std::size_t place);
    [[nodiscard]] const PackedSurfaces& packed(std::size_t place);
    [[nodiscard]] const AoMap& visibility(std::size_t place);
    [[nodiscard]] std::optional<Fitting> fitting(std::size_t here, std::size_t there);
    [[nodiscard]] std::vector<Fitting> spread_views(std::size_t place);
    [[nodiscard]] std::vector<Fitting> adjacent_views(std::size_t place, int count);
    void account(std::string_view step, const Timings& timings);

    Method& method_;
    SequenceOptions options_;
    DepthNoise noise_;
    std::optional<FitPlane> drop_flying_, fit_;
    PackSurfaces pack_;
    Gather gather_;
    double radius_m_;
    std::map<std::size_t, Slot> slots_;
    Timings timings_; ///< since the last result
};

} // namespace scanshade
