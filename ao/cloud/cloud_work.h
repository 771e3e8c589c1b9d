// One cloud, or a part of one, being computed: what is decided once for the whole, and the steps on these points.
#pragma once

#include "ao/base/watch.h"
#include "ao/cloud/back_share.h"
#include "ao/cloud/chosen_points.h"
#include "ao/cloud/cloud_ao.h"
#include "ao/cloud/cloud_error.h"
#include "ao/cloud/cloud_notes.h"
#include "ao/cloud/extent.h"
#include "ao/cloud/repeatability.h"
#include "ao/cloud/settled_sides.h"
#include "ao/cloud/surface/cloud_gpu.h"
#include "ao/cloud/surface/disc_rays.h"
#include "ao/cloud/surface/fitted_cloud.h"
#include "ao/cloud/twins.h"
#include "projection/base/stopwatch.h"

#include <cstdint>
#include <Eigen/Core>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace scanshade {

/// What a person asked for, and where it is computed.
struct CloudSetup {
    const CloudAoOptions& options;
    gpu::Device* device; ///< null = the processor
    Eigen::Vector3d up;
    std::optional<Eigen::Vector3d> viewpoint; ///< given by the user
};

/// Points in work at once.
[[nodiscard]] std::size_t points_at_once(const CloudSetup& setup);

/// Rays a point, and how often the mean over neighbours is taken.
struct RaysAndMeans {
    int rays, passes;
};

/// What is decided once for a cloud, and holds for every part of it.
struct CloudDecisions {
    Extent extent;
    NormalOrientation orientation;
    double radius = 0, spacing = 0;
    double points = 0; ///< of the whole, copies of points counted once
    bool noise_exceeds_spacing = false;
};

/// What was decided, and what it was decided on.
struct DecidedCloud {
    CloudDecisions decisions;
    Indices within, strays; ///< strays lie beyond the cloud
    std::vector<std::string> notes;
};
/// From the points of `cloud` with the numbers `finite`, of which some are looked at. `sample_of`: how many points the
/// cloud has that they are a sample of; none: they are all of it.
[[nodiscard]] DecidedCloud decide(const CloudSetup& setup, const PointSet& cloud,
                                  const std::optional<Eigen::Vector3d>& scanner, Indices finite,
                                  std::optional<double> sample_of = {});

/// The sides of a cloud of several tiles, settled once on a part of it, so that tiles agree.
struct WholeSides {
    CloudSurface surface;
    std::vector<float> known; ///< by index in the tree; empty where recorded sides are kept
};

/// What a tile takes from the cloud that it is a part of.
struct OfWhole {
    CloudDecisions decisions;
    std::optional<WholeSides> sides;
    std::optional<SharedNoise> noise; ///< none: it is not known, and nothing is smoothed
    bool normals_refused = false;     ///< recorded ones
    bool recorded_kept = false;       ///< the sides of recorded normals stay
    bool twins = false;               ///< there are copies of points
};

class CloudWork {
  public:
    /// A cloud by itself.
    [[nodiscard]] static CloudWork of_cloud(const CloudSetup& setup, const PointSet& cloud,
                                            const std::optional<Eigen::Vector3d>& scanner);
    /// A thinned part of another cloud, which computes and checks what is beyond.
    [[nodiscard]] static CloudWork of_part(const CloudSetup& setup, const PointSet& part,
                                           const std::optional<Eigen::Vector3d>& scanner, const CloudDecisions& whole);
    /// A tile with its rim, all of them finite and no strays. `whole` must outlive it.
    [[nodiscard]] static CloudWork of_tile(const CloudSetup& setup, const PointSet& tile, const OfWhole& whole);
    CloudWork(const CloudWork&) = delete;
    CloudWork& operator=(const CloudWork&) = delete;

    [[nodiscard]] PointVisibility run();

    struct TileResult {
        PointVisibility values; ///< NaN for the rim. Errors of a cloud that is still to be checked are the first step's
        std::vector<KeptSigns> kept_signs; ///< of such a cloud: for the second step, error_once_checked()
        FittedCounts fitted;
        std::size_t twins = 0; ///< in the core
        bool on_gpu = false;
    };
    /// Values of the core: those points whose byte in `in_core` is not 0.
    [[nodiscard]] TileResult run_tile(std::span<const char> in_core);

    /// The cloud is a sample of another one: its sides. The rest of what they tell is in sides(), normals_refused().
    [[nodiscard]] WholeSides settle_sides();

    [[nodiscard]] const SettledSides& sides() const { return sides_; }
    [[nodiscard]] bool normals_refused() const { return normals_refused_; }
    /// Of every point; where CloudAoOptions::keep_signs asks for them.
    [[nodiscard]] std::vector<CloudErrorSigns> take_signs() { return std::move(signs_); }
    /// Sentences so far: what was chosen before the computing.
    [[nodiscard]] const std::vector<std::string>& notes() const { return result_.notes; }

    /// Strays by themselves, with the radius of the cloud that they lie beyond.
    [[nodiscard]] static PointVisibility of_strays(const CloudSetup& setup, const PointSet& strays,
                                                   const std::optional<Eigen::Vector3d>& scanner, double radius,
                                                   double spacing);
    static constexpr std::size_t fewest_strays = 64; ///< fewer make no surface

  private:
    /// What the points are: what is beyond them, is checked or told, is not the business of parts.
    enum class Role { cloud, part, tile, strays };
    struct Start {
        Stopwatch begun;
        DecidedCloud decided;
        std::vector<Twin> twins;
        const OfWhole* whole = nullptr; ///< of a tile
    };
    CloudWork(Role role, const CloudSetup& setup, const PointSet& cloud, const std::optional<Eigen::Vector3d>& scanner,
              Start start);

    struct Picked {
        std::vector<Eigen::Vector3d> points, normals, seen_from;
    };
    struct Fitted {
        CloudSurface surface;
        FittedCloud points; ///< empty where the surface's points are those of the cloud
    };

    /// Of a tile, what values are needed for; empty = all of it.
    struct Wanted {
        std::vector<char> in_core; ///< by place in the tile
        std::vector<char> fitted;  ///< by place among the surface's points before they were put in order
        [[nodiscard]] bool has(const CloudSurface& surface, std::size_t index) const {
            return fitted.empty() || fitted[surface.tree.original(index)];
        }
    };

    void require_results();
    [[nodiscard]] FittedCloud without_noise(const LocalCloud& local, std::span<const Eigen::Vector3d> points,
                                            std::span<const Eigen::Vector3d> normals);
    [[nodiscard]] Picked picked(const Indices& indices) const;
    void compute_strays();
    [[nodiscard]] ThinnedCheck check_of_whole() const; ///< keep = 0: none
    [[nodiscard]] bool is_checked() const;
    void compute_thinned();
    void copy_to_twins();
    void tell_error();
    void tile(const Indices& core, const Indices& round);
    void tile(const Indices& core, const Indices& round, CloudGpu* gpu);
    [[nodiscard]] static Wanted wanted_of(const Indices& core, const Indices& round, const FittedCloud& fitted);
    [[nodiscard]] float reach() const;
    [[nodiscard]] Untouched<float> visibility_of(const CloudSurface& surface, std::optional<DiscRays> rays,
                                                 const Wanted& wanted, CloudGpu* gpu);
    void attach(const Fitted& planes, const Untouched<float>& values, const std::vector<float>& side_known,
                const std::vector<float>& backs, const Indices& round, const Wanted& wanted);
    [[nodiscard]] std::vector<float> sides_as_in_whole(CloudSurface& surface) const;
    void turn_to_cameras(CloudSurface& surface, const FittedCloud& fitted, const Indices& round);
    void note_lines(const CloudSurface& surface);
    [[nodiscard]] Fitted planes_of(const Indices& which, CloudGpu* gpu);
    [[nodiscard]] bool recorded() const;
    void tell();

    const Role role_;
    const CloudSetup& setup_;
    const CloudAoOptions& options_;
    std::optional<Eigen::Vector3d> scanner_;
    const PointSet& cloud_;
    const OfWhole* whole_; ///< of a tile, else null
    CloudDecisions decided_;
    PointVisibility result_;
    std::vector<KeptSigns> kept_signs_;  ///< of a cloud that is still to be checked; else empty
    std::vector<CloudErrorSigns> signs_; ///< only where asked for
    Watch watch_;
    std::optional<CloudGpu> gpu_;
    const RaysAndMeans rays_;
    const DirectionSet directions_;
    SettledSides sides_;
    Indices valid_, strays_;  ///< strays lie beyond the cloud
    Indices order_;           ///< the points in the order of the tree; empty where they were fitted
    std::vector<Twin> twins_; ///< copies of points, in neither
    bool normals_refused_;
    FittedCounts fitted_;
    double error_by_check_ = 0, lines_ = 0; ///< share_on_lines()
    int gpu_tiles_ = 0;
};

} // namespace scanshade
