// What a recording's frames say of camera, poses and points: residuals for Ceres.
#pragma once

#include "projection/calibration/recording/geometry.h"
#include "projection/calibration/model.h"
#include "projection/calibration/solve.h"

#include <Eigen/Geometry>

namespace scanshade::calibration {

/// How far from `pixel` the camera sees a point, times `weight`.
template <class Number>
bool seen_at(LensModel lens, const Number* camera, const Number* in_camera, const Eigen::Vector2d& pixel, double weight,
             Number* residual) {
    if (in_camera[2] < Number(0.01))
        return false; // at or behind the camera: the solver takes a shorter step
    pixel_of(lens, camera, in_camera, residual);
    residual[0] = Number(weight) * (residual[0] - Number(pixel.x()));
    residual[1] = Number(weight) * (residual[1] - Number(pixel.y()));
    return true;
}

/// A point in camera space as the camera sees it `seconds` later, moving on as it does.
template <class Number>
void seen_later(const Motion& motion, const Number& seconds, Number* in_camera) {
    if (!motion.any())
        return;
    Number turn[3], moved_on[3];
    for (int i = 0; i < 3; ++i) {
        turn[i] = -seconds * Number(motion.turn_per_s[i]);
        moved_on[i] = in_camera[i] - seconds * Number(motion.shift_per_s[i]);
    }
    ceres::AngleAxisRotatePoint(turn, moved_on, in_camera);
}

/// One camera for colour and depth.
struct SightingResidual {
    LensModel lens;
    Eigen::Vector2d pixel;
    Motion motion;
    double later_s; ///< than depth, by the stamps
    double weight;
    template <class Number>
    bool operator()(const Number* camera, const Number* clock, const Number* pose, const Number* point,
                    Number* residual) const {
        Number in_camera[3];
        moved(pose, point, in_camera);
        seen_later(motion, Number(*clock + later_s), in_camera);
        return seen_at(lens, camera, in_camera, pixel, weight, residual);
    }
};

/// A colour camera beside the depth camera whose pose it is, with a clock of its own.
struct PlacedSightingResidual {
    LensModel lens;
    Eigen::Vector2d pixel;
    Motion motion;
    double later_s; ///< than depth, by the stamps
    double weight;
    template <class Number>
    bool operator()(const Number* camera, const Number* place, const Number* clock, const Number* pose,
                    const Number* point, Number* residual) const {
        Number in_depth[3], in_camera[3];
        moved(pose, point, in_depth);
        seen_later(motion, Number(*clock + later_s), in_depth);
        moved(place, in_depth, in_camera);
        return seen_at(lens, camera, in_camera, pixel, weight, residual);
    }
};

/// The same where poses are kept: most of a fit's time goes into these derivatives, a fourth of them by the pose.
struct PosedSightingResidual {
    LensModel lens;
    Eigen::Vector2d pixel;
    Motion motion;
    double later_s;
    double weight;
    Eigen::Isometry3d depth_from_world;
    template <class Number>
    bool operator()(const Number* camera, const Number* place, const Number* clock, const Number* point,
                    Number* residual) const {
        Number in_depth[3], in_camera[3];
        for (int i = 0; i < 3; ++i)
            in_depth[i] = depth_from_world(i, 0) * point[0] + depth_from_world(i, 1) * point[1] +
                          depth_from_world(i, 2) * point[2] + depth_from_world(i, 3);
        seen_later(motion, Number(*clock + later_s), in_depth);
        moved(place, in_depth, in_camera);
        return seen_at(lens, camera, in_camera, pixel, weight, residual);
    }
};

/// A depth edge, so many pixels beyond the last point before it, lies on an edge of the same frame's colour image: only
/// the way across it counts.
struct OutlineResidual {
    LensModel lens;
    Eigen::Vector3d in_depth, one_px_beyond;
    Eigen::Vector2d on_edge, across;
    Motion motion;
    double later_s;
    double weight;
    template <class Number>
    bool operator()(const Number* camera, const Number* place, const Number* clock, const Number* gap_px,
                    Number* residual) const {
        Number then[3], in_camera[3], miss[2] = {Number(0), Number(0)};
        for (int i = 0; i < 3; ++i)
            then[i] = Number(in_depth[i]) + *gap_px * Number(one_px_beyond[i]);
        seen_later(motion, Number(*clock + later_s), then);
        moved(place, then, in_camera);
        const bool seen = seen_at(lens, camera, in_camera, on_edge, weight, miss);
        residual[0] = Number(across[0]) * miss[0] + Number(across[1]) * miss[1];
        return seen;
    }
};

/// The depth recorded at the sighting is the point's.
struct DepthResidual {
    double depth_m;
    Motion motion;
    double weight;
    template <class Number>
    bool operator()(const Number* depth, const Number* clock, const Number* pose, const Number* point,
                    Number* residual) const {
        Number in_camera[3];
        moved(pose, point, in_camera);
        seen_later(motion, *clock, in_camera);
        const Number true_depth =
            depth[0] * Number(depth_m) + depth[1] + depth[2] * Number(depth_m * depth_m); // scale, offset, curve
        residual[0] = Number(weight) * (in_camera[2] - true_depth);
        return true;
    }
};

/// The point lies on a piece of the surface that the depth camera saw.
struct SurfaceResidual {
    Eigen::Vector3d on_surface, normal;
    double weight;
    template <class Number>
    bool operator()(const Number* pose, const Number* point, Number* residual) const {
        Number in_camera[3];
        moved(pose, point, in_camera);
        residual[0] = Number(0);
        for (int i = 0; i < 3; ++i)
            residual[0] += Number(normal[i]) * (in_camera[i] - Number(on_surface[i]));
        residual[0] *= Number(weight);
        return true;
    }
};

/// A number is near what is expected of it, in sigmas.
struct ExpectedResidual {
    double expected, weight;
    template <class Number>
    bool operator()(const Number* value, Number* residual) const {
        residual[0] = Number(weight) * (*value - Number(expected));
        return true;
    }
};

/// A recorded pose is near the truth: how far the camera has turned and moved from it, in sigmas.
struct PoseResidual {
    Eigen::Quaterniond camera_from_world;
    Eigen::Vector3d centre;
    double turn_weight, shift_weight;
    template <class Number>
    bool operator()(const Number* pose, Number* residual) const {
        const Number back[4] = {Number(camera_from_world.w()), Number(-camera_from_world.x()),
                                Number(-camera_from_world.y()), Number(-camera_from_world.z())};
        Number turn[4], difference[4], moved_by[3];
        ceres::AngleAxisToQuaternion(pose, turn);
        ceres::QuaternionProduct(turn, back, difference);
        ceres::QuaternionToAngleAxis(difference, residual);
        const Number against[3] = {-pose[0], -pose[1], -pose[2]};
        ceres::AngleAxisRotatePoint(against, pose + 3, moved_by); // minus the camera's centre
        for (int i = 0; i < 3; ++i) {
            residual[i] *= Number(turn_weight);
            residual[3 + i] = Number(shift_weight) * (moved_by[i] + Number(centre[i]));
        }
        return true;
    }
};

} // namespace scanshade::calibration
