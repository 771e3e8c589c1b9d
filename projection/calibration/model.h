// What a calibration may change, as one row of named numbers, and how a camera with those numbers projects a point.
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
    k4,
    k5,
    k6, // the camera; k4 to k6 of a rational lens stay as they are
    depth_scale,
    depth_offset,
    depth_curve, // true depth = scale z + offset + curve z^2, metres
    rotation_x,
    rotation_y,
    rotation_z,
    translation_x,
    translation_y,
    translation_z, // the extrinsics colour_from_depth: axis times angle, metres
    time_offset,   // seconds from the clock of the images to that of the poses: image time t is pose time t + offset
    unknown_count
};
inline constexpr int camera_unknowns = depth_scale, depth_unknowns = rotation_x - depth_scale;
inline constexpr int extrinsic_unknowns = time_offset - rotation_x;
/// What problems hold besides the model: a pose is axis times angle, then translation.
inline constexpr int pose_unknowns = 6, point_unknowns = 3;

[[nodiscard]] std::string_view name_of(Unknown unknown);

/// A camera, its depth correction and its extrinsics as the solver sees them.
struct Model {
    LensModel lens = LensModel::brown_conrady;
    cv::Size size;
    std::array<double, unknown_count> values{};

    [[nodiscard]] double operator[](Unknown unknown) const { return values[unknown]; }
    [[nodiscard]] double& operator[](Unknown unknown) { return values[unknown]; }
};

[[nodiscard]] Model model_of(const Camera& camera);
[[nodiscard]] Camera camera_of(const Model& model, std::string origin = {});
[[nodiscard]] DepthCorrection depth_correction_of(const Model& model);
/// A recorded depth after the model's correction.
[[nodiscard]] double corrected_m(const Model& model, double z_m);

/// Which of the numbers a fit may change.
using Free = std::array<bool, unknown_count>;

/// One step of model selection: the numbers that are freed together.
struct ParameterGroup {
    std::string_view name;
    std::vector<Unknown> unknowns;
    /// A number that the data may confuse with these: they must be significant while it is free, too.
    std::optional<Unknown> rival = {};
};
/// f, fx fy, cx cy, k1, k2, p1 p2, k3; for a fisheye f, fx fy, cx cy, k1, k2, k3, k4. The denominator of a rational
/// lens (k4, k5, k6) is in no group: it can hardly be told from the numerator.
[[nodiscard]] std::vector<ParameterGroup> camera_groups(LensModel lens);
/// The pose of the colour camera relative to the depth camera.
[[nodiscard]] ParameterGroup extrinsics_group();
/// Depth offset, scale, curve.
[[nodiscard]] std::vector<ParameterGroup> depth_groups();

/// Projects a point in camera space, z > 0, to its pixel. `camera` holds the first camera_unknowns numbers.
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
static_assert(k2 == k1 + 1 && p1 == k1 + 2 && p2 == k1 + 3 && k3 == k1 + 4 && k4 == k1 + 5 && k5 == k1 + 6 &&
                  k6 == k1 + 7,
              "the order that distort() takes");

} // namespace scanshade::calibration
