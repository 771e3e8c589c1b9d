// Renders triangles of the recorded surface into the colour image, and looks values up there.
#include "projection/colour_view.h"

#include "projection/base/error.h"
#include "projection/project.h"
#include "projection/undistort.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <limits>

namespace scanshade {
namespace {

constexpr float nowhere = std::numeric_limits<float>::quiet_NaN();

/// Column and row in the colour image, and depth before it; depth 0 where the colour camera cannot see it.
using Seen = cv::Vec3f;

/// The direction each depth pixel looks in, x and y at z = 1.
cv::Mat2f directions_of(const Camera& camera) {
    if (camera.distortion.any())
        return Undistortion::of(camera)->direction();
    const Pinhole& p = camera.pinhole;
    cv::Mat2f directions(p.size);
    for (int v = 0; v < directions.rows; ++v)
        for (int u = 0; u < directions.cols; ++u) {
            const Eigen::Vector3d ray = p.ray(u, v);
            directions(v, u) = {static_cast<float>(ray.x()), static_cast<float>(ray.y())};
        }
    return directions;
}

Seen seen_by(const Camera& camera, double fold, const Eigen::Vector3d& point) {
    if (point.z() <= 0)
        return {};
    const Eigen::Vector2d straight = point.hnormalized();
    if (!(straight.squaredNorm() < fold))
        return {};
    const Eigen::Vector2d bent = distorted(camera.distortion, straight);
    const Pinhole& p = camera.pinhole;
    return {static_cast<float>(p.fx * bent.x() + p.cx), static_cast<float>(p.fy * bent.y() + p.cy),
            static_cast<float>(point.z())};
}

/// The position of every depth pixel in the colour image.
cv::Mat_<Seen> places_in_colour(const cv::Mat1f& depth_m, const Camera& depth_camera, const ColourCamera& colour) {
    if (depth_m.size() != depth_camera.pinhole.size)
        throw Error(fmt::format("depth is {}x{}, but its camera is for {}x{}", depth_m.cols, depth_m.rows,
                                depth_camera.pinhole.size.width, depth_camera.pinhole.size.height));
    const cv::Mat2f directions = directions_of(depth_camera);
    const double fold = fold_r2(colour.camera.distortion);
    cv::Mat_<Seen> places(depth_m.size());
    for (int v = 0; v < places.rows; ++v)
        for (int u = 0; u < places.cols; ++u) {
            const double z = depth_m(v, u), x = directions(v, u)[0], y = directions(v, u)[1];
            const bool recorded = z > 0 && std::isfinite(z) && std::isfinite(x);
            places(v, u) =
                recorded ? seen_by(colour.camera, fold, colour.colour_from_depth * Eigen::Vector3d(x * z, y * z, z))
                         : Seen();
        }
    return places;
}

struct Corner {
    cv::Point at; ///< in the depth image
    Seen seen;
};

/// Twice the signed area of a triangle with a corner at (x, y).
float area(const Seen& a, const Seen& b, float x, float y) {
    return (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]);
}

/// Fills the pixel centres in a triangle, with a depth test. Borders are inside, so adjacent triangles leave no seam.
void draw(const std::array<Corner, 3>& corners, SurfaceInColour& surface) {
    const auto& [a, b, c] = corners;
    const auto [low_u, high_u] = std::minmax({a.seen[0], b.seen[0], c.seen[0]});
    const auto [low_v, high_v] = std::minmax({a.seen[1], b.seen[1], c.seen[1]});
    const int left = std::max(0, static_cast<int>(std::ceil(std::max(low_u, -1.0F))));
    const int top = std::max(0, static_cast<int>(std::ceil(std::max(low_v, -1.0F))));
    const auto last = [](float high, int length) {
        return static_cast<int>(std::floor(std::min(high, static_cast<float>(length - 1))));
    };
    const float whole = area(a.seen, b.seen, c.seen[0], c.seen[1]);
    if (whole == 0)
        return;
    for (int v = top; v <= last(high_v, surface.z_m.rows); ++v)
        for (int u = left; u <= last(high_u, surface.z_m.cols); ++u) {
            const auto x = static_cast<float>(u), y = static_cast<float>(v);
            const float of_a = area(b.seen, c.seen, x, y) / whole, of_b = area(c.seen, a.seen, x, y) / whole;
            const float of_c = 1 - of_a - of_b;
            if (of_a < 0 || of_b < 0 || of_c < -1e-6F)
                continue;
            const float z = 1 / (of_a / a.seen[2] + of_b / b.seen[2] + of_c / c.seen[2]);
            float& nearest = surface.z_m(v, u);
            if (nearest > 0 && nearest <= z)
                continue;
            nearest = z;
            const auto between = [&](int one, int two, int three) {
                return of_a * static_cast<float>(one) + of_b * static_cast<float>(two) +
                       of_c * static_cast<float>(three);
            };
            surface.seen_at(v, u) = {between(a.at.x, b.at.x, c.at.x), between(a.at.y, b.at.y, c.at.y)};
        }
}

bool one_surface(const std::array<Corner, 3>& corners, const Pinhole& camera) {
    const auto [low, high] = std::minmax({corners[0].seen[2], corners[1].seen[2], corners[2].seen[2]});
    return low > 0 && high - low <= same_surface_m(camera, low);
}

/// The surface's least depth in the 3x3 pixels around a position; 0 where there is none.
float nearest_about(const cv::Mat1f& z_m, const Seen& place) {
    const int u = static_cast<int>(std::lround(place[0])), v = static_cast<int>(std::lround(place[1]));
    float nearest = 0;
    for (int y = std::max(v - 1, 0); y <= std::min(v + 1, z_m.rows - 1); ++y)
        for (int x = std::max(u - 1, 0); x <= std::min(u + 1, z_m.cols - 1); ++x)
            if (const float z = z_m(y, x); z > 0 && (nearest == 0 || z < nearest))
                nearest = z;
    return nearest;
}

template <class Sample>
cv::Vec<Sample, 3> colour_between(const cv::Mat_<cv::Vec<Sample, 3>>& colour, const Seen& place) {
    const int u = std::min(static_cast<int>(place[0]), colour.cols - 2);
    const int v = std::min(static_cast<int>(place[1]), colour.rows - 2);
    const float right = place[0] - static_cast<float>(u), down = place[1] - static_cast<float>(v);
    cv::Vec<Sample, 3> mixed;
    for (int channel = 0; channel < 3; ++channel) {
        const float upper = static_cast<float>(colour(v, u)[channel]) * (1 - right) +
                            static_cast<float>(colour(v, u + 1)[channel]) * right;
        const float lower = static_cast<float>(colour(v + 1, u)[channel]) * (1 - right) +
                            static_cast<float>(colour(v + 1, u + 1)[channel]) * right;
        mixed[channel] = static_cast<Sample>(std::lround(upper * (1 - down) + lower * down));
    }
    return mixed;
}

bool inside(const Seen& place, cv::Size size) {
    return place[0] >= 0 && place[1] >= 0 && place[0] <= static_cast<float>(size.width - 1) &&
           place[1] <= static_cast<float>(size.height - 1);
}

} // namespace

SurfaceInColour surface_in_colour(const cv::Mat1f& depth_m, const Camera& depth_camera, const ColourCamera& colour) {
    const cv::Mat_<Seen> places = places_in_colour(depth_m, depth_camera, colour);
    const Pinhole& camera = depth_camera.pinhole;
    SurfaceInColour surface{cv::Mat1f(colour.camera.pinhole.size, 0.0F),
                            cv::Mat2f(colour.camera.pinhole.size, cv::Vec2f(nowhere, nowhere))};
    for (int v = 0; v + 1 < places.rows; ++v)
        for (int u = 0; u + 1 < places.cols; ++u) {
            const auto corner = [&](int du, int dv) { return Corner{{u + du, v + dv}, places(v + dv, u + du)}; };
            for (const std::array<Corner, 3>& triangle : {std::array{corner(0, 0), corner(1, 0), corner(0, 1)},
                                                          std::array{corner(1, 0), corner(1, 1), corner(0, 1)}})
                if (one_surface(triangle, camera))
                    draw(triangle, surface);
        }
    return surface;
}

ColourOnDepth colour_on_depth(const cv::Mat3b& colour, const cv::Mat1f& depth_m, const Camera& depth_camera,
                              const ColourCamera& colour_camera, const SurfaceInColour& surface,
                              const cv::Mat3w& deep_colour) {
    if (colour.size() != colour_camera.camera.pinhole.size || colour.cols < 2 || colour.rows < 2)
        throw Error(fmt::format("colour is {}x{}, but its camera is for {}x{} ({})", colour.cols, colour.rows,
                                colour_camera.camera.pinhole.size.width, colour_camera.camera.pinhole.size.height,
                                colour_camera.camera.origin));
    const cv::Mat_<Seen> places = places_in_colour(depth_m, depth_camera, colour_camera);
    const bool deep = deep_colour.size() == colour.size();
    ColourOnDepth result{cv::Mat3b(depth_m.size(), cv::Vec3b()), cv::Mat1b(depth_m.size(), uchar{0}),
                         deep ? cv::Mat3w(depth_m.size(), cv::Vec3w()) : cv::Mat3w()};
    for (int v = 0; v < places.rows; ++v)
        for (int u = 0; u < places.cols; ++u) {
            const Seen& place = places(v, u);
            if (place[2] == 0 || !inside(place, colour.size()))
                continue;
            const float nearest = nearest_about(surface.z_m, place);
            if (nearest > 0 && nearest < place[2] - same_surface_m(colour_camera.camera.pinhole, place[2]))
                continue;
            result.colour(v, u) = colour_between(colour, place);
            if (deep)
                result.deep(v, u) = colour_between(deep_colour, place);
            result.known(v, u) = 255;
        }
    return result;
}

cv::Mat1f on_colour_pixels(const cv::Mat1f& per_depth_pixel, const SurfaceInColour& surface) {
    cv::Mat1f values(surface.z_m.size(), nowhere);
    for (int row = 0; row < values.rows; ++row)
        for (int column = 0; column < values.cols; ++column) {
            const cv::Vec2f at = surface.seen_at(row, column);
            if (std::isnan(at[0]))
                continue;
            const int u = std::clamp(static_cast<int>(at[0]), 0, std::max(per_depth_pixel.cols - 2, 0));
            const int v = std::clamp(static_cast<int>(at[1]), 0, std::max(per_depth_pixel.rows - 2, 0));
            float sum = 0, weights = 0;
            for (int dv = 0; dv < 2; ++dv)
                for (int du = 0; du < 2; ++du) {
                    const float value = per_depth_pixel(std::min(v + dv, per_depth_pixel.rows - 1),
                                                        std::min(u + du, per_depth_pixel.cols - 1));
                    const float weight = (1 - std::abs(at[0] - static_cast<float>(u + du))) *
                                         (1 - std::abs(at[1] - static_cast<float>(v + dv)));
                    if (std::isnan(value) || !(weight > 0))
                        continue;
                    sum += weight * value;
                    weights += weight;
                }
            if (weights > 0)
                values(row, column) = sum / weights;
        }
    return values;
}

} // namespace scanshade
