#include "projection/project.h"

#include "projection/base/error.h"
#include "projection/undistort.h"

#include <algorithm>
#include <array>
#include <bitset>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <tuple>

namespace scanshade {
namespace {

[[nodiscard]] bool in_range(double z_m, const ProjectOptions& options) {
    return z_m >= options.near_m && z_m <= options.far_m; // false for NaN
}

// ---------------------------------------------------------------------------------------------------- cameras

Camera camera_of_image(const Frame& frame) {
    Camera camera = frame.camera;
    const cv::Size size = frame.depth_m.size();
    if (camera.pinhole.fx == 0)
        throw Error("the depth image has no camera: fx, fy, cx and cy are needed");
    if (camera.pinhole.size.empty())
        camera.pinhole.size = size;
    check(camera);
    if (camera.pinhole.size != size)
        throw Error(fmt::format("the camera ({}) is for {}x{} pixels, the depth image has {}x{}", camera.origin,
                                camera.pinhole.size.width, camera.pinhole.size.height, size.width, size.height));
    return camera;
}

Camera sized_camera(const Cloud& cloud, Camera camera) {
    Pinhole& pinhole = camera.pinhole;
    if (pinhole.size.empty() && cloud.organised())
        pinhole.size = cloud.grid;
    if (pinhole.size.empty()) {
        constexpr double largest = 16384;
        pinhole.size = {static_cast<int>(std::clamp(2 * pinhole.cx + 1, 0.0, largest)),
                        static_cast<int>(std::clamp(2 * pinhole.cy + 1, 0.0, largest))};
        camera.origin += ", image size from its principal point";
    }
    check(camera);
    return camera;
}

/// The points of a cloud in the plane z = 1, if a camera at the origin can see them.
struct Framing {
    int valid = 0, seen = 0;
    double x_low = INFINITY, x_high = -INFINITY, y_low = INFINITY, y_high = -INFINITY;

    [[nodiscard]] double width() const { return std::max(x_high - x_low, narrowest); }
    [[nodiscard]] double height() const { return std::max(y_high - y_low, narrowest); }
    static constexpr double narrowest = 0.01; ///< radians; gives single points and straight lines an image, too
};

constexpr double widest = 2.75; // tangent of 70 degrees: beyond it a pinhole image is mostly border

template <class Visit>
void for_each_seen(const Cloud& cloud, Visit&& visit) {
    for (const Eigen::Vector3d& point : cloud.points)
        if (point.allFinite() && point.z() > 0 && point.head<2>().cwiseAbs().maxCoeff() <= widest * point.z())
            visit(point.x() / point.z(), point.y() / point.z());
}

Framing framing_of(const Cloud& cloud) {
    Framing framing;
    framing.valid = static_cast<int>(
        std::count_if(cloud.points.begin(), cloud.points.end(), [](const auto& point) { return point.allFinite(); }));
    for_each_seen(cloud, [&](double x, double y) {
        ++framing.seen;
        framing.x_low = std::min(framing.x_low, x), framing.x_high = std::max(framing.x_high, x);
        framing.y_low = std::min(framing.y_low, y), framing.y_high = std::max(framing.y_high, y);
    });
    return framing;
}

/// Share of the framing rectangle that holds points, on a coarse raster.
double occupied_share(const Cloud& cloud, const Framing& framing) {
    constexpr int cells = 64;
    std::bitset<cells * cells> hit;
    const auto cell = [](double offset, double extent) {
        return std::clamp(static_cast<int>(offset / extent * cells), 0, cells - 1);
    };
    for_each_seen(cloud, [&](double x, double y) {
        hit.set(cell(y - framing.y_low, framing.height()) * cells + cell(x - framing.x_low, framing.width()));
    });
    return static_cast<double>(hit.count()) / (cells * cells);
}

Camera framing_camera(const Cloud& cloud) {
    constexpr int largest_px = 1024, border_px = 2;
    constexpr double enough = 0.99; // a few outliers may stay outside; coverage counts them
    const Framing framing = framing_of(cloud);
    if (framing.valid == 0)
        return {{1.0 * cloud.grid.width,
                 1.0 * cloud.grid.width,
                 (cloud.grid.width - 1) / 2.0,
                 (cloud.grid.height - 1) / 2.0,
                 {std::clamp(cloud.grid.width, 1, largest_px), std::clamp(cloud.grid.height, 1, largest_px)}},
                {},
                "nominal: the cloud has no valid points"};
    if (framing.seen < enough * framing.valid)
        throw Error(
            fmt::format("the cloud has no single camera: {} of its {} valid points lie in front of its origin (z > 0, "
                        "within 70 degrees of the axis)",
                        framing.seen, framing.valid));
    const double area = framing.width() * framing.height() * occupied_share(cloud, framing);
    const double one_per_pixel = std::sqrt(framing.seen / area);
    const double f =
        std::min(one_per_pixel, (largest_px - 2 * border_px - 1) / std::max(framing.width(), framing.height()));
    const auto pixels = [&](double extent) { return static_cast<int>(std::ceil(extent * f)) + 2 * border_px + 1; };
    return {{f,
             f,
             border_px - framing.x_low * f,
             border_px - framing.y_low * f,
             {pixels(framing.width()), pixels(framing.height())}},
            {},
            fmt::format("chosen to frame the cloud from its origin along +z, about one point per pixel")};
}

bool has_rays(const Cloud& cloud) {
    return std::any_of(cloud.points.begin(), cloud.points.end(), [](const auto& point) { return point.z() > 0; });
}

Camera camera_of_cloud(const Frame& frame) {
    const Cloud& cloud = *frame.cloud;
    if (frame.camera.pinhole.fx != 0)
        return sized_camera(cloud, frame.camera);
    if (!cloud.organised() || !has_rays(cloud))
        return framing_camera(cloud);
    const PinholeFit fit = fit_pinhole(cloud);
    return {fit.camera, {}, fmt::format("recovered from the points, rms {:.4f} px, {} points", fit.rms_px, fit.points)};
}

// ---------------------------------------------------------------------------------------------------- depth images

/// The least float that is not below a number.
float not_below(double number) {
    const auto nearest = static_cast<float>(number);
    return nearest < number ? std::nextafter(nearest, std::numeric_limits<float>::infinity()) : nearest;
}

/// Plain rows without branches, so that the compiler makes vectors of them.
cv::Mat1f without_invalid(const cv::Mat1f& depth_m, const ProjectOptions& options) {
    const float near_m = not_below(options.near_m), far_m = -not_below(-options.far_m);
    const auto good = [&](float z) { return (z == 0) | ((z >= near_m) & (z <= far_m)); }; // false for NaN
    int bad = 0;
    for (int v = 0; v < depth_m.rows; ++v) {
        const float* row = depth_m[v];
        for (int u = 0; u < depth_m.cols; ++u)
            bad |= !good(row[u]);
    }
    if (!bad)
        return depth_m;
    cv::Mat1f clean(depth_m.size());
    for (int v = 0; v < depth_m.rows; ++v) {
        const float* from = depth_m[v];
        float* to = clean[v];
        for (int u = 0; u < depth_m.cols; ++u)
            to[u] = good(from[u]) ? from[u] : 0;
    }
    return clean;
}

/// Depth between four pixels of one surface: linear in 1/z, as planes are. 0 where the four do not belong to one
/// surface.
float depth_between(const cv::Mat1f& depth_m, const cv::Vec2f& at, float nearest_m, double same_m) {
    const int u = static_cast<int>(std::floor(at[0])), v = static_cast<int>(std::floor(at[1]));
    if (u < 0 || v < 0 || u + 1 >= depth_m.cols || v + 1 >= depth_m.rows)
        return 0;
    const double right = double{at[0]} - u, down = double{at[1]} - v;
    double inverse = 0;
    for (const auto& [du, dv, weight] : {std::tuple(0, 0, (1 - right) * (1 - down)),
                                         {1, 0, right * (1 - down)},
                                         {0, 1, (1 - right) * down},
                                         {1, 1, right * down}}) {
        const float z = depth_m(v + dv, u + du);
        if (!(z > 0) || std::abs(z - nearest_m) > same_m)
            return 0;
        inverse += weight / z;
    }
    return static_cast<float>(1 / inverse);
}

/// Interpolated depth within a surface, since repeated and skipped pixels would make terraces; the nearest pixel's
/// depth at the border of a surface.
DepthImage without_distortion(const cv::Mat1f& depth_m, const Camera& camera, const ProjectOptions& options) {
    const auto maps = Undistortion::of(camera);
    cv::Mat1f z_m(maps->straight_camera().size, 0.0F);
    for (int v = 0; v < z_m.rows; ++v)
        for (int u = 0; u < z_m.cols; ++u) {
            const int pixel = maps->recorded_pixel()(v, u);
            if (pixel < 0)
                continue;
            const float nearest_m = depth_m(pixel / depth_m.cols, pixel % depth_m.cols);
            if (!in_range(nearest_m, options))
                continue;
            const float between_m =
                depth_between(depth_m, maps->recorded_at()(v, u), nearest_m, same_surface_m(camera.pinhole, nearest_m));
            z_m(v, u) = between_m > 0 ? between_m : nearest_m;
        }
    return {maps->straight_camera(), z_m, {}, depth_m};
}

// ---------------------------------------------------------------------------------------------------- clouds

/// Whether every point in range projects to within half a pixel of its grid cell.
bool lies_on_grid(const Cloud& cloud, const Pinhole& camera, const ProjectOptions& options) {
    if (!cloud.organised() || cloud.grid != camera.size)
        return false;
    for (int row = 0, i = 0; row < cloud.grid.height; ++row)
        for (int column = 0; column < cloud.grid.width; ++column, ++i) {
            const Eigen::Vector3d& p = cloud.points[i];
            if (in_range(p.z(), options) && !(std::abs(camera.fx * p.x() / p.z() + camera.cx - column) < 0.5 &&
                                              std::abs(camera.fy * p.y() / p.z() + camera.cy - row) < 0.5))
                return false;
        }
    return true;
}

DepthImage keep_grid(const Cloud& cloud, const Pinhole& camera, const ProjectOptions& options) {
    DepthImage view{camera, cv::Mat1f(camera.size, 0.0F), cv::Mat1i(camera.size, -1)};
    float* z_m = view.z_m.ptr<float>();
    int* source = view.source.ptr<int>();
    for (std::size_t i = 0; i < cloud.points.size(); ++i)
        if (const double z = cloud.points[i].z(); in_range(z, options)) {
            z_m[i] = static_cast<float>(z);
            source[i] = static_cast<int>(i);
        }
    return view;
}

DepthImage splat(const Cloud& cloud, const Pinhole& camera, const ProjectOptions& options) {
    DepthImage view{camera, cv::Mat1f(camera.size, 0.0F), cv::Mat1i(camera.size, -1)};
    for (std::size_t i = 0; i < cloud.points.size(); ++i) {
        const Eigen::Vector3d& point = cloud.points[i];
        if (!in_range(point.z(), options))
            continue;
        const double u = std::round(camera.fx * point.x() / point.z() + camera.cx);
        const double v = std::round(camera.fy * point.y() / point.z() + camera.cy);
        if (!(u >= 0 && u < camera.size.width && v >= 0 && v < camera.size.height))
            continue;
        const cv::Point pixel(static_cast<int>(u), static_cast<int>(v));
        float& nearest = view.z_m(pixel);
        if (const auto z = static_cast<float>(point.z()); nearest == 0 || z < nearest) {
            nearest = z;
            view.source(pixel) = static_cast<int>(i);
        }
    }
    return view;
}

/// The median of the front layer of the 3x3 neighbours; {-1, -1} where the layer has fewer than three. A pixel just
/// outside a straight silhouette has at most three, so outlines hardly grow.
cv::Point middle_of_front(const DepthImage& view, cv::Point centre) {
    std::array<std::pair<float, cv::Point>, 8> seen;
    std::size_t count = 0;
    for (int v = std::max(centre.y - 1, 0); v <= std::min(centre.y + 1, view.z_m.rows - 1); ++v)
        for (int u = std::max(centre.x - 1, 0); u <= std::min(centre.x + 1, view.z_m.cols - 1); ++u)
            if (const cv::Point pixel(u, v); pixel != centre && view.z_m(pixel) > 0)
                seen[count++] = {view.z_m(pixel), pixel};
    const auto by_depth = [](const auto& a, const auto& b) { return a.first < b.first; };
    std::stable_sort(seen.begin(), seen.begin() + count, by_depth);
    std::size_t front = 0;
    while (front < count && seen[front].first <= seen[0].first + same_surface_m(view.camera, seen[0].first))
        ++front;
    return front >= 3 ? seen[front / 2].second : cv::Point(-1, -1);
}

/// At one point per pixel, 1/e of a surface's pixels stay empty by chance and show the surface behind. Such pixels take
/// a neighbour of the surface in front.
DepthImage without_gaps(const DepthImage& sparse) {
    DepthImage view{sparse.camera, sparse.z_m.clone(), sparse.source.clone()};
    for (int v = 0; v < view.z_m.rows; ++v)
        for (int u = 0; u < view.z_m.cols; ++u) {
            const cv::Point pixel(u, v), front = middle_of_front(sparse, pixel);
            if (front.x < 0)
                continue;
            const float own = sparse.z_m(pixel), z = sparse.z_m(front);
            if (own > 0 && own <= z + same_surface_m(view.camera, z))
                continue;
            view.z_m(pixel) = z;
            view.source(pixel) = sparse.source(front);
        }
    return view;
}

DepthImage project_cloud(const Cloud& cloud, const Pinhole& camera, const ProjectOptions& options) {
    if (lies_on_grid(cloud, camera, options))
        return keep_grid(cloud, camera, options);
    DepthImage view = splat(cloud, camera, options);
    return cloud.organised() || cloud.pixels_of_one_image ? view : without_gaps(view);
}

} // namespace

Camera camera_of(const Frame& frame) {
    if (frame.cloud) {
        if (frame.cloud->points.empty())
            throw Error("the cloud holds no points");
        if (frame.cloud->points.size() != static_cast<std::size_t>(frame.cloud->grid.area()))
            throw Error(fmt::format("the cloud's grid is {}x{}, but it holds {} points", frame.cloud->grid.width,
                                    frame.cloud->grid.height, frame.cloud->points.size()));
        return camera_of_cloud(frame);
    }
    if (frame.depth_m.empty())
        throw Error("the frame holds neither depth nor points");
    return camera_of_image(frame);
}

DepthImage project(const Frame& frame, const ProjectOptions& options) {
    const Camera camera = camera_of(frame);
    if (frame.cloud)
        return project_cloud(*frame.cloud, camera.pinhole, options);
    if (camera.distortion.any())
        return without_distortion(frame.depth_m, camera, options);
    return {camera.pinhole, without_invalid(frame.depth_m, options), {}};
}

} // namespace scanshade
