#include "projection/camera.h"

#include "projection/base/error.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>

namespace scanshade {
namespace {

[[noreturn]] void refuse(const Camera& camera, const std::string& what) {
    throw Error(fmt::format("camera ({}): {}", camera.origin.empty() ? "origin unknown" : camera.origin, what));
}

void check_focal_length(const Camera& camera, const char* name, double value) {
    if (!std::isfinite(value) || value <= 0)
        refuse(camera, fmt::format("{} is {}, a positive number of pixels expected", name, value));
}

/// Cropped images may have their principal point outside. But an image that lies wholly more than 70 degrees off the
/// axis comes from mixed-up numbers.
void check_principal_point(const Camera& camera, const char* name, double value, double focal_length, int length) {
    const double reach = 2.8 * focal_length;
    if (!std::isfinite(value) || value < -reach || value > length + reach)
        refuse(camera, fmt::format("{} is {}, expected near the image's {} pixels", name, value, length));
}

} // namespace

void check(const Camera& camera) {
    const auto& [fx, fy, cx, cy, size] = camera.pinhole;
    check_focal_length(camera, "fx", fx);
    check_focal_length(camera, "fy", fy);
    if (size.width <= 0 || size.height <= 0)
        refuse(camera, fmt::format("image size is {}x{}, at least 1x1 expected", size.width, size.height));
    check_principal_point(camera, "cx", cx, fx, size.width);
    check_principal_point(camera, "cy", cy, fy, size.height);
    const Distortion& d = camera.distortion;
    for (const auto& [name, value] : {std::pair{"k1", d.k1},
                                      {"k2", d.k2},
                                      {"p1", d.p1},
                                      {"p2", d.p2},
                                      {"k3", d.k3},
                                      {"k4", d.k4},
                                      {"k5", d.k5},
                                      {"k6", d.k6}})
        if (!std::isfinite(value))
            refuse(camera, fmt::format("{} is {}, a finite number expected", name, value));
}

std::vector<double> coefficients(const Distortion& d) {
    if (d.model == LensModel::kannala_brandt)
        return {d.k1, d.k2, d.k3, d.k4};
    if (d.rational())
        return {d.k1, d.k2, d.p1, d.p2, d.k3, d.k4, d.k5, d.k6};
    return {d.k1, d.k2, d.p1, d.p2, d.k3};
}

Distortion brown_conrady(const std::vector<double>& coefficients) {
    std::array<double, 8> k{};
    std::copy_n(coefficients.begin(), std::min(coefficients.size(), k.size()), k.begin());
    return {k[0], k[1], k[2], k[3], k[4], k[5], k[6], k[7]};
}

Distortion kannala_brandt(const std::vector<double>& coefficients) {
    std::array<double, 4> k{};
    std::copy_n(coefficients.begin(), std::min(coefficients.size(), k.size()), k.begin());
    return {.k1 = k[0], .k2 = k[1], .k3 = k[2], .k4 = k[3], .model = LensModel::kannala_brandt};
}

Pinhole scaled(const Pinhole& camera, cv::Size size) {
    const double sx = static_cast<double>(size.width) / camera.size.width;
    const double sy = static_cast<double>(size.height) / camera.size.height;
    return {camera.fx * sx, camera.fy * sy, (camera.cx + 0.5) * sx - 0.5, (camera.cy + 0.5) * sy - 0.5, size};
}

std::string describe(const Camera& camera) {
    const auto& [fx, fy, cx, cy, size] = camera.pinhole;
    std::string text =
        fmt::format("fx {:.2f} fy {:.2f} cx {:.2f} cy {:.2f} ({}x{})", fx, fy, cx, cy, size.width, size.height);
    if (const Distortion& d = camera.distortion; d.model == LensModel::kannala_brandt)
        text += fmt::format(" fisheye k1 {:g} k2 {:g} k3 {:g} k4 {:g}", d.k1, d.k2, d.k3, d.k4);
    else if (d.any())
        text += fmt::format(" k1 {:g} k2 {:g} p1 {:g} p2 {:g} k3 {:g}", d.k1, d.k2, d.p1, d.p2, d.k3);
    if (const Distortion& d = camera.distortion; d.rational())
        text += fmt::format(" k4 {:g} k5 {:g} k6 {:g}", d.k4, d.k5, d.k6);
    return text;
}

std::string describe(const DepthCorrection& c) {
    std::string text = fmt::format("{:g} z", c.scale);
    if (c.curve_per_m != 0)
        text += fmt::format(" {} {:g} z^2", c.curve_per_m < 0 ? '-' : '+', std::abs(c.curve_per_m));
    return text + fmt::format(" {} {:g} m", c.offset_m < 0 ? '-' : '+', std::abs(c.offset_m));
}

} // namespace scanshade
