// A recorded RGB-D sequence as evidence: bundle adjustment of tracks, depths, poses and the camera.
#pragma once

#include "projection/calibration/recording/edges.h"
#include "projection/calibration/problem.h"
#include "projection/calibration/recording/geometry.h"
#include "projection/calibration/recording/tracks.h"

#include <Eigen/Geometry>
#include <optional>

namespace scanshade::calibration {

/// One frame as the adjustment needs it.
struct SequenceFrame {
    std::string name;
    cv::Mat1b grey;                                          ///< the colour image
    cv::Mat1f depth_m;                                       ///< recorded depth, 0 = hole
    std::optional<Eigen::Isometry3d> world_from_camera = {}; ///< of the depth camera, as recorded
    Motion motion = {};                                      ///< of the depth camera then
    double colour_later_s = 0;                               ///< than depth, by their stamps
};

struct SequenceOptions {
    bool registered = true;   ///< colour pixel (u, v) and depth pixel (u, v) see the same thing
    bool outlines = true;     ///< of unregistered images: depth edges lie on colour edges
    bool refine_poses = true; ///< recorded poses are good to the sigmas below; otherwise they are the truth
    double pose_shift_sigma_m = 0.005, pose_turn_sigma = 0.0035; ///< metres and radians
    double pixel_sigma_px = 0.5;
    double depth_floor_m = 0.0012,
           depth_per_z2 = 0.0019; ///< sigma of a depth (Nguyen 2012's order), rescaled by the residuals
};

class SequenceProblem;

/// Registered: one camera takes colour and depth; a track's point must project onto its sightings, and lie at the depth
/// recorded there. Unregistered: the model is the colour camera and its place, `depth_camera` stays as it is; the point
/// must lie on the surface that the depth camera saw, and outlines of near things on edges of the colour image.
class Sequence final : public Evidence {
  public:
    /// Finds tracks; where a pose is missing, follows the camera from frame to frame (PnP on matches with depth).
    /// Prunes outliers under the first camera. Throws Error where too little hangs together.
    Sequence(std::vector<SequenceFrame> frames, const Camera& depth_camera, const Model& first,
             const SequenceOptions& options);

    [[nodiscard]] std::size_t views() const override { return frames_.size(); }
    [[nodiscard]] std::string view_name(std::size_t view) const override { return frames_[view].name; }
    void weigh(const std::vector<double>& weights) override { weights_ = weights; }
    [[nodiscard]] Fit start(const Model& model) const override;
    [[nodiscard]] Fit fit(const Fit& from, const Free& free, const Views& used, bool covariance) const override;
    [[nodiscard]] std::vector<ViewScore> score(const Fit& fit, const Views& wanted) const override;
    [[nodiscard]] std::vector<cv::Point2d> pixels_of(std::size_t view) const override;
    [[nodiscard]] std::vector<Eigen::Vector2d> residuals(const Fit& fit, std::size_t view) const override;
    [[nodiscard]] std::vector<double> depths_m(const Fit& fit) const override;

    /// Poses of the depth camera under a fit, world_from_camera.
    [[nodiscard]] std::vector<Eigen::Isometry3d> poses(const Fit& fit) const;
    /// How far beyond its last point a surface ends, pixels of the depth image.
    [[nodiscard]] static double gap_px(const Fit& fit) { return fit.nuisance.back(); }
    [[nodiscard]] std::size_t outline_points() const;
    /// Whether the clocks of poses and images can be compared: the poses are kept, and the camera's motion is known.
    [[nodiscard]] bool tells_time() const;
    [[nodiscard]] std::size_t points() const { return tracks_.size(); }
    [[nodiscard]] std::size_t sightings() const;
    /// Why these frames cannot determine a camera: pure forward motion, one plane, hardly any motion. Empty = they may.
    [[nodiscard]] std::string degeneracy(const Fit& fit) const;
    [[nodiscard]] std::vector<cv::Mat1f> depth_images() const;

  private:
    friend class SequenceProblem;
    struct Sighting {
        int frame = 0;
        Eigen::Vector2d pixel;
        double depth_m = 0;                       ///< recorded there; 0 = unknown, negative = not to be used
        std::optional<SurfacePiece> surface = {}; ///< that the point must lie on, of unregistered frames
    };
    struct Point {
        std::vector<Sighting> sightings;
    };
    struct Miss {
        double pixels = 0, depth = 0; ///< in the residuals' unit
    };
    void add_covariance(SequenceProblem& adjustment, Fit& fit, const Free& free) const;
    [[nodiscard]] Model place_by_outlines(const Model& first);
    void pair_ever_nearer(const Model& near, const Model& first);
    void pair_outlines(const Fit& fit, double reach_px);
    void leave_out_far_outlines(const Fit& fit);
    void follow_camera(const Model& first);
    [[nodiscard]] Eigen::Isometry3d placed_by_points(int frame, const Camera& camera,
                                                     const std::vector<std::optional<Eigen::Vector3d>>& world) const;
    void prune(Model near, const Model& first);
    void leave_out_absurd(const Fit& fit);
    void find_surfaces(const Fit& fit);
    [[nodiscard]] Fit robust_fit(const Fit& from, const Model& first);
    [[nodiscard]] std::vector<std::vector<Miss>> misses_of(const Fit& fit) const;
    void leave_out_beyond(const std::vector<std::vector<Miss>>& misses, const Miss& most);
    /// Worth keeping: seen often enough, with a depth somewhere.
    [[nodiscard]] bool useful(const Point& point) const;
    [[nodiscard]] Fit initial(const Model& model) const;

    std::vector<SequenceFrame> frames_;
    Camera depth_camera_;
    SequenceOptions options_;
    std::vector<Point> tracks_;
    std::vector<std::vector<OutlinePoint>> outlines_; ///< of unregistered frames
    std::vector<ColourEdges> edges_;
    std::vector<std::vector<OutlinePair>> pairs_;
    double outline_sigma_px_ = 2;
    std::vector<double> weights_;
    std::vector<Eigen::Isometry3d> start_poses_;
    double depth_weight_ = 1; ///< rescales the assumed depth sigma to what residuals show
};

} // namespace scanshade::calibration
