// Planes found in depth images: smooth cells, grouped within a frame, joined with the planes of earlier frames.
#pragma once

#include "projection/calibration/model.h"

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

namespace scanshade::calibration {

/// One frame of recorded depth.
struct PlaneFrame {
    std::string name;
    cv::Mat1f depth_m;                                  ///< as recorded, 0 = hole
    std::optional<Eigen::Isometry3d> world_from_camera; ///< as recorded
};

/// A smooth piece of depth, at most one fortieth of the image's width in either direction.
struct PlaneCell {
    int frame = 0;
    cv::Point index; ///< column and row among the frame's cells
    Eigen::Vector2d pixel;
    double depth_m = 0;               ///< recorded, by the fit of 1/z at the centre
    Eigen::Vector3d in_world, normal; ///< under the first model; of the frame itself where frames are not linked
    double weight = 1;                ///< from metres to millimetres of depth at the median depth
};

struct ScenePlane {
    Eigen::Vector3d anchor; ///< the centre of the camera that saw it first: not on the plane
    Eigen::Vector3d point, normal;
    std::vector<PlaneCell> cells;
};

struct PlaneObservations {
    std::vector<PlaneFrame> frames;
    std::vector<ScenePlane> planes;
    std::vector<double> weights; ///< of the frames
    bool linked = false;         ///< all frames have poses, so that planes are the same ones across frames
    double sigma_mm = 5;         ///< of a cell, rescaled by the residuals

    /// As recorded; the identity where frames are not linked.
    [[nodiscard]] Eigen::Isometry3d pose(int frame) const {
        return linked ? *frames[frame].world_from_camera : Eigen::Isometry3d::Identity();
    }
    [[nodiscard]] std::size_t cells() const;
    /// Planes that have lost most of their cells are not kept.
    void remove_small_planes();
};

/// Finds the planes of the frames under the first model, at most about 2000 cells of them. Throws Error where hardly
/// anything in the frames is plane.
[[nodiscard]] PlaneObservations find_planes(std::vector<PlaneFrame> frames, const Model& first);

} // namespace scanshade::calibration
