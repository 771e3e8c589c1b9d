#include "apps/compare/error_classes.h"

#include "apps/picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <numbers>
#include <opencv2/imgproc.hpp>

namespace scanshade {
namespace {

/// Classes between rising limits: below the first, between each two, from the last on.
PixelClasses classified(const cv::Mat1f& values, const cv::Mat1f& z_m, const std::vector<double>& limits,
                        const std::string& unit) {
    PixelClasses classes{{fmt::format("< {:g}{}", limits.front(), unit)}, cv::Mat1b(z_m.size(), PixelClasses::none)};
    for (std::size_t i = 1; i < limits.size(); ++i)
        classes.names.push_back(fmt::format("{:g} .. {:g}{}", limits[i - 1], limits[i], unit));
    classes.names.push_back(fmt::format("> {:g}{}", limits.back(), unit));
    for (int y = 0; y < z_m.rows; ++y)
        for (int x = 0; x < z_m.cols; ++x)
            if (z_m(y, x) > 0)
                classes.of(y, x) = static_cast<uchar>(
                    std::upper_bound(limits.begin(), limits.end(), static_cast<double>(values(y, x))) - limits.begin());
    return classes;
}

/// 1/z of pixel i of a line; 0 in holes and outside.
float inverse(const float* z, std::ptrdiff_t stride, int count, int i) {
    const float value = i >= 0 && i < count ? z[stride * i] : 0;
    return value > 0 ? 1 / value : 0;
}

/// Whether depth jumps between pixels i and i + 1 of a line.
bool jumps(const float* z, std::ptrdiff_t stride, int count, int i) {
    const float a = inverse(z, stride, count, i), b = inverse(z, stride, count, i + 1);
    if ((a > 0) != (b > 0))
        return true;
    const float tolerance = 0.01F * std::min(a, b);
    if (std::abs(b - a) <= tolerance)
        return false;
    const float before = inverse(z, stride, count, i - 1), after = inverse(z, stride, count, i + 2);
    const bool from_a = before > 0 && std::abs(b - (2 * a - before)) <= tolerance;
    const bool from_b = after > 0 && std::abs(a - (2 * b - after)) <= tolerance;
    return !from_a && !from_b;
}

/// Distance of each pixel from the nearest one that is 0 in `away`.
cv::Mat1f distance_from(const cv::Mat1b& away) {
    cv::Mat1f distance;
    cv::distanceTransform(away, distance, cv::DIST_L2, cv::DIST_MASK_PRECISE);
    return distance;
}

constexpr double thin_m = 0.04;
constexpr float hole_px = 4, edge_px = 8;
constexpr float deep = 0.2F, open = 0.95F;

/// Steps from `at` along `step` until depth is more than `thin_m` farther away, or ends; -1 where neither happens
/// within `most` steps.
int steps_to_background(const cv::Mat1f& z_m, cv::Point at, cv::Point step, int most) {
    const float limit = z_m(at) + static_cast<float>(thin_m);
    const cv::Rect image({}, z_m.size());
    for (int i = 1; i <= most; ++i) {
        at += step;
        if (!image.contains(at))
            return -1;
        if (!(z_m(at) > 0) || z_m(at) > limit)
            return i;
    }
    return -1;
}

/// Whether the pixel's surface falls off to both sides within thin_m along one of four lines.
bool is_thin(const cv::Mat1f& z_m, cv::Point at, const Pinhole& camera) {
    const std::array lines{cv::Point(1, 0), cv::Point(0, 1), cv::Point(1, 1), cv::Point(1, -1)};
    const double z = z_m(at);
    return std::ranges::any_of(lines, [&](const cv::Point& line) {
        const double m_per_step = z * std::hypot(line.x / camera.fx, line.y / camera.fy);
        const double steps = thin_m / m_per_step; // the whole width; below one no pixel can be told to be thin
        const int most = static_cast<int>(std::clamp(std::ceil(steps), 1.0, double(z_m.cols)));
        const int before = steps_to_background(z_m, at, -line, most);
        if (before < 0)
            return false;
        const int after = steps_to_background(z_m, at, line, most);
        return after > 0 && before + after - 1 <= most;
    });
}

/// 0 at a jump, 255 elsewhere.
cv::Mat1b edges(const cv::Mat1f& z_m) {
    cv::Mat1b away(z_m.size(), uchar(255));
    const std::ptrdiff_t row = z_m.cols;
    for (int y = 0; y < z_m.rows; ++y)
        for (int x = 0; x + 1 < z_m.cols; ++x)
            if (jumps(z_m[y], 1, z_m.cols, x))
                away(y, x) = away(y, x + 1) = 0;
    for (int x = 0; x < z_m.cols; ++x)
        for (int y = 0; y + 1 < z_m.rows; ++y)
            if (jumps(z_m[0] + x, row, z_m.rows, y))
                away(y, x) = away(y + 1, x) = 0;
    return away;
}

} // namespace

PixelClasses by_edge_distance(const cv::Mat1f& z_m) {
    const cv::Mat1f whole = z_m.isContinuous() ? z_m : z_m.clone();
    return classified(distance_from(edges(whole)), whole, {1, 2, 4, 8, 16, 32}, " px");
}

PixelClasses by_grazing_angle(const cv::Mat1f& z_m, const Pinhole& camera) {
    cv::Mat1f angle = facing_camera(z_m, camera);
    for (float& value : angle)
        value = static_cast<float>(std::acos(std::clamp(value, 0.0F, 1.0F)) * 180 / std::numbers::pi);
    return classified(angle, z_m, {15, 30, 45, 60, 70, 80}, " deg");
}

PixelClasses by_range(const cv::Mat1f& z_m) { return classified(z_m, z_m, {1, 2, 3, 4, 6, 10, 20, 50}, " m"); }

PixelClasses by_place(const cv::Mat1f& exact_z_m, const cv::Mat1f& recorded_z_m, const cv::Mat1f& truth,
                      const Pinhole& camera) {
    PixelClasses classes{
        {"thin things", "deep corners", "near holes", "near depth edges", "open and flat", "between them"},
        cv::Mat1b(exact_z_m.size(), PixelClasses::none)};
    const cv::Mat1f whole = exact_z_m.isContinuous() ? exact_z_m : exact_z_m.clone();
    const cv::Mat1f from_edge = distance_from(edges(whole));
    // Far from any hole everywhere, where there is none: the transform of an image without zeros is not defined.
    const cv::Mat1b recorded(recorded_z_m > 0);
    const cv::Mat1f from_hole = cv::countNonZero(recorded) < static_cast<int>(recorded.total())
                                    ? distance_from(recorded)
                                    : cv::Mat1f(recorded.size(), std::numeric_limits<float>::max());
    const auto place_of = [&](const cv::Point& at) {
        if (is_thin(whole, at, camera))
            return thin_thing;
        if (truth(at) < deep)
            return deep_corner;
        if (from_hole(at) <= hole_px)
            return near_hole;
        if (from_edge(at) <= edge_px)
            return near_edge;
        return truth(at) >= open ? open_flat : between_them;
    };
    for (int y = 0; y < whole.rows; ++y)
        for (int x = 0; x < whole.cols; ++x)
            if (whole(y, x) > 0 && std::isfinite(truth(y, x)))
                classes.of(y, x) = place_of({x, y});
    return classes;
}

PixelClasses by_confidence(const cv::Mat1f& confidence) {
    const cv::Mat1f known(confidence + 1); // 0 and NaN are no surface to classified()
    return classified(confidence, known, {0.25, 0.5, 0.7, 0.85}, "");
}

void ErrorByClass::add(const cv::Mat1f& a, const cv::Mat1f& b, const PixelClasses& classes) {
    names_ = classes.names;
    sums_.resize(names_.size());
    for (int y = 0; y < a.rows; ++y)
        for (int x = 0; x < a.cols; ++x) {
            const double apart = a(y, x) - b(y, x);
            if (!std::isfinite(apart) || classes.of(y, x) == PixelClasses::none)
                continue;
            Sum& sum = sums_[classes.of(y, x)];
            sum.n += 1;
            sum.apart += apart;
            sum.squares += apart * apart;
        }
}

void ErrorByClass::add(const ErrorByClass& other) {
    if (other.names_.empty())
        return;
    names_ = other.names_;
    sums_.resize(names_.size());
    for (std::size_t i = 0; i < sums_.size(); ++i) {
        sums_[i].n += other.sums_[i].n;
        sums_[i].apart += other.sums_[i].apart;
        sums_[i].squares += other.sums_[i].squares;
    }
}

double ErrorByClass::rms(std::size_t i) const {
    return sums_[i].n > 0 ? std::sqrt(sums_[i].squares / sums_[i].n) : std::numeric_limits<double>::quiet_NaN();
}

double ErrorByClass::bias(std::size_t i) const {
    return sums_[i].n > 0 ? sums_[i].apart / sums_[i].n : std::numeric_limits<double>::quiet_NaN();
}

} // namespace scanshade
