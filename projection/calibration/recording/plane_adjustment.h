// One adjustment of planes: a residual for each cell, on camera, depth correction, pose and plane.
#pragma once

#include "projection/calibration/recording/planes.h"
#include "projection/calibration/solve.h"

namespace scanshade::calibration {

inline double scalar_of(double value) { return value; }
template <int size>
double scalar_of(const ceres::Jet<double, size>& value) {
    return value.a;
}

/// The depth camera's ray through a pixel, x and y at z = 1, with its derivatives by the camera's numbers: the lens is
/// undone in doubles, then one step of Newton's method in Number, which is all that a first derivative sees (implicit
/// function theorem).
template <class Number>
void ray_through(LensModel lens, const Number* camera, const Eigen::Vector2d& pixel, Number* straight);

/// By how much the recorded depth of a cell misses its plane, along the cell's ray and in the sensor's own metres: a
/// correction that shrinks all depths must not shrink the misses. The plane is q with q . (point - anchor) = 1.
struct PlaneResidual {
    LensModel lens;
    Eigen::Vector2d pixel;
    double depth_m;
    Eigen::Vector3d anchor;
    double weight;
    template <class Number>
    bool operator()(const Number* camera, const Number* depth, const Number* world_from_camera, const Number* plane,
                    Number* residual) const {
        Number ray[3], in_world[3];
        ray_through(lens, camera, pixel, ray);
        ray[2] = Number(1);
        ceres::AngleAxisRotatePoint(world_from_camera, ray, in_world);
        Number per_metre(0), rest(1); // of q . point along the ray, and what is left of 1 at the camera's centre
        for (int i = 0; i < 3; ++i) {
            per_metre += plane[i] * in_world[i];
            rest -= plane[i] * (world_from_camera[3 + i] - Number(anchor[i]));
        }
        const Number z = depth[0] * Number(depth_m) + depth[1] + depth[2] * Number(depth_m * depth_m);
        const Number per_recorded = depth[0] + depth[2] * Number(2 * depth_m);
        residual[0] = Number(weight) * (rest / per_metre - z) / per_recorded;
        return true;
    }
};

/// Residuals on the numbers of a Fit, which must outlive it.
class Planes::Problem {
  public:
    Problem(const Planes& planes, Fit& fit) : planes_(planes), fit_(fit) {}

    void add(std::size_t plane, const Cell& cell, bool plane_is_known = false, ceres::LossFunction* loss = nullptr);
    /// Near the recorded ones; where frames are not linked, at the origin.
    void hold_poses();
    void add_covariance(const Free& free);

    ceres::Problem problem;

  private:
    [[nodiscard]] double* pose(int frame) { return &fit_.nuisance[static_cast<std::size_t>(frame) * pose_unknowns]; }
    [[nodiscard]] double* plane(std::size_t index) {
        return &fit_.nuisance[planes_.frames_.size() * pose_unknowns + index * point_unknowns];
    }

    const Planes& planes_;
    Fit& fit_;
};

template <class Number>
void ray_through(LensModel lens, const Number* camera, const Eigen::Vector2d& pixel, Number* straight) {
    Model model{lens, {}, {}};
    for (int i = 0; i < camera_unknowns; ++i)
        model.values[i] = scalar_of(camera[i]);
    const Eigen::Vector2d found = straight_of(camera_of(model), pixel);
    using Slope = ceres::Jet<double, 2>;
    Slope numbers[camera_unknowns], seen[2];
    for (int i = 0; i < camera_unknowns; ++i)
        numbers[i] = Slope(model.values[i]);
    const Slope at[3] = {Slope(found.x(), 0), Slope(found.y(), 1), Slope(1)};
    pixel_of(lens, numbers, at, seen);
    Eigen::Matrix2d slope;
    slope << seen[0].v.transpose(), seen[1].v.transpose();
    const Eigen::Matrix2d back = slope.inverse();
    const Number there[3] = {Number(found.x()), Number(found.y()), Number(1)};
    Number miss[2];
    pixel_of(lens, camera, there, miss);
    for (int i = 0; i < 2; ++i)
        miss[i] -= Number(pixel[i]);
    for (int i = 0; i < 2; ++i)
        straight[i] = there[i] - Number(back(i, 0)) * miss[0] - Number(back(i, 1)) * miss[1];
}

} // namespace scanshade::calibration
