// A cloud as a surface for rays: neighbours by Embree's point queries, planes through them, discs.
#include "ao/raycast/point_surface.h"

#include "ao/raycast/embree.h"
#include "projection/base/statistics.h"

#include <algorithm>
#include <Eigen/Eigenvalues>
#include <tbb/parallel_for.h>

namespace scanshade {
namespace {

using Eigen::Vector3d, Eigen::Vector3f;

/// The nearest neighbours of a point, nearest first, without the point itself.
struct Neighbourhood {
    struct Neighbour {
        float distance;
        unsigned point;
        bool operator<(const Neighbour& other) const {
            return distance != other.distance ? distance < other.distance : point < other.point;
        }
    };
    static constexpr std::size_t wanted = 20;
    std::vector<Neighbour> nearest;
};

/// Finds neighbours among points in coordinates relative to their middle.
class PointTree {
  public:
    explicit PointTree(std::vector<Vector3f> points)
        : points_(std::move(points)), scene_(rtcNewScene(embree_device())) {
        const RTCGeometry geometry = rtcNewGeometry(embree_device(), RTC_GEOMETRY_TYPE_USER);
        rtcSetGeometryUserPrimitiveCount(geometry, static_cast<unsigned>(points_.size()));
        rtcSetGeometryUserData(geometry, this);
        rtcSetGeometryBoundsFunction(geometry, bounds, nullptr);
        rtcCommitGeometry(geometry);
        rtcAttachGeometry(scene_, geometry);
        rtcReleaseGeometry(geometry);
        rtcCommitScene(scene_);
    }
    ~PointTree() { rtcReleaseScene(scene_); }
    PointTree(const PointTree&) = delete;
    PointTree& operator=(const PointTree&) = delete;

    [[nodiscard]] const Vector3f& operator[](std::size_t i) const { return points_[i]; }

    void find_round(unsigned point, Neighbourhood& found) const {
        found.nearest.clear();
        Search search{*this, point, found};
        RTCPointQuery query{};
        const Vector3f& at = points_[point];
        query.x = at.x(), query.y = at.y(), query.z = at.z();
        query.radius = std::numeric_limits<float>::infinity();
        RTCPointQueryContext context;
        rtcInitPointQueryContext(&context);
        rtcPointQuery(scene_, &query, &context, visit, &search);
        std::sort_heap(found.nearest.begin(), found.nearest.end());
    }

  private:
    struct Search {
        const PointTree& tree;
        unsigned centre;
        Neighbourhood& found;
    };

    static void bounds(const RTCBoundsFunctionArguments* arguments) {
        const auto& tree = *static_cast<const PointTree*>(arguments->geometryUserPtr);
        const Vector3f& p = tree.points_[arguments->primID];
        RTCBounds& box = *arguments->bounds_o;
        box.lower_x = box.upper_x = p.x();
        box.lower_y = box.upper_y = p.y();
        box.lower_z = box.upper_z = p.z();
    }

    /// Keeps the nearest in a heap, the farthest of them on top; once it is full, the search shrinks to its reach.
    static bool visit(RTCPointQueryFunctionArguments* arguments) {
        auto& [tree, centre, found] = *static_cast<Search*>(arguments->userPtr);
        if (arguments->primID == centre)
            return false;
        auto& heap = found.nearest;
        heap.push_back({(tree.points_[arguments->primID] - tree.points_[centre]).norm(), arguments->primID});
        std::push_heap(heap.begin(), heap.end());
        if (heap.size() <= Neighbourhood::wanted)
            return false;
        std::pop_heap(heap.begin(), heap.end());
        heap.pop_back();
        arguments->query->radius = heap.front().distance * (1 + 1e-6F); // ties are settled by index, not by order
        return true;
    }

    std::vector<Vector3f> points_;
    RTCScene scene_;
};

/// The normal of the least-squares plane; none where the points have none.
Vector3d plane_normal(const PointTree& tree, unsigned point, const Neighbourhood& around) {
    Vector3d mean = tree[point].cast<double>();
    for (const auto& n : around.nearest)
        mean += tree[n.point].cast<double>();
    mean /= static_cast<double>(around.nearest.size() + 1);
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
    const auto add = [&](const Vector3d& offset) { spread += offset * offset.transpose(); };
    add(tree[point].cast<double>() - mean);
    for (const auto& n : around.nearest)
        add(tree[n.point].cast<double>() - mean);
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(spread);
    const bool flat = axes.eigenvalues()[1] > 1e-6 * axes.eigenvalues()[2]; // else they are on a line
    return flat ? Vector3d(axes.eigenvectors().col(0)) : Vector3d::Zero();
}

Vector3d towards_origin(const Vector3d& point) {
    const double distance = point.norm();
    return distance > 0 ? Vector3d(-point / distance) : Vector3d(0, 0, -1);
}

void clamp_radii(std::vector<Disc>& discs) {
    std::vector<double> radii;
    for (const Disc& disc : discs)
        if (disc.radius_m > 0)
            radii.push_back(disc.radius_m);
    if (radii.empty())
        return;
    const double usual = median(std::move(radii));
    for (Disc& disc : discs)
        if (disc.centre.allFinite())
            disc.radius_m = std::clamp(disc.radius_m, 0.5 * usual, 3 * usual);
}

} // namespace

std::vector<Disc> discs_of(std::span<const Vector3d> points, std::span<const Vector3d> normals) {
    std::vector<Disc> discs(points.size());
    std::vector<std::size_t> valid;
    Vector3d middle = Vector3d::Zero();
    for (std::size_t i = 0; i < points.size(); ++i) {
        discs[i] = {points[i], Vector3d::Zero(), 0};
        if (points[i].allFinite()) {
            valid.push_back(i);
            middle += points[i];
        }
    }
    if (valid.empty())
        return discs;
    middle /= static_cast<double>(valid.size());
    std::vector<Vector3f> local;
    for (const std::size_t i : valid)
        local.push_back((points[i] - middle).cast<float>());
    const PointTree tree(std::move(local));
    tbb::parallel_for(std::size_t(0), valid.size(), [&](std::size_t k) {
        thread_local Neighbourhood around;
        tree.find_round(static_cast<unsigned>(k), around);
        Disc& disc = discs[valid[k]];
        constexpr std::size_t sixth = 5;
        if (!around.nearest.empty())
            disc.radius_m =
                1.2 * static_cast<double>(around.nearest[std::min(sixth, around.nearest.size() - 1)].distance);
        if (!normals.empty() && normals[valid[k]].allFinite() && normals[valid[k]].norm() > 0.1) {
            disc.normal = normals[valid[k]].normalized();
            return;
        }
        disc.normal =
            around.nearest.size() < 2 ? Vector3d::Zero() : plane_normal(tree, static_cast<unsigned>(k), around);
        const Vector3d to_sensor = towards_origin(disc.centre);
        if (disc.normal.isZero())
            disc.normal = to_sensor;
        else if (disc.normal.dot(to_sensor) < 0)
            disc.normal = -disc.normal;
    });
    clamp_radii(discs);
    return discs;
}

} // namespace scanshade
