// Geometry recentred in double precision, passed to Embree in single precision.
#include "ao/raycast/ray_surface.h"

#include "ao/raycast/embree.h"
#include "projection/base/error.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <Eigen/Geometry>
#include <fmt/format.h>
#include <limits>

namespace scanshade {
namespace {

using Eigen::Vector3d, Eigen::Vector3f;

/// Narrower triangles have no usable plane in single precision.
bool has_area(const Vector3d& a, const Vector3d& b, const Vector3d& c) {
    constexpr double least_area_m2 = 1e-12, least_height_m = 1e-6;
    const double longest = std::max({(b - a).norm(), (c - b).norm(), (a - c).norm()});
    const double twice_area = (b - a).cross(c - a).norm();
    return twice_area / 2 >= least_area_m2 && twice_area >= least_height_m * longest;
}

struct Extent {
    Vector3d low = Vector3d::Constant(std::numeric_limits<double>::infinity());
    Vector3d high = -low;

    void add(const Vector3d& point) {
        low = low.cwiseMin(point);
        high = high.cwiseMax(point);
    }
    [[nodiscard]] bool any() const { return (low.array() <= high.array()).all(); }
};

} // namespace

double rounding_at(float farthest) {
    return 64.0 * (std::nextafter(farthest, std::numeric_limits<float>::infinity()) - farthest);
}

RTCDevice embree_device() {
    static const RTCDevice opened = [] {
        const RTCDevice made = rtcNewDevice(nullptr);
        if (!made)
            throw Error(fmt::format("Embree cannot be used on this processor (error {})",
                                    static_cast<int>(rtcGetDeviceError(nullptr))));
        return made;
    }();
    return opened;
}

namespace {

/// The start of a cast; Embree passes it to the filter.
struct CastContext {
    EmbreeContext embree;
    OwnSurface own;

    explicit CastContext(const OwnSurface& own_surface) : own(own_surface) { init(embree); }
};
static_assert(offsetof(CastContext, embree) == 0, "Embree's pointer to its context is a pointer to ours");

/// Lets rays pass the discs that belong to the surface they start from.
void pass_own_surface(const RTCFilterFunctionNArguments* arguments) {
    const auto& own = reinterpret_cast<const CastContext*>(arguments->context)->own;
    const unsigned n = arguments->N;
    for (unsigned i = 0; i < n; ++i) {
        if (arguments->valid[i] == 0)
            continue;
        RTCRayN* ray = arguments->ray;
        const float t = RTCRayN_tfar(ray, n, i);
        if (t >= own.reach_m)
            continue;
        const Vector3f met = Vector3f(RTCRayN_org_x(ray, n, i), RTCRayN_org_y(ray, n, i), RTCRayN_org_z(ray, n, i)) +
                             t * Vector3f(RTCRayN_dir_x(ray, n, i), RTCRayN_dir_y(ray, n, i), RTCRayN_dir_z(ray, n, i));
        RTCHitN* hit = arguments->hit;
        const Vector3f normal(RTCHitN_Ng_x(hit, n, i), RTCHitN_Ng_y(hit, n, i), RTCHitN_Ng_z(hit, n, i));
        if (std::abs(normal.dot(own.point - met)) <= own.depth_m * normal.norm())
            arguments->valid[i] = 0;
    }
}

} // namespace

struct RaySurface::Tree {
    RTCScene scene = nullptr;
    Vector3d middle = Vector3d::Zero();
    double rounding_m = 0;
    std::vector<int> index; ///< Embree's primitive -> as given

    Tree() : scene(rtcNewScene(embree_device())) { rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST); }
    ~Tree() { rtcReleaseScene(scene); }
    Tree(const Tree&) = delete;
    Tree& operator=(const Tree&) = delete;

    void centre_on(const Extent& extent) {
        if (!extent.any())
            return;
        middle = (extent.low + extent.high) / 2;
        rounding_m = rounding_at(static_cast<float>((extent.high - middle).maxCoeff()));
    }

    template <class Item>
    Item* buffer(RTCGeometry geometry, RTCBufferType type, RTCFormat format, std::size_t count) {
        void* const memory = rtcSetNewGeometryBuffer(geometry, type, 0, format, sizeof(Item), count);
        if (!memory)
            throw Error(fmt::format("no memory for {} items of geometry", count));
        return static_cast<Item*>(memory);
    }

    /// Passes the geometry to Embree and builds the tree.
    void finish(RTCGeometry geometry) {
        rtcSetGeometryMask(geometry, 0xffffffffU);
        rtcCommitGeometry(geometry);
        rtcAttachGeometry(scene, geometry);
        rtcReleaseGeometry(geometry);
        rtcCommitScene(scene);
        if (const RTCError error = rtcGetDeviceError(embree_device()); error != RTC_ERROR_NONE)
            throw Error(fmt::format("Embree cannot build its tree of {} items (error {})", index.size(),
                                    static_cast<int>(error)));
    }
};

RaySurface::RaySurface(const Mesh& mesh) : tree_(std::make_unique<Tree>()) {
    const int count = static_cast<int>(mesh.vertices.size());
    const auto vertex = [&](int i) { return mesh.vertices[static_cast<std::size_t>(i)]; };
    Extent extent;
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
        const auto& [a, b, c] = mesh.triangles[i];
        const bool known = std::min({a, b, c}) >= 0 && std::max({a, b, c}) < count;
        if (!known || !has_area(vertex(a), vertex(b), vertex(c))) // false for what is not finite
            continue;
        tree_->index.push_back(static_cast<int>(i));
        for (const int corner : {a, b, c})
            extent.add(vertex(corner));
    }
    tree_->centre_on(extent);
    if (tree_->index.empty())
        return;
    const RTCGeometry geometry = rtcNewGeometry(embree_device(), RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* places =
        tree_->buffer<std::array<float, 3>>(geometry, RTC_BUFFER_TYPE_VERTEX, RTC_FORMAT_FLOAT3, mesh.vertices.size());
    for (int i = 0; i < count; ++i) {
        const Vector3f at = vertex(i).allFinite() ? local(vertex(i)) : Vector3f(0, 0, 0);
        places[i] = {at.x(), at.y(), at.z()};
    }
    auto* corners =
        tree_->buffer<std::array<unsigned, 3>>(geometry, RTC_BUFFER_TYPE_INDEX, RTC_FORMAT_UINT3, tree_->index.size());
    for (std::size_t i = 0; i < tree_->index.size(); ++i) {
        const auto& [a, b, c] = mesh.triangles[static_cast<std::size_t>(tree_->index[i])];
        corners[i] = {static_cast<unsigned>(a), static_cast<unsigned>(b), static_cast<unsigned>(c)};
    }
    tree_->finish(geometry);
}

RaySurface::RaySurface(std::span<const Disc> discs) : tree_(std::make_unique<Tree>()) {
    Extent extent;
    for (std::size_t i = 0; i < discs.size(); ++i) {
        const Disc& disc = discs[i];
        if (!(disc.centre.allFinite() && disc.normal.allFinite() && disc.radius_m > 0))
            continue;
        tree_->index.push_back(static_cast<int>(i));
        extent.add(disc.centre);
    }
    tree_->centre_on(extent);
    if (tree_->index.empty())
        return;
    const RTCGeometry geometry = rtcNewGeometry(embree_device(), RTC_GEOMETRY_TYPE_ORIENTED_DISC_POINT);
    auto* places =
        tree_->buffer<std::array<float, 4>>(geometry, RTC_BUFFER_TYPE_VERTEX, RTC_FORMAT_FLOAT4, tree_->index.size());
    auto* normals =
        tree_->buffer<std::array<float, 3>>(geometry, RTC_BUFFER_TYPE_NORMAL, RTC_FORMAT_FLOAT3, tree_->index.size());
    for (std::size_t i = 0; i < tree_->index.size(); ++i) {
        const Disc& disc = discs[static_cast<std::size_t>(tree_->index[i])];
        const Vector3f at = local(disc.centre), normal = disc.normal.cast<float>();
        places[i] = {at.x(), at.y(), at.z(), static_cast<float>(disc.radius_m)};
        normals[i] = {normal.x(), normal.y(), normal.z()};
    }
    rtcSetGeometryOccludedFilterFunction(geometry, pass_own_surface);
    rtcSetGeometryIntersectFilterFunction(geometry, pass_own_surface);
    tree_->finish(geometry);
}

RaySurface::~RaySurface() = default;
RaySurface::RaySurface(RaySurface&&) noexcept = default;
RaySurface& RaySurface::operator=(RaySurface&&) noexcept = default;

Vector3f RaySurface::local(const Vector3d& point) const { return (point - tree_->middle).cast<float>(); }
double RaySurface::rounding_m() const { return tree_->rounding_m; }
bool RaySurface::empty() const { return tree_->index.empty(); }

namespace {

RTCRay ray_along(const Vector3f& origin, const Vector3f& direction, float near, float far) {
    RTCRay ray{};
    ray.org_x = origin.x(), ray.org_y = origin.y(), ray.org_z = origin.z();
    ray.dir_x = direction.x(), ray.dir_y = direction.y(), ray.dir_z = direction.z();
    ray.tnear = near, ray.tfar = far;
    ray.mask = 0xffffffffU;
    return ray;
}

/// Embree's eight rays of either kind from ours.
template <class Rays>
void fill(Rays& rays, const RayBundle& bundle) {
    for (int i = 0; i < RayBundle::size; ++i) {
        rays.org_x[i] = bundle.origin.x(), rays.org_y[i] = bundle.origin.y(), rays.org_z[i] = bundle.origin.z();
        rays.dir_x[i] = bundle.x[i], rays.dir_y[i] = bundle.y[i], rays.dir_z[i] = bundle.z[i];
        rays.tnear[i] = 0, rays.tfar[i] = bundle.far_m;
        rays.time[i] = 0, rays.mask[i] = 0xffffffffU, rays.flags[i] = 0;
    }
}

} // namespace

std::optional<RaySurface::Hit> RaySurface::nearest(const Vector3d& origin, const Vector3d& direction,
                                                   double near) const {
    if (empty())
        return std::nullopt;
    RTCRayHit sought{};
    sought.ray = ray_along(local(origin), direction.cast<float>(), static_cast<float>(near),
                           std::numeric_limits<float>::infinity());
    sought.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    CastContext context({});
    intersect(tree_->scene, context.embree, sought);
    if (sought.hit.geomID == RTC_INVALID_GEOMETRY_ID)
        return std::nullopt;
    return Hit{sought.ray.tfar, tree_->index[sought.hit.primID]};
}

bool RaySurface::blocked(const Vector3d& from, const Vector3d& to) const {
    constexpr float clear_of_ends = 1e-6F;
    if (empty())
        return false;
    RTCRay ray = ray_along(local(from), (to - from).cast<float>(), clear_of_ends, 1 - clear_of_ends);
    CastContext context({});
    occluded(tree_->scene, context.embree, ray);
    return ray.tfar < 0;
}

void RaySurface::drop_blocked(RayBundle& bundle) const {
    if (empty())
        return;
    RTCRay8 rays;
    fill(rays, bundle);
    CastContext context(bundle.own);
    occluded(bundle.live.data(), tree_->scene, context.embree, rays);
    for (int i = 0; i < RayBundle::size; ++i)
        if (rays.tfar[i] < 0)
            bundle.live[i] = 0;
}

RaySurface::Hits RaySurface::hits(const RayBundle& bundle) const {
    Hits found;
    found.distance.fill(std::numeric_limits<float>::infinity());
    found.primitive.fill(-1);
    if (empty())
        return found;
    RTCRayHit8 sought;
    fill(sought.ray, bundle);
    std::fill(std::begin(sought.hit.geomID), std::end(sought.hit.geomID), RTC_INVALID_GEOMETRY_ID);
    CastContext context(bundle.own);
    intersect(bundle.live.data(), tree_->scene, context.embree, sought);
    for (std::size_t i = 0; i < RayBundle::size; ++i)
        if (bundle.live[i] && sought.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID) {
            found.distance[i] = sought.ray.tfar[i];
            found.primitive[i] = tree_->index[sought.hit.primID[i]];
        }
    return found;
}

} // namespace scanshade
