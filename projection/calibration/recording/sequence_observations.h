// What a recorded sequence shows: its frames, tracks with depths, and outlines, as the bundle adjustment needs them.
#pragma once

#include "projection/calibration/problem.h"
#include "projection/calibration/recording/edges.h"
#include "projection/calibration/recording/geometry.h"
#include "projection/motion.h"

#include <algorithm>
#include <Eigen/Geometry>
#include <optional>

namespace scanshade::calibration {

/// One frame as the adjustment needs it.
struct SequenceFrame {
    std::string name;
    cv::Mat1b grey;                                          ///< the colour image
    cv::Mat1f depth_m;                                       ///< recorded depth, 0 = hole
    std::optional<Eigen::Isometry3d> world_from_camera = {}; ///< of the depth camera, as recorded
    Motion motion = {};                                      ///< of the depth camera at that time
    double colour_later_s = 0;                               ///< than depth, by their stamps
};

struct SequenceOptions {
    bool registered = true;   ///< colour pixel (u, v) and depth pixel (u, v) see the same point
    bool outlines = true;     ///< of unregistered images: depth edges lie on colour edges
    bool refine_poses = true; ///< recorded poses are good to the sigmas below; otherwise they are fixed
    double pose_translation_sigma_m = 0.005, pose_rotation_sigma = 0.0035; ///< metres and radians
    double pixel_sigma_px = 0.5;
    /// Sigma of a depth (after Nguyen 2012), rescaled by the residuals.
    double depth_floor_m = 0.0012, depth_per_z2 = 0.0019;
};

/// A point of the scene in one frame.
struct PointObservation {
    int frame = 0;
    Eigen::Vector2d pixel;
    double depth_m = 0;                       ///< recorded there; 0 = unknown, negative = not to be used
    std::optional<SurfacePiece> surface = {}; ///< that the point must lie on, of unregistered frames
};
struct ScenePoint {
    std::vector<PointObservation> observations;
};

struct SequenceObservations {
    std::vector<SequenceFrame> frames;
    Camera depth_camera;
    SequenceOptions options;
    std::vector<ScenePoint> points = {};
    std::vector<std::vector<OutlinePoint>> outlines = {}; ///< of unregistered frames
    std::vector<ColourEdges> edges = {};
    std::vector<std::vector<OutlinePair>> pairs = {};
    double outline_sigma_px = 2;
    std::vector<double> weights = {};                ///< of the frames
    std::vector<Eigen::Isometry3d> start_poses = {}; ///< world_from_camera
    double depth_weight = 1;                         ///< rescales the assumed depth sigma to that of the residuals

    /// Whether a time offset between poses and images can be estimated: poses are fixed, and the camera's motion is
    /// known.
    [[nodiscard]] bool determines_time() const {
        return !options.refine_poses &&
               std::any_of(frames.begin(), frames.end(), [](const SequenceFrame& frame) { return frame.motion.any(); });
    }
};

/// Where a point's three numbers begin among the nuisance numbers of a Fit: poses, then points, then the outline gap.
[[nodiscard]] inline std::size_t point_offset(const SequenceObservations& observations, std::size_t point) {
    return observations.frames.size() * pose_unknowns + point * point_unknowns;
}

} // namespace scanshade::calibration
