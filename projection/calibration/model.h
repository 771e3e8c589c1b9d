// What a calibration may change, as one row of named numbers, and how a camera with those numbers sees a point.
#pragma once

#include "projection/camera.h"

#include <array>
#include <optional>
#include <string_view>
#include <vector>

namespace scanshade::calibration {

/// The numbers of a Model. `f` is fx; `aspect` is fy / fx, so that one focal length is one number.
enum Unknown : int {
    f,
    aspect,
    cx,
    cy,
    k1,
    k2,
    p1,
    p2,
    k3,
    k4, // the camera
    depth_scale,
    depth_offset,
    depth_curve, // true depth = scale z + offset + curve z^2, metres
    turn_x,
    turn_y,
    turn_z,
    shift_x,
    shift_y,
    shift_z,     // colour_from_depth: axis times angle, metres
    time_offset, // the images' clock against the poses', seconds: an image stamped t was taken at pose time t + offset
    unknown_count
};
inline constexpr int camera_unknowns = depth_scale, depth_unknowns = turn_x - depth_scale;
inline constexpr int place_unknowns = time_offset - turn_x;

[[nodiscard]] std::string_view name_of(Unknown unknown);

/// A camera (and its depth) as the solver sees it.
struct Model {
    LensModel lens = LensModel::brown_conrady;
    cv::Size size;
    std::array<double, unknown_count> values{};

    [[nodiscard]] double operator[](Unknown unknown) const { return values[unknown]; }
    [[nodiscard]] double& operator[](Unknown unknown) { return values[unknown]; }
};

[[nodiscard]] Model model_of(const Camera& camera);
[[nodiscard]] Camera camera_of(const Model& model, std::string origin = {});

/// Which of the numbers a fit may change.
using Free = std::array<bool, unknown_count>;

/// One step of the ladder: the numbers that are freed together.
struct Rung {
    std::string_view name;
    std::vector<Unknown> unknowns;
    /// A number that may stand in for these: they must be seen while it is free, too.
    std::optional<Unknown> rival = {};
};
/// f, fx fy, cx cy, k1, k2, p1 p2, k3; for a fisheye f, fx fy, cx cy, k1, k2, k3, k4.
[[nodiscard]] std::vector<Rung> camera_rungs(LensModel lens);
/// Where the colour camera is beside the depth camera.
[[nodiscard]] Rung place_rung();
/// Depth offset, scale, curve.
[[nodiscard]] std::vector<Rung> depth_rungs();

/// The pixel at which the camera sees a point in camera space, z > 0. `camera` holds the first camera_unknowns numbers.
template <class Number>
void pixel_of(LensModel lens, const Number* camera, const Number* point, Number* pixel) {
    const Number x = point[0] / point[2], y = point[1] / point[2];
    Number x_bent, y_bent;
    if (lens == LensModel::kannala_brandt) {
        const Number k[4] = {camera[k1], camera[k2], camera[k3], camera[k4]};
        distort_fisheye(k, x, y, x_bent, y_bent);
    } else {
        distort(camera + k1, x, y, x_bent, y_bent);
    }
    pixel[0] = camera[f] * x_bent + camera[cx];
    pixel[1] = camera[f] * camera[aspect] * y_bent + camera[cy];
}
static_assert(k2 == k1 + 1 && p1 == k1 + 2 && p2 == k1 + 3 && k3 == k1 + 4, "the order that distort() takes");

} // namespace scanshade::calibration
