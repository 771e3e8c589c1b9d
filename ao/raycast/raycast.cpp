// Ray casting: geometry from what is given, then the same rays everywhere.
#include "ao/raycast/raycast.h"

#include "ao/gpu/image_upload.h"

#include "ao/base/watch.h"
#include "ao/raycast/depth_surface.h"
#include "ao/raycast/point_surface.h"
#include "projection/base/hash.h"

#include <algorithm>
#include <cmath>
#include <Eigen/Geometry>
#include <limits>
#include <numbers>
#include <optional>
#include <span>
#include <tbb/parallel_for.h>
#include <utility>

namespace scanshade {
namespace {

using Eigen::Vector3d;
constexpr float nothing = std::numeric_limits<float>::quiet_NaN();

constexpr std::array mesh_words{Named{"triangles", MeshRays::triangles}, Named{"vertices", MeshRays::vertices}};

RaycastOptions checked(RaycastOptions options) {
    for (const Parameter& row : options.parameters())
        check(row);
    return options;
}

Vector3d vector_of(const cv::Vec3f& v) { return Eigen::Vector3f(v[0], v[1], v[2]).cast<double>(); }

/// Depth and the given normals, brought to the host where they are on the device.
std::pair<DepthImage, cv::Mat3f> on_host(const Surfaces& surfaces, gpu::Device* device) {
    if (!surfaces.on_device())
        return {{surfaces.camera, surfaces.z_m, {}}, surfaces.normals};
    const cv::Size size = surfaces.camera.size;
    const auto image = [&](const std::shared_ptr<const gpu::DeviceBytes>& there, int type) {
        std::vector<std::byte> bytes = gpu::read_back(*device, there);
        return cv::Mat(size, type, bytes.data()).clone();
    };
    return {{surfaces.camera, image(surfaces.z_there, CV_32FC1), {}}, image(surfaces.normals_there, CV_32FC3)};
}

/// The given normals; the depth's own where there is none.
cv::Mat3f normals_for(const DepthImage& depth, const cv::Mat3f& given) {
    if (given.empty())
        return normals_of(depth).normals;
    cv::Mat3f normals = given.clone();
    std::optional<NormalImage> own;
    for (int v = 0; v < normals.rows; ++v)
        for (int u = 0; u < normals.cols; ++u) {
            const double length = cv::norm(normals(v, u));
            if (length > 0.5 && length < 2)
                continue;
            if (!own)
                own = normals_of(depth);
            normals(v, u) = own->normals(v, u);
        }
    return normals;
}

/// A triangle's plane: unit normal by the order of its corners, and where its middle is.
struct Face {
    Vector3d normal = Vector3d::Zero(), centroid = Vector3d::Zero();
    double area = 0; ///< 0: no triangle to speak of
};

Face face_of(std::span<const Vector3d> vertices, const std::array<int, 3>& triangle) {
    const auto known = [&](int i) { return i >= 0 && static_cast<std::size_t>(i) < vertices.size(); };
    if (!std::all_of(triangle.begin(), triangle.end(), known))
        return {};
    const auto at = [&](int corner) {
        return vertices[static_cast<std::size_t>(triangle[static_cast<std::size_t>(corner)])];
    };
    const Vector3d normal = (at(1) - at(0)).cross(at(2) - at(0));
    const double length = normal.norm();
    if (!(length > 0) || !std::isfinite(length))
        return {};
    return {normal / length, (at(0) + at(1) + at(2)) / 3, length / 2};
}

} // namespace

std::vector<Parameter> RaycastOptions::parameters() {
    return {
        {.name = "radius",
         .help = "surfaces farther away than this do not occlude",
         .value = &radius_m,
         .unit = "m",
         .low = 1e-6,
         .high = 1e6},
        {.name = "rays",
         .help = "rays per value; powers of two spread best, and the error falls as rays^-3/4. --dump writes each "
                 "value's standard error",
         .value = &rays,
         .low = 1,
         .high = 65536},
        {.name = "falloff",
         .help = "how much an occluder at distance t counts: hard 1, quad 1 - t^2 / R^2, lin (R - t) / (0.615 R)",
         .value = OneOf(&falloff, falloff_words)},
        {.name = "thickness",
         .help = "of depth images: how far surfaces reach behind their outlines; 0 = not at all, 1000 = up to what "
                 "lies behind",
         .value = &thickness_m,
         .unit = "m",
         .low = 0,
         .high = 1e6},
        {.name = "mesh",
         .help = "of meshes: rays from triangles, averaged to their vertices, or from vertices",
         .value = OneOf(&mesh, mesh_words)},
        {.name = "seed", .help = "scrambles the rays", .value = &seed, .low = 0, .high = 2147483647},
    };
}

Raycast::Raycast(RaycastOptions options)
    : options_(checked(std::move(options))), directions_(options_.rays, options_.seed) {}

/// Values of start_of(i) for i below count; where it returns none, NaN.
template <class StartOf>
std::vector<float> Raycast::cast(const RaySurface& surface, std::size_t count, StartOf&& start_of) {
    const RayHemisphere hemisphere(surface, directions_, options_.radius_m, options_.falloff != Falloff::hard);
    const auto kind = static_cast<std::size_t>(options_.falloff);
    std::vector<float> values(count, nothing);
    standard_error_.assign(count, nothing);
    tbb::parallel_for(std::size_t(0), count, [&](std::size_t i) {
        if (const std::optional<RayStart> start = start_of(i)) {
            const RayEstimate estimate = hemisphere.at(*start);
            values[i] = estimate.visibility[kind];
            standard_error_[i] = estimate.standard_error[kind];
        }
    });
    return values;
}

AoMap Raycast::compute(const View& view) {
    timings_.clear();
    Watch watch(timings_);
    check_sizes(view.surfaces);
    const auto [depth, given] = on_host(view.surfaces, device_);
    const Pinhole& camera = depth.camera;
    const cv::Mat1f& z_m = depth.z_m;
    const cv::Mat3f normals = normals_for(depth, given);
    watch.lap("normals");
    const RaySurface surface(surface_of(depth, view.noise, options_.thickness_m));
    watch.lap("tree");
    const auto width = static_cast<std::size_t>(z_m.cols);
    const auto values = cast(surface, z_m.total(), [&](std::size_t i) -> std::optional<RayStart> {
        const int u = static_cast<int>(i % width), v = static_cast<int>(i / width);
        const double z = static_cast<double>(z_m(v, u));
        if (!(z > 0))
            return std::nullopt;
        const Vector3d point = camera.point(u, v, z), normal = vector_of(normals(v, u)).normalized();
        const auto key = hash(static_cast<std::uint32_t>(u), static_cast<std::uint32_t>(v));
        return RayStart{point, normal, key, view.noise.at(z) * std::abs(normal.dot(point)) / z};
    });
    watch.lap("rays");
    size_ = z_m.size();
    return {cv::Mat1f(values, true).reshape(0, z_m.rows)};
}

std::vector<Intermediate> Raycast::intermediates() {
    if (standard_error_.empty())
        return {};
    const auto bytes = std::as_bytes(std::span(standard_error_));
    return {
        {"standard_error",
         "f4",
         size_.empty() ? std::vector{static_cast<int>(standard_error_.size())} : std::vector{size_.height, size_.width},
         {bytes.begin(), bytes.end()},
         "one standard error of each visibility; NaN where there is none"}};
}

PointVisibility Raycast::compute(const PointSet& points, const std::optional<Vector3d>&) {
    size_ = {};
    PointVisibility found;
    found.visibility = points.triangles.empty() ? of_cloud(points) : of_mesh(points);
    found.radius = options_.radius_m;
    found.timings = timings_;
    return found;
}

std::vector<float> Raycast::of_cloud(const PointSet& points) {
    timings_.clear();
    Watch watch(timings_);
    const std::vector<Disc> discs = discs_of(points.points, points.normals);
    watch.lap("discs");
    const RaySurface surface{std::span(discs)};
    watch.lap("tree");
    const double slant = 0.5 * std::tan(10 * std::numbers::pi / 180); // neighbouring discs tilt by so much
    auto values = cast(surface, discs.size(), [&](std::size_t i) -> std::optional<RayStart> {
        const Disc& disc = discs[i];
        if (!disc.centre.allFinite())
            return std::nullopt;
        return RayStart{disc.centre, disc.normal, hash(static_cast<std::uint32_t>(i)), slant * disc.radius_m,
                        disc.radius_m};
    });
    watch.lap("rays");
    return values;
}

std::vector<float> Raycast::of_mesh(const PointSet& points) {
    timings_.clear();
    Watch watch(timings_);
    const auto& triangles = points.triangles;
    const RaySurface surface({{points.points.begin(), points.points.end()}, {triangles.begin(), triangles.end()}});
    watch.lap("tree");
    std::vector<Face> faces;
    std::vector<std::vector<Vector3d>> round_vertex(points.points.size());
    std::vector<Vector3d> vertex_normals(points.points.size(), Vector3d::Zero());
    for (const auto& triangle : triangles) {
        const Face& face = faces.emplace_back(face_of(points.points, triangle));
        if (face.area > 0)
            for (const int corner : triangle) {
                round_vertex[static_cast<std::size_t>(corner)].push_back(face.normal);
                vertex_normals[static_cast<std::size_t>(corner)] += face.area * face.normal;
            }
    }
    if (options_.mesh == MeshRays::vertices) {
        auto values = cast(surface, points.points.size(), [&](std::size_t i) -> std::optional<RayStart> {
            const double length = vertex_normals[i].norm();
            if (!(length > 0))
                return std::nullopt;
            return RayStart{points.points[i], vertex_normals[i] / length, hash(static_cast<std::uint32_t>(i)), 0, 0,
                            round_vertex[i]};
        });
        watch.lap("rays");
        return values;
    }
    const auto of_face = cast(surface, faces.size(), [&](std::size_t i) -> std::optional<RayStart> {
        if (!(faces[i].area > 0))
            return std::nullopt;
        return RayStart{faces[i].centroid, faces[i].normal, hash(static_cast<std::uint32_t>(i))};
    });
    watch.lap("rays");
    const std::vector<float> error_of_face = std::exchange(standard_error_, {});
    std::vector<float> values(points.points.size(), 0.0F);
    standard_error_.assign(values.size(), 0.0F);
    std::vector<float> count(values.size(), 0.0F);
    for (std::size_t i = 0; i < triangles.size(); ++i)
        if (!std::isnan(of_face[i]))
            for (const int corner : triangles[i]) {
                const auto c = static_cast<std::size_t>(corner);
                values[c] += of_face[i];
                standard_error_[c] += error_of_face[i] * error_of_face[i];
                ++count[c];
            }
    for (std::size_t i = 0; i < values.size(); ++i) {
        values[i] = count[i] > 0 ? values[i] / count[i] : nothing;
        standard_error_[i] = count[i] > 0 ? std::sqrt(standard_error_[i]) / count[i] : nothing;
    }
    watch.lap("vertices");
    return values;
}

} // namespace scanshade
