// The residuals of recordings for Ceres: observed pixels, depths, surfaces, planes, outlines and priors.
#pragma once

#include "projection/calibration/model.h"
#include "projection/calibration/recording/geometry.h"
#include "projection/calibration/solve.h"
#include "projection/motion.h"

#include <Eigen/Geometry>

namespace scanshade::calibration {

/// The reprojection error of a point in camera space, times `weight`. False where the point is not in front.
template <class Number>
bool reprojection_error(LensModel lens, const Number* camera, const Number* in_camera, const Eigen::Vector2d& pixel,
                        double weight, Number* residual) {
    if (in_camera[2] < Number(0.01))
        return false; // at or behind the camera: the solver then takes a shorter step
    pixel_of(lens, camera, in_camera, residual);
    residual[0] = Number(weight) * (residual[0] - Number(pixel.x()));
    residual[1] = Number(weight) * (residual[1] - Number(pixel.y()));
    return true;
}

/// Moves a point in camera space to where the camera has it `seconds` later, under the camera's own motion.
template <class Number>
void moved_by_camera_motion(const Motion& motion, const Number& seconds, Number* in_camera) {
    if (!motion.any())
        return;
    Number rotation[3], translated[3];
    for (int i = 0; i < 3; ++i) {
        rotation[i] = -seconds * Number(motion.rotation_per_s[i]);
        translated[i] = in_camera[i] - seconds * Number(motion.translation_per_s[i]);
    }
    ceres::AngleAxisRotatePoint(rotation, translated, in_camera);
}

/// One camera for colour and depth.
struct ObservationResidual {
    LensModel lens;
    Eigen::Vector2d pixel;
    Motion motion;
    double later_s; ///< than depth, by the stamps
    double weight;
    template <class Number>
    bool operator()(const Number* camera, const Number* clock, const Number* pose, const Number* point,
                    Number* residual) const {
        Number in_camera[3];
        transform_point(pose, point, in_camera);
        moved_by_camera_motion(motion, Number(*clock + later_s), in_camera);
        return reprojection_error(lens, camera, in_camera, pixel, weight, residual);
    }
};

/// A secondary colour camera with its own clock; the pose is the depth camera's.
struct SecondaryObservationResidual {
    LensModel lens;
    Eigen::Vector2d pixel;
    Motion motion;
    double later_s; ///< than depth, by the stamps
    double weight;
    template <class Number>
    bool operator()(const Number* camera, const Number* extrinsics, const Number* clock, const Number* pose,
                    const Number* point, Number* residual) const {
        Number in_depth[3], in_camera[3];
        transform_point(pose, point, in_depth);
        moved_by_camera_motion(motion, Number(*clock + later_s), in_depth);
        transform_point(extrinsics, in_depth, in_camera);
        return reprojection_error(lens, camera, in_camera, pixel, weight, residual);
    }
};

/// The same with fixed poses. Most of a fit's time goes into these derivatives, and a fourth of them are by the pose.
struct FixedPoseObservationResidual {
    LensModel lens;
    Eigen::Vector2d pixel;
    Motion motion;
    double later_s;
    double weight;
    Eigen::Isometry3d depth_from_world;
    template <class Number>
    bool operator()(const Number* camera, const Number* extrinsics, const Number* clock, const Number* point,
                    Number* residual) const {
        Number in_depth[3], in_camera[3];
        for (int i = 0; i < 3; ++i)
            in_depth[i] = depth_from_world(i, 0) * point[0] + depth_from_world(i, 1) * point[1] +
                          depth_from_world(i, 2) * point[2] + depth_from_world(i, 3);
        moved_by_camera_motion(motion, Number(*clock + later_s), in_depth);
        transform_point(extrinsics, in_depth, in_camera);
        return reprojection_error(lens, camera, in_camera, pixel, weight, residual);
    }
};

/// A depth edge lies on an edge of the same frame's colour image. It is `gap_px` beyond the surface's last point. Only
/// the distance across the colour edge counts.
struct OutlineResidual {
    LensModel lens;
    Eigen::Vector3d in_depth, one_px_beyond;
    Eigen::Vector2d on_edge, across;
    Motion motion;
    double later_s;
    double weight;
    template <class Number>
    bool operator()(const Number* camera, const Number* extrinsics, const Number* clock, const Number* gap_px,
                    Number* residual) const {
        Number edge[3], in_camera[3], error[2] = {Number(0), Number(0)};
        for (int i = 0; i < 3; ++i)
            edge[i] = Number(in_depth[i]) + *gap_px * Number(one_px_beyond[i]);
        moved_by_camera_motion(motion, Number(*clock + later_s), edge);
        transform_point(extrinsics, edge, in_camera);
        const bool in_front = reprojection_error(lens, camera, in_camera, on_edge, weight, error);
        residual[0] = Number(across[0]) * error[0] + Number(across[1]) * error[1];
        return in_front;
    }
};

/// The depth recorded at an observation is the point's.
struct DepthResidual {
    double depth_m;
    Motion motion;
    double weight;
    template <class Number>
    bool operator()(const Number* depth, const Number* clock, const Number* pose, const Number* point,
                    Number* residual) const {
        Number in_camera[3];
        transform_point(pose, point, in_camera);
        moved_by_camera_motion(motion, *clock, in_camera);
        const Number true_depth =
            depth[0] * Number(depth_m) + depth[1] + depth[2] * Number(depth_m * depth_m); // scale, offset, curve
        residual[0] = Number(weight) * (in_camera[2] - true_depth);
        return true;
    }
};

/// The point lies on a piece of the surface that the depth camera recorded.
struct SurfaceResidual {
    Eigen::Vector3d on_surface, normal;
    double weight;
    template <class Number>
    bool operator()(const Number* pose, const Number* point, Number* residual) const {
        Number in_camera[3];
        transform_point(pose, point, in_camera);
        residual[0] = Number(0);
        for (int i = 0; i < 3; ++i)
            residual[0] += Number(normal[i]) * (in_camera[i] - Number(on_surface[i]));
        residual[0] *= Number(weight);
        return true;
    }
};

inline double scalar_of(double value) { return value; }
template <int size>
double scalar_of(const ceres::Jet<double, size>& value) {
    return value.a;
}

/// The depth camera's ray through a pixel, x and y at z = 1, with its derivatives by the camera's numbers. The lens is
/// undone in doubles. One step of Newton's method in Number then gives exact first derivatives (implicit function
/// theorem).
template <class Number>
void ray_through(LensModel lens, const Number* camera, const Eigen::Vector2d& pixel, Number* ray) {
    Model model{lens, {}, {}};
    for (int i = 0; i < camera_unknowns; ++i)
        model.values[i] = scalar_of(camera[i]);
    const Eigen::Vector2d found = undistorted_direction(camera_of(model), pixel);
    using Slope = ceres::Jet<double, 2>;
    Slope numbers[camera_unknowns], pixel_slope[2];
    for (int i = 0; i < camera_unknowns; ++i)
        numbers[i] = Slope(model.values[i]);
    const Slope at[3] = {Slope(found.x(), 0), Slope(found.y(), 1), Slope(1)};
    pixel_of(lens, numbers, at, pixel_slope);
    Eigen::Matrix2d slope;
    slope << pixel_slope[0].v.transpose(), pixel_slope[1].v.transpose();
    const Eigen::Matrix2d back = slope.inverse();
    const Number at_ray[3] = {Number(found.x()), Number(found.y()), Number(1)};
    Number error[2];
    pixel_of(lens, camera, at_ray, error);
    for (int i = 0; i < 2; ++i)
        error[i] -= Number(pixel[i]);
    for (int i = 0; i < 2; ++i)
        ray[i] = at_ray[i] - Number(back(i, 0)) * error[0] - Number(back(i, 1)) * error[1];
}

/// The distance of a cell's recorded depth from its plane, along the cell's ray. It is measured in the sensor's own
/// metres, so that a correction that shrinks all depths does not shrink the error. The plane is q with q . (point -
/// anchor) = 1.
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
        Number per_metre(0), rest(1); // q . ray, and 1 - q . (camera centre - anchor)
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

/// A prior on one number: the distance from its expected value, in sigmas.
struct PriorResidual {
    double expected, weight;
    template <class Number>
    bool operator()(const Number* value, Number* residual) const {
        residual[0] = Number(weight) * (*value - Number(expected));
        return true;
    }
};

/// A prior on a pose: rotation and translation from the recorded one, in sigmas.
struct PosePriorResidual {
    Eigen::Quaterniond camera_from_world;
    Eigen::Vector3d centre;
    double rotation_weight, translation_weight;
    template <class Number>
    bool operator()(const Number* pose, Number* residual) const {
        const Number recorded_inverse[4] = {Number(camera_from_world.w()), Number(-camera_from_world.x()),
                                            Number(-camera_from_world.y()), Number(-camera_from_world.z())};
        Number rotation[4], difference[4], minus_centre[3];
        ceres::AngleAxisToQuaternion(pose, rotation);
        ceres::QuaternionProduct(rotation, recorded_inverse, difference);
        ceres::QuaternionToAngleAxis(difference, residual);
        const Number inverse[3] = {-pose[0], -pose[1], -pose[2]};
        ceres::AngleAxisRotatePoint(inverse, pose + 3, minus_centre);
        for (int i = 0; i < 3; ++i) {
            residual[i] *= Number(rotation_weight);
            residual[3 + i] = Number(translation_weight) * (minus_centre[i] + Number(centre[i]));
        }
        return true;
    }
};

} // namespace scanshade::calibration
