// Samples points per tile of an organised cloud, and fits a camera to them.
#include "projection/calibration/boards/organised_clouds.h"

#include "projection/base/error.h"
#include "projection/calibration/solve.h"
#include "projection/fit_pinhole.h"

#include <fmt/format.h>

namespace scanshade::calibration {
namespace {

struct PointResidual {
    LensModel lens;
    Eigen::Vector3d point;
    Eigen::Vector2d pixel;

    template <class Number>
    bool operator()(const Number* camera, Number* residual) const {
        const Number in_camera[3] = {Number(point.x()), Number(point.y()), Number(point.z())};
        pixel_of(lens, camera, in_camera, residual);
        residual[0] -= Number(pixel.x());
        residual[1] -= Number(pixel.y());
        return true;
    }
};

} // namespace

void OrganisedClouds::add(const std::string& name, const Cloud& cloud) {
    constexpr int stride = 8, tiles_across = 4;
    constexpr std::size_t least_points = 20;
    (void)during(name, [&] { return fit_pinhole(cloud); }); // throws where no camera explains the points
    if (size_.empty())
        size_ = cloud.grid;
    if (cloud.grid != size_)
        throw Error(fmt::format("{}: the cloud's grid is {}x{}, the others' {}x{}", name, cloud.grid.width,
                                cloud.grid.height, size_.width, size_.height));
    std::vector<Tile> tiles(tiles_across * tiles_across);
    for (int row = 0; row < size_.height; row += stride)
        for (int column = 0; column < size_.width; column += stride) {
            const Eigen::Vector3d& point = cloud.points[static_cast<std::size_t>(row) * size_.width + column];
            const int tile = row * tiles_across / size_.height * tiles_across + column * tiles_across / size_.width;
            if (point.allFinite() && point.z() > 0)
                tiles[tile].points.push_back({point, Eigen::Vector2d(column, row)});
        }
    for (std::size_t i = 0; i < tiles.size(); ++i)
        if (tiles[i].points.size() >= least_points) {
            tiles[i].name = fmt::format("{} tile {},{}", name, i % tiles_across, i / tiles_across);
            tiles_.push_back(std::move(tiles[i]));
        }
}

Fit OrganisedClouds::start(const Model& model) const {
    return fit({.model = model, .nuisance = {}, .covariance = {}}, {}, Views(tiles_.size(), true), false);
}

Fit OrganisedClouds::fit(const Fit& from, const Free& free, const Views& used, bool covariance) const {
    Fit fit = from;
    ceres::Problem problem;
    for (std::size_t i = 0; i < tiles_.size(); ++i)
        for (const Point& point : tiles_[i].points)
            if (used[i])
                problem.AddResidualBlock(new ceres::AutoDiffCostFunction<PointResidual, 2, camera_unknowns>(
                                             new PointResidual{fit.model.lens, point.in_camera, point.pixel}),
                                         nullptr, fit.model.values.data());
    fix(problem, fit.model, free);
    solve(problem, fit, false);
    if (covariance)
        add_covariance(problem, fit, free, {}, {});
    return fit;
}

std::vector<ViewScore> OrganisedClouds::score(const Fit& fit, const Views& wanted) const {
    std::vector<ViewScore> scores(tiles_.size());
    for (std::size_t i = 0; i < tiles_.size(); ++i) {
        if (!wanted[i])
            continue;
        for (const Eigen::Vector2d& residual : residuals(fit, i))
            scores[i].squared += residual.squaredNorm();
        scores[i].points = static_cast<int>(tiles_[i].points.size());
    }
    return scores;
}

std::vector<Eigen::Vector2d> OrganisedClouds::residuals(const Fit& fit, std::size_t view) const {
    std::vector<Eigen::Vector2d> all;
    for (const Point& point : tiles_[view].points) {
        Eigen::Vector2d residual;
        PointResidual{fit.model.lens, point.in_camera, point.pixel}(fit.model.values.data(), residual.data());
        all.push_back(residual);
    }
    return all;
}

std::vector<cv::Point2d> OrganisedClouds::pixels_of(std::size_t view) const {
    std::vector<cv::Point2d> all;
    for (const Point& point : tiles_[view].points)
        all.emplace_back(point.pixel.x(), point.pixel.y());
    return all;
}

std::vector<double> OrganisedClouds::depths_m(const Fit&) const {
    std::vector<double> depths;
    for (const Tile& tile : tiles_)
        for (const Point& point : tile.points)
            depths.push_back(point.in_camera.z());
    return depths;
}

} // namespace scanshade::calibration
