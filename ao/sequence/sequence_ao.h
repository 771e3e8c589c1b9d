// Frames of one recording, each looked at together with those around it: what hides from one view, another has seen.
#pragma once

#include "ao/base/method.h"
#include "ao/fit_plane/fit_plane.h"
#include "ao/gpu/image_upload.h"
#include "ao/sequence/agreement.h"
#include "ao/sequence/gather.h"
#include "ao/sequence/pack.h"

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace scanshade {

/// A recording's frames can be fused, seen through each other, and averaged; 0 = not so.
struct SequenceAoOptions {
    int fuse = 12;    ///< frames around each that noisy depth is averaged with
    int layers = 6;   ///< other views whose surfaces occlude what a frame shows; of use to surfel and vxao
    int reach = 0;    ///< how many frames away these may be; 0 = as reach_for() has it, which the caller asks
    int average = 12; ///< frames around each whose visibility is averaged with its own

    [[nodiscard]] std::vector<Parameter> parameters();
    /// How many frames before and behind it a frame's result may depend on.
    [[nodiscard]] std::size_t farthest() const {
        return static_cast<std::size_t>((layers > 0 ? reach : 0) + (fuse + 1) / 2 + (average + 1) / 2);
    }
};

/// How many frames away neighbours may be: so many as the camera takes to move by the radius, since from nearer ones
/// less is seen that a frame itself does not see; at least 4, at most 30.
[[nodiscard]] int reach_for(std::span<const std::optional<Eigen::Isometry3d>> world_from_camera, double radius_m);

/// Frames that are looked at by themselves, though prepared like those of a recording.
[[nodiscard]] inline SequenceAoOptions alone() { return {.fuse = 0, .layers = 0, .average = 0}; }

/// A frame that would have been looked at, had it agreed.
struct LeftOut {
    std::size_t index;
    Agreement agreement;
};

/// What came of one frame, and which others it was looked at with.
struct SequenceAoResult {
    AoMap ao;
    DepthImage depth; ///< as it was looked at: of noisy depth, the fitted planes'
    Timings timings;
    std::vector<std::size_t> fused, neighbours, averaged; ///< indices of the frames it was looked at with
    std::vector<LeftOut> left_out;
    MethodRemarks remarks; ///< the method's

    /// How many different frames it was looked at with.
    [[nodiscard]] std::size_t others() const;
};

/// What share of the usual gain (`together` of MethodErrors, of a dozen others) so many others bring, as the README's
/// table has it: 7/6 n / (n + 2), at most 1.
[[nodiscard]] double share_of_gain(std::size_t others);

/// Not thread-safe: one call at a time. A frame's result depends on the frames within reach() of it and on nothing
/// else.
class SequenceAo {
  public:
    /// Keeps references to device and method.
    SequenceAo(gpu::Device& device, Method& method, double radius_m, const DepthNoise& noise,
               const FitPlaneOptions& fit, const SequenceAoOptions& options);

    /// How many frames before and behind it a frame's result depends on.
    [[nodiscard]] std::size_t reach() const { return options_.farthest(); }
    /// Frame `index` of the recording. Without a pose it is looked at by itself.
    void add(std::size_t index, const DepthImage& depth, const std::optional<Eigen::Isometry3d>& world_from_camera);
    /// Of an added frame; what lies within reach of it has been added, too, or is missing for good.
    [[nodiscard]] SequenceAoResult compute(std::size_t index);
    /// Of the last compute(): how visibility was averaged, if it was.
    [[nodiscard]] std::vector<Intermediate> intermediates() {
        return averaged_ ? gather_.intermediates() : std::vector<Intermediate>();
    }
    /// Frames before `index` are needed no more.
    void forget_before(std::size_t index);

  private:
    /// A frame that fits together with another, and from where it saw it.
    struct Fitting {
        std::size_t index;
        Eigen::Isometry3d here_from_there;
        double alignment_error_m;
    };
    /// How two frames lie to each other.
    struct PairRegistration {
        Agreement agreement;
        Eigen::Isometry3d earlier_from_later;
    };
    struct Slot {
        DepthImage depth;
        std::optional<Eigen::Isometry3d> world_from_camera;
        std::optional<DepthImage> kept;                               ///< without flying pixels
        std::shared_ptr<const gpu::DeviceBytes> kept_there, ao_there; ///< on the device
        std::optional<Facets> facets;
        std::optional<FittedDepth> fitted;
        std::optional<PackedSurfaces> packed;
        std::optional<AoMap> ao;                               ///< before any averaging
        std::map<std::size_t, PairRegistration> registrations; ///< with later frames
        std::vector<std::size_t> fused, neighbours;
        std::vector<LeftOut> left_out;
        MethodRemarks remarks;
    };
    [[nodiscard]] const DepthImage& kept(Slot& slot);
    [[nodiscard]] const Facets& facets(Slot& slot);
    [[nodiscard]] View view_of(std::size_t index);
    static void let_go(Slot& slot);
    /// Where the frame itself has no depth: holes that others have filled occlude, but have no value.
    [[nodiscard]] cv::Mat1b holes(Slot& slot) { return cv::Mat1b(kept(slot).z_m <= 0); }
    [[nodiscard]] const PackedSurfaces& packed(std::size_t index);
    [[nodiscard]] const AoMap& visibility(std::size_t index);
    [[nodiscard]] Seen seen(std::size_t index);
    /// How it lies to those of the others that there are, all at once.
    void register_with(std::size_t index, std::span<const std::size_t> others);
    [[nodiscard]] PairRegistration registered(const Slot& earlier, const Slot& later) const;
    [[nodiscard]] std::optional<Fitting> fitting(std::size_t here, std::size_t there);
    [[nodiscard]] std::vector<Fitting> spread_views(std::size_t index);
    [[nodiscard]] std::vector<Fitting> adjacent_views(std::size_t index, int count);
    void account(std::string_view step, const Timings& timings);

    Method& method_;
    SequenceAoOptions options_;
    DepthNoise noise_;
    std::optional<FitPlane> drop_flying_, fit_;
    PackSurfaces pack_;
    gpu::ImageUpload upload_;
    Gather gather_;
    double radius_m_;
    std::map<std::size_t, Slot> slots_;
    Timings timings_; ///< since the last result
    bool averaged_ = false;
};

} // namespace scanshade
