// Calibration boards as a problem: bundle adjustment of a camera and one pose per view of a flat board.
#pragma once

#include "projection/calibration/problem.h"

namespace scanshade::calibration {

/// A board in one image: pixel i shows point i of the board, metres, z = 0.
struct BoardView {
    std::string name;
    std::vector<Eigen::Vector3d> points_m;
    std::vector<Eigen::Vector2d> pixels;
    enum class Flaw {
        none,
        larger,        ///< it is part of a larger chessboard than was looked for
        older_pattern, ///< it is a ChArUco board from before OpenCV 4.6, whose corners this build misplaces
    } flaw = Flaw::none;
};

class Boards final : public Problem {
  public:
    /// Throws Error naming the view that has fewer than 6 points.
    explicit Boards(std::vector<BoardView> views);

    void set_weights(const std::vector<double>& weights) override { weights_ = weights; }
    [[nodiscard]] std::size_t views() const override { return views_.size(); }
    [[nodiscard]] std::string view_name(std::size_t view) const override { return views_[view].name; }
    [[nodiscard]] Fit start(const Model& model) const override;
    [[nodiscard]] Fit fit(const Fit& from, const Free& free, const Views& used, bool covariance) const override;
    [[nodiscard]] std::vector<ViewScore> score(const Fit& fit, const Views& wanted) const override;
    [[nodiscard]] std::vector<cv::Point2d> pixels_of(std::size_t view) const override;
    [[nodiscard]] std::vector<Eigen::Vector2d> residuals(const Fit& fit, std::size_t view) const override;
    [[nodiscard]] std::vector<double> depths_m(const Fit& fit) const override;

  private:
    std::vector<BoardView> views_;
    std::vector<double> weights_;
};

/// A first guess from the views' homographies (Zhang 2000 with the principal point in the middle and square pixels).
/// Views without perspective give a usual lens instead.
[[nodiscard]] Camera guess_from_boards(const std::vector<BoardView>& views, cv::Size size);

/// Why these views cannot determine a camera: too few different ones, or all of one tilt. Empty = they may.
[[nodiscard]] std::string degeneracy(const std::vector<BoardView>& views, const Fit& fit);

} // namespace scanshade::calibration
