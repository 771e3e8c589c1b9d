// Depth alone as evidence: surfaces that are planes must come out as planes, and as the same ones from everywhere.
#pragma once

#include "projection/calibration/problem.h"
#include "projection/calibration/recording/geometry.h"

namespace scanshade::calibration {

/// One frame of recorded depth.
struct PlaneFrame {
    std::string name;
    cv::Mat1f depth_m;                                  ///< as recorded, 0 = hole
    std::optional<Eigen::Isometry3d> world_from_camera; ///< as recorded
};

/// Depth images are cut into cells; those that are smooth are grouped into planes, within frames and, where poses tie
/// the frames together, across them. A cell's centre, lifted by camera and depth correction, must lie on its plane.
///
/// What that can tell: a plane has 1/z linear in the image whatever the focal length, the principal point and the scale
/// of depth, so planes seen once say something of lens distortion and of depth's offset and curve only. Focal length
/// and scale show where a known motion of the camera brings one plane into several views.
class Planes final : public Evidence {
  public:
    /// Finds and groups the planes under the first model, and leaves out what does not fit. Throws Error where hardly
    /// anything in the frames is plane.
    Planes(std::vector<PlaneFrame> frames, const Model& first);

    void weigh(const std::vector<double>& weights) override { weights_ = weights; }
    [[nodiscard]] std::string_view unit() const override { return "mm"; }
    [[nodiscard]] std::size_t views() const override { return frames_.size(); }
    [[nodiscard]] std::string view_name(std::size_t view) const override { return frames_[view].name; }
    [[nodiscard]] Fit start(const Model& model) const override;
    [[nodiscard]] Fit fit(const Fit& from, const Free& free, const Views& used, bool covariance) const override;
    [[nodiscard]] std::vector<ViewScore> score(const Fit& fit, const Views& wanted) const override;
    [[nodiscard]] std::vector<cv::Point2d> pixels_of(std::size_t view) const override;
    [[nodiscard]] std::vector<Eigen::Vector2d> residuals(const Fit&, std::size_t) const override { return {}; }
    [[nodiscard]] std::vector<double> depths_m(const Fit& fit) const override;

    /// Whether all frames have poses, so that planes are the same ones across frames.
    [[nodiscard]] bool linked() const { return linked_; }
    /// Only what such planes can determine, as ladders to be tried: a wrong focal length looks much like a wrong depth
    /// scale, and what is freed first takes the other's part. The one that explains held-out frames better is right.
    [[nodiscard]] std::vector<std::vector<Rung>> ladders() const;
    /// Why these frames cannot determine anything: one plane, all of one direction, hardly any motion. Empty = they
    /// may.
    [[nodiscard]] std::string degeneracy() const;
    [[nodiscard]] std::string summary() const;
    [[nodiscard]] std::vector<cv::Mat1f> depth_images() const;
    /// As recorded; linked() only.
    [[nodiscard]] std::vector<Eigen::Isometry3d> poses() const;

  private:
    /// A smooth piece of depth, one sixteenth of a Kinect's image wide in either direction at most.
    struct Cell {
        int frame = 0;
        cv::Point place; ///< column and row among the frame's cells
        Eigen::Vector2d pixel;
        double depth_m = 0;               ///< recorded, by the fit of 1/z at the centre
        Eigen::Vector3d in_world, normal; ///< under the first model; of the frame itself where frames are not linked
        double weight = 1;                ///< from metres to millimetres of depth at the usual depth
    };
    struct Plane {
        Eigen::Vector3d anchor; ///< the centre of the camera that saw it first: not on it
        Eigen::Vector3d point, normal;
        std::vector<Cell> cells;
    };
    class Problem;

    [[nodiscard]] std::vector<Cell> cells_of(int frame, const Model& first) const;
    void add_frame(int frame, const Model& first);
    void weigh_by_depth(const Model& first);
    void thin_out();
    void prune(const Model& first);
    [[nodiscard]] Eigen::Isometry3d pose(int frame) const;
    [[nodiscard]] std::size_t cells() const;

    std::vector<PlaneFrame> frames_;
    std::vector<Plane> planes_;
    std::vector<double> weights_;
    bool linked_ = false;
    double sigma_mm_ = 5; ///< of a cell, as the residuals show it
};

} // namespace scanshade::calibration
