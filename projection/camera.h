// The camera of a frame, and THE CONVENTIONS of the whole program.
//
//   axes       camera space is x right, y down, z forward; metres
//   depth      z along the optical axis, never the range along the ray; 0 = hole (nothing was seen)
//   pixels     integer coordinates are pixel CENTRES (OpenCV's habit): the image covers [-0.5, width - 0.5]
//              so a resize by s maps u' = (u + 0.5) s - 0.5, and a texture coordinate is (u + 0.5) / width
//   normals    unit length, camera space, facing the camera (n . point <= 0)
//   poses      world_from_camera: camera to world, metres
//   AO         stored as visibility: 1 = open, 0 = closed, NaN = no surface
//
// The undistorted formulas live in shaders/shared/camera.h, for host and GPU alike.
#pragma once

#include "shaders/shared/camera.h"

#include <cmath>
#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace scanshade {

/// An undistorted camera: focal lengths and principal point in pixels, image size in pixels. Double on the host.
struct Pinhole {
    double fx = 0, fy = 0, cx = 0, cy = 0;
    cv::Size size;

    friend bool operator==(const Pinhole&, const Pinhole&) = default;

    /// The ray through pixel (u, v), z = 1.
    [[nodiscard]] Eigen::Vector3d ray(double u, double v) const {
        return {shared::ray_axis(fx, cx, u), shared::ray_axis(fy, cy, v), 1};
    }
    /// The point in camera space that pixel (u, v) sees at depth z_m.
    [[nodiscard]] Eigen::Vector3d point(double u, double v, double z_m) const { return ray(u, v) * z_m; }
    /// The pixel of a point in camera space, z > 0.
    [[nodiscard]] Eigen::Vector2d pixel(const Eigen::Vector3d& point) const {
        return {shared::project_axis(fx, cx, point.x(), point.z()), shared::project_axis(fy, cy, point.y(), point.z())};
    }

    /// The same camera in the GPU's single precision.
    [[nodiscard]] shared::Pinhole on_gpu() const {
        return {static_cast<float>(fx), static_cast<float>(fy), static_cast<float>(cx), static_cast<float>(cy)};
    }
};

/// How a lens bends a direction: a polynomial, or a quotient of two, in the tangent (Brown 1966; most lenses), or a
/// polynomial in the angle (Kannala and Brandt 2006; fisheyes, where the tangent grows without bound).
enum class LensModel { brown_conrady, kannala_brandt };

/// Distortion in OpenCV's order. Brown-Conrady has k1, k2, p1, p2, k3, and k4, k5, k6 where it is rational (ROS's
/// `rational_polynomial`, COLMAP's FULL_OPENCV, Azure Kinect), all zero = none; Kannala-Brandt (OpenCV's `fisheye`,
/// ROS's and Kalibr's `equidistant`) has k1, k2, k3, k4, and bends even when they are zero.
struct Distortion {
    double k1 = 0, k2 = 0, p1 = 0, p2 = 0, k3 = 0, k4 = 0, k5 = 0, k6 = 0;
    LensModel model = LensModel::brown_conrady;
    /// Whether Brown-Conrady's radius has a denominator.
    [[nodiscard]] bool rational() const { return model == LensModel::brown_conrady && (k4 != 0 || k5 != 0 || k6 != 0); }
    [[nodiscard]] bool any() const {
        return model == LensModel::kannala_brandt || k1 != 0 || k2 != 0 || p1 != 0 || p2 != 0 || k3 != 0 || rational();
    }
    friend bool operator==(const Distortion&, const Distortion&) = default;
};

/// Its numbers as files have them: k1, k2, p1, p2, k3, then k4, k5, k6 where it is rational; k1 .. k4 of a fisheye.
[[nodiscard]] std::vector<double> coefficients(const Distortion& distortion);
/// The same backwards: up to 8 numbers, or up to 4 of a fisheye; missing ones are 0.
[[nodiscard]] Distortion brown_conrady(const std::vector<double>& coefficients);
[[nodiscard]] Distortion kannala_brandt(const std::vector<double>& coefficients);

/// A recorded camera: pinhole, lens distortion, and where the numbers came from ("camera.json", "--camera", ...).
struct Camera {
    Pinhole pinhole;
    Distortion distortion;
    std::string origin;
};

/// Moves normalised image coordinates (x = X/Z, y = Y/Z) to where the lens bends them
/// (Brown 1966 as written in OpenCV's calib3d documentation); `coefficients` are k1, k2, p1, p2, k3, k4, k5, k6.
/// A template on its number so that solvers can differentiate it. With k4 = k5 = k6 = 0 it divides by exactly 1.
template <class Number>
void distort(const Number* coefficients, const Number& x, const Number& y, Number& x_bent, Number& y_bent) {
    const Number &k1 = coefficients[0], &k2 = coefficients[1], &p1 = coefficients[2], &p2 = coefficients[3];
    const Number &k3 = coefficients[4], &k4 = coefficients[5], &k5 = coefficients[6], &k6 = coefficients[7];
    const Number r2 = x * x + y * y;
    const Number radial = (Number(1) + r2 * (k1 + r2 * (k2 + r2 * k3))) / (Number(1) + r2 * (k4 + r2 * (k5 + r2 * k6)));
    x_bent = x * radial + Number(2) * p1 * x * y + p2 * (r2 + Number(2) * x * x);
    y_bent = y * radial + p1 * (r2 + Number(2) * y * y) + Number(2) * p2 * x * y;
}

/// The same for a fisheye: the angle theta from the axis becomes the radius theta (1 + k1 theta^2 + .. + k4 theta^8)
/// (Kannala and Brandt 2006, eq. 6, with OpenCV's scaling); `coefficients` are k1, k2, k3, k4.
template <class Number>
void distort_fisheye(const Number* coefficients, const Number& x, const Number& y, Number& x_bent, Number& y_bent) {
    using std::atan, std::sqrt;
    const Number r2 = x * x + y * y;
    if (r2 < Number(1e-16)) { // the square root has no derivative at the axis, the mapping has: 1
        x_bent = x;
        y_bent = y;
        return;
    }
    const Number r = sqrt(r2), theta = atan(r), t2 = theta * theta;
    const Number* k = coefficients;
    const Number bent = theta * (Number(1) + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))));
    x_bent = x * bent / r;
    y_bent = y * bent / r;
}

/// Correction of recorded depth: true z = scale z + offset + curve z^2, metres. The default changes nothing.
struct DepthCorrection {
    double scale = 1, offset_m = 0, curve_per_m = 0;
    [[nodiscard]] bool any() const { return scale != 1 || offset_m != 0 || curve_per_m != 0; }
    [[nodiscard]] double operator()(double z_m) const { return offset_m + z_m * (scale + z_m * curve_per_m); }
    friend bool operator==(const DepthCorrection&, const DepthCorrection&) = default;
};

/// Rejects an impossible camera: non-finite or non-positive focal lengths, principal point far outside the image,
/// empty size. Throws Error naming the value and `camera.origin`.
void check(const Camera& camera);

/// The pinhole scaled to another image size (same field of view).
[[nodiscard]] Pinhole scaled(const Pinhole& camera, cv::Size size);

/// "fx 585.00 fy 585.00 cx 320.00 cy 240.00 (640x480)", with distortion where there is any.
[[nodiscard]] std::string describe(const Camera& camera);
/// "1.012 z + 0.003 m"
[[nodiscard]] std::string describe(const DepthCorrection& correction);

} // namespace scanshade
