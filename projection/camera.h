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

#include <opencv2/core.hpp>
#include <string>

namespace scanshade {

/// An undistorted camera: focal lengths and principal point in pixels, image size in pixels. Double on the host.
struct Pinhole {
    double fx = 0, fy = 0, cx = 0, cy = 0;
    cv::Size size;

    /// The same camera in the GPU's single precision.
    [[nodiscard]] shared::Pinhole on_gpu() const {
        return {static_cast<float>(fx), static_cast<float>(fy), static_cast<float>(cx), static_cast<float>(cy)};
    }
};

/// Brown-Conrady distortion in OpenCV's order (k1, k2, p1, p2, k3); all zero = none.
struct Distortion {
    double k1 = 0, k2 = 0, p1 = 0, p2 = 0, k3 = 0;
    [[nodiscard]] bool any() const { return k1 != 0 || k2 != 0 || p1 != 0 || p2 != 0 || k3 != 0; }
};

/// A recorded camera: pinhole, lens distortion, and where the numbers came from ("camera.json", "--camera", ...).
struct Camera {
    Pinhole pinhole;
    Distortion distortion;
    std::string origin;
};

/// Moves normalised image coordinates (x = X/Z, y = Y/Z) to where the lens bends them
/// (Brown 1966 as written in OpenCV's calib3d documentation). A template on its number so that solvers can differentiate it.
template <class Number>
void distort(const Number coefficients[5], const Number& x, const Number& y, Number& x_bent, Number& y_bent) {
    const Number &k1 = coefficients[0], &k2 = coefficients[1], &p1 = coefficients[2], &p2 = coefficients[3];
    const Number& k3 = coefficients[4];
    const Number r2 = x * x + y * y;
    const Number radial = Number(1) + r2 * (k1 + r2 * (k2 + r2 * k3));
    x_bent = x * radial + Number(2) * p1 * x * y + p2 * (r2 + Number(2) * x * x);
    y_bent = y * radial + p1 * (r2 + Number(2) * y * y) + Number(2) * p2 * x * y;
}

/// Refuses a camera that cannot be: non-finite or non-positive focal lengths, principal point far outside the image,
/// empty size. Throws Error naming the value and `camera.origin`.
void check(const Camera& camera);

/// The pinhole scaled to another image size (same field of view).
[[nodiscard]] Pinhole scaled(const Pinhole& camera, cv::Size size);

/// "fx 585.00 fy 585.00 cx 320.00 cy 240.00 (640x480)", with distortion where there is any.
[[nodiscard]] std::string describe(const Camera& camera);

} // namespace scanshade
