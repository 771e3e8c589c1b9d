// Depth and visibility made visible: colours for depth, clay for shape, and the side-by-side panel.
#include "apps/picture.h"

#include "ao/finish/finish.h"
#include "projection/base/statistics.h"
#include "shaders/shared/finish.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace scanshade {
namespace {

const cv::Vec3b no_surface(shared::no_surface_blue, shared::no_surface_green, shared::no_surface_red);

/// The depths below which 1 % and 99 % of the seen pixels lie; {0, 0} when nothing was seen.
std::pair<float, float> usual_range(const cv::Mat1f& z_m) {
    std::vector<float> seen;
    seen.reserve(z_m.total());
    std::copy_if(z_m.begin(), z_m.end(), std::back_inserter(seen), [](float z) { return z > 0; });
    if (seen.empty())
        return {0.0f, 0.0f};
    const auto at_share = [&](std::size_t percent) { return ranked(seen, (seen.size() - 1) * percent / 100); };
    const float near = at_share(1);
    return {near, at_share(99)};
}

// Clay works on inverse depth: on a plane 1/z is linear in the pixel, so averages and slopes over neighbours
// are exact there. Elsewhere they take out a sensor's depth steps, which are even in 1/z.

/// Calls visit(k, 1/z of the neighbour k pixels on) along one image axis, up to `reach` to either side. It stops at the
/// first hole or jump, so all neighbours are on the pixel's own surface. `stride` is the axis' step in memory, `before`
/// and `after` how many pixels the image has on either side.
template <class Visit>
void along_surface(const float* pixel, std::ptrdiff_t stride, int before, int after, int reach, Visit&& visit) {
    constexpr float jump = 0.01f; // of 1/z, per pixel: a surface seen at 80 degrees stays in one piece
    const float tolerance = *pixel * jump;
    for (const int side : {-1, 1}) {
        const int last = std::min(reach, side < 0 ? before : after);
        for (int k = 1; k <= last; ++k) {
            const float beside = pixel[stride * (side * k)];
            if (beside == 0 || std::abs(beside - *pixel) > tolerance * static_cast<float>(k + 1))
                break;
            visit(side * k, beside);
        }
    }
}

/// Mean over each pixel's neighbours on its own surface, along x or y.
cv::Mat1f smoothed(const cv::Mat1f& inverse, bool along_x) {
    constexpr int reach = 4;
    cv::Mat1f mean(inverse.size(), 0.0f);
    const std::ptrdiff_t stride = along_x ? 1 : inverse.cols;
    for (int v = 0; v < inverse.rows; ++v) {
        for (int u = 0; u < inverse.cols; ++u) {
            const float* pixel = inverse[v] + u;
            if (*pixel == 0)
                continue;
            float sum = *pixel, moment = 0, weight = 1;
            const int place = along_x ? u : v, count = along_x ? inverse.cols : inverse.rows;
            along_surface(pixel, stride, place, count - 1 - place, reach, [&](int k, float beside) {
                sum += beside;
                moment += static_cast<float>(k);
                ++weight;
            });
            // Beside an edge the neighbours lie on one side only, where a slanted surface has another mean: leave it
            // be.
            mean(v, u) = moment == 0 ? sum / weight : *pixel;
        }
    }
    return mean;
}

/// Change of 1/z per pixel: a line through the pixel and its neighbours, least squares.
float slope(const float* pixel, std::ptrdiff_t stride, int before, int after) {
    constexpr int reach = 3;
    float product = 0, weight = 0;
    along_surface(pixel, stride, before, after, reach, [&](int k, float beside) {
        product += static_cast<float>(k) * (beside - *pixel);
        weight += static_cast<float>(k * k);
    });
    return weight > 0 ? product / weight : 0;
}

/// Cosine between the surface normal and the way back to the camera. From 1/z = n . ray / (n . point), the normal is
/// parallel to (fx du, fy dv, 1/z - du (u - cx) - dv (v - cy)), du and dv being the slopes of 1/z.
float facing(const cv::Mat1f& inverse, cv::Point at, const Pinhole& camera) {
    const float* pixel = inverse[at.y] + at.x;
    const double du = slope(pixel, 1, at.x, inverse.cols - 1 - at.x);
    const double dv = slope(pixel, inverse.cols, at.y, inverse.rows - 1 - at.y);
    const double u = at.x - camera.cx, v = at.y - camera.cy;
    const cv::Vec3d normal(camera.fx * du, camera.fy * dv, *pixel - du * u - dv * v);
    const cv::Vec3d ray(u / camera.fx, v / camera.fy, 1);
    const double length = std::sqrt(normal.dot(normal) * ray.dot(ray));
    return length > 0 ? static_cast<float>(std::abs(normal.dot(ray)) / length) : 0;
}

constexpr int white_at = 127; // index among the 255 diverging colours

/// Blue over white to red, BGR.
std::vector<cv::Vec3b> diverging_colours() {
    const cv::Vec3f white(97, 0, 0), blue(46, 8, -54), red(46, 46.4F, 28.9F); // L*, a*, b*
    cv::Mat3f lab(1, 2 * white_at + 1), bgr;
    for (int i = -white_at; i <= white_at; ++i) {
        const float share = static_cast<float>(std::abs(i)) / white_at;
        lab(0, i + white_at) = white + share * ((i < 0 ? blue : red) - white);
    }
    cv::cvtColor(lab, bgr, cv::COLOR_Lab2BGR);
    std::vector<cv::Vec3b> colours;
    for (const cv::Vec3f& colour : bgr)
        colours.emplace_back(cv::saturate_cast<uchar>(255 * colour[0]), cv::saturate_cast<uchar>(255 * colour[1]),
                             cv::saturate_cast<uchar>(255 * colour[2]));
    return colours;
}

cv::Mat3b with_title(const Tile& tile, cv::Size size) {
    constexpr int strip = 28;
    cv::Mat3b titled(size.height + strip, size.width, cv::Vec3b(32, 32, 32));
    if (!tile.picture.empty())
        cv::resize(tile.picture, titled.rowRange(strip, titled.rows), size, 0, 0, cv::INTER_AREA);
    cv::putText(titled, tile.title, {8, 20}, cv::FONT_HERSHEY_SIMPLEX, 0.5, {235, 235, 235}, 1, cv::LINE_AA);
    return titled;
}

} // namespace

cv::Mat3b depth_picture(const cv::Mat1f& z_m) {
    const auto [near, far] = usual_range(z_m);
    const float range = std::max(far - near, 1e-6f);
    cv::Mat1b level(z_m.size());
    std::transform(z_m.begin(), z_m.end(), level.begin(),
                   [&, near = near, far = far](float z) { return cv::saturate_cast<uchar>(255 * (far - z) / range); });
    cv::Mat3b picture;
    cv::applyColorMap(level, picture, cv::COLORMAP_TURBO);
    picture.setTo(cv::Scalar::all(0), z_m <= 0);
    return picture;
}

cv::Mat3b visibility_picture(const cv::Mat1f& visibility) {
    cv::Mat3b picture(visibility.size());
    std::transform(visibility.begin(), visibility.end(), picture.begin(), [](float v) {
        return std::isnan(v) ? no_surface : cv::Vec3b::all(cv::saturate_cast<uchar>(255 * v));
    });
    return picture;
}

cv::Mat3b difference_picture(const cv::Mat1f& difference, double full_scale) {
    static const std::vector<cv::Vec3b> colours = diverging_colours();
    cv::Mat3b picture(difference.size());
    std::transform(difference.begin(), difference.end(), picture.begin(), [&](float d) {
        if (std::isnan(d))
            return no_surface;
        const double place = std::clamp(d / full_scale, -1.0, 1.0) * white_at;
        return colours[static_cast<std::size_t>(std::lround(place) + white_at)];
    });
    return picture;
}

cv::Mat1f facing_camera(const cv::Mat1f& z_m, const Pinhole& camera) {
    cv::Mat1f inverse(z_m.size());
    std::transform(z_m.begin(), z_m.end(), inverse.begin(), [](float z) { return z > 0 ? 1 / z : 0.0f; });
    inverse = smoothed(smoothed(inverse, true), false);
    cv::Mat1f cosine(z_m.size(), 0.0f);
    for (int v = 0; v < z_m.rows; ++v)
        for (int u = 0; u < z_m.cols; ++u)
            if (inverse(v, u) > 0)
                cosine(v, u) = facing(inverse, {u, v}, camera);
    return cosine;
}

bool has_colours(const Cloud& cloud) {
    return std::ranges::any_of(cloud.colours, [](const cv::Vec3b& colour) { return colour != cv::Vec3b(); });
}

std::vector<cv::Vec3b> greys(const std::vector<float>& visibility) {
    std::vector<cv::Vec3b> colours(visibility.size());
    std::ranges::transform(visibility, colours.begin(), [](float value) {
        return cv::Vec3b::all(std::isnan(value) ? uchar(0) : cv::saturate_cast<uchar>(255 * value));
    });
    return colours;
}

cv::Mat3b clay(const cv::Mat1f& z_m, const Pinhole& camera) { return clay_of(facing_camera(z_m, camera), z_m); }

cv::Mat3b panel(const std::vector<Tile>& tiles) {
    const auto first = std::find_if(tiles.begin(), tiles.end(), [](const Tile& t) { return !t.picture.empty(); });
    if (first == tiles.end())
        return {};
    const cv::Size size = first->picture.size();
    std::vector<cv::Mat> row;
    for (const Tile& tile : tiles) {
        const cv::Size own = tile.picture.empty() ? size : tile.picture.size();
        const double width = static_cast<double>(own.width) * size.height / own.height;
        row.push_back(with_title(tile, {std::max(1, cvRound(width)), size.height}));
    }
    cv::Mat3b side_by_side;
    cv::hconcat(row, side_by_side);
    return side_by_side;
}

} // namespace scanshade
