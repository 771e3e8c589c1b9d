// Organised clouds as a problem: every point has an exact pixel.
#pragma once

#include "projection/calibration/problem.h"
#include "projection/frame.h"

namespace scanshade::calibration {

/// Each cloud's grid is cut into 4x4 tiles. The tiles are the views: a fit to some tiles is tested on the others.
class OrganisedClouds final : public Problem {
  public:
    /// Adds a sample of the cloud's points, one of 8x8 pixels. Throws Error for a cloud without grid or of another size
    /// than the ones before. Throws it too where the points are more than 2 px off a pinhole's rays, see fit_pinhole.
    void add(const std::string& name, const Cloud& cloud);

    [[nodiscard]] cv::Size size() const { return size_; }
    [[nodiscard]] std::size_t views() const override { return tiles_.size(); }
    [[nodiscard]] std::string view_name(std::size_t view) const override { return tiles_[view].name; }
    void set_weights(const std::vector<double>&) override {} // points of one cloud are equally good
    [[nodiscard]] Fit start(const Model& model) const override;
    [[nodiscard]] Fit fit(const Fit& from, const Free& free, const Views& used, bool covariance) const override;
    [[nodiscard]] std::vector<ViewScore> score(const Fit& fit, const Views& wanted) const override;
    [[nodiscard]] std::vector<double> depths_m(const Fit& fit) const override;
    [[nodiscard]] std::vector<Eigen::Vector2d> residuals(const Fit& fit, std::size_t view) const override;
    [[nodiscard]] std::vector<cv::Point2d> pixels_of(std::size_t view) const override;

  private:
    struct Point {
        Eigen::Vector3d in_camera;
        Eigen::Vector2d pixel;
    };
    struct Tile {
        std::string name;
        std::vector<Point> points;
    };
    cv::Size size_;
    std::vector<Tile> tiles_;
};

} // namespace scanshade::calibration
