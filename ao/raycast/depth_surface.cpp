// A depth image as a surface for rays.
#include "ao/raycast/depth_surface.h"

#include <algorithm>
#include <cmath>
#include <Eigen/Geometry>
#include <numbers>
#include <opencv2/core/utility.hpp>
#include <optional>

namespace scanshade {
namespace {

using Eigen::Vector3d;

/// Inverse depth by pixel; 0 is a hole and what lies outside.
class InverseDepth {
  public:
    InverseDepth(const cv::Mat1f& z_m, const DepthNoise& noise) : z_m_(z_m), noise_(noise) {}

    [[nodiscard]] double at(cv::Point p) const {
        if (p.x < 0 || p.y < 0 || p.x >= z_m_.cols || p.y >= z_m_.rows || !(z_m_(p) > 0))
            return 0;
        return 1.0 / static_cast<double>(z_m_(p));
    }

    /// Whether neighbours, diagonal ones included, lie on one surface.
    [[nodiscard]] bool joined(cv::Point a, cv::Point b) const {
        const double w_a = at(a), w_b = at(b);
        if (w_a == 0 || w_b == 0)
            return false;
        const double z = std::min(1 / w_a, 1 / w_b);
        const double tolerance = std::max(3 * std::numbers::sqrt2 * noise_.at(z) / (z * z), 0.01 / z);
        if (std::abs(w_b - w_a) <= tolerance)
            return true;
        const auto continues = [&](cv::Point before, double from, double to) {
            const double w = at(before);
            return w > 0 && std::abs(to - (2 * from - w)) <= tolerance;
        };
        return continues(a - (b - a), w_a, w_b) || continues(b + (b - a), w_b, w_a);
    }

  private:
    const cv::Mat1f& z_m_;
    const DepthNoise& noise_;
};

/// Collects the triangles of one depth image.
class Weaver {
  public:
    Weaver(const DepthImage& depth, const DepthNoise& noise, double thickness_m)
        : depth_(depth), inverse_(depth.z_m, noise), thickness_m_(thickness_m) {
        mesh_.vertices.reserve(depth.z_m.total());
        for (int v = 0; v < depth.z_m.rows; ++v)
            for (int u = 0; u < depth.z_m.cols; ++u)
                mesh_.vertices.push_back(depth.camera.point(u, v, static_cast<double>(depth.z_m(v, u))));
    }

    void add_block(int u, int v) {
        const cv::Point a(u, v), b(u + 1, v), c(u + 1, v + 1), d(u, v + 1);
        const double w_a = inverse_.at(a), w_b = inverse_.at(b), w_c = inverse_.at(c), w_d = inverse_.at(d);
        const double nearest_m = 1 / std::max({w_a, w_b, w_c, w_d});
        const bool falling = w_a > 0 && w_c > 0; // which diagonal there is, or bends less
        if (falling && !(w_b > 0 && w_d > 0 && std::abs(w_b - w_d) < std::abs(w_a - w_c))) {
            add({a, b, c}, nearest_m);
            add({a, c, d}, nearest_m);
        } else {
            add({a, b, d}, nearest_m);
            add({b, c, d}, nearest_m);
        }
    }

    [[nodiscard]] Mesh mesh() && {
        if (thickness_m_ > 0)
            hang_curtains();
        if (thickness_m_ > 0 && thickness_m_ < depth_range()) // else it lies behind everything
            add_back();
        return std::move(mesh_);
    }

  private:
    void add(const std::array<cv::Point, 3>& corners, double nearest_m) {
        if (std::any_of(corners.begin(), corners.end(), [&](cv::Point p) { return inverse_.at(p) == 0; }))
            return;
        const auto& [a, b, c] = corners;
        if (inverse_.joined(a, b) && inverse_.joined(b, c) && inverse_.joined(c, a))
            mesh_.triangles.push_back({index(a), index(b), index(c)});
        else if (thickness_m_ > 0)
            curtains_.push_back({hung(a, nearest_m), hung(b, nearest_m), hung(c, nearest_m)});
    }

    [[nodiscard]] double depth_range() const {
        double nearest = 0, farthest = 0;
        cv::minMaxLoc(depth_.z_m, &nearest, &farthest, nullptr, nullptr, depth_.z_m > 0);
        return farthest - nearest;
    }

    void hang_curtains() { mesh_.triangles.insert(mesh_.triangles.end(), curtains_.begin(), curtains_.end()); }

    /// The sheet once more behind itself.
    void add_back() {
        const int first = static_cast<int>(mesh_.vertices.size());
        for (int v = 0; v < depth_.z_m.rows; ++v)
            for (int u = 0; u < depth_.z_m.cols; ++u)
                mesh_.vertices.push_back(
                    depth_.camera.point(u, v, static_cast<double>(depth_.z_m(v, u)) + thickness_m_));
        const std::size_t front = mesh_.triangles.size() - curtains_.size();
        for (std::size_t i = 0; i < front; ++i) {
            const auto [a, b, c] = mesh_.triangles[i];
            mesh_.triangles.push_back({first + a, first + b, first + c});
        }
    }

    [[nodiscard]] int index(cv::Point p) const { return p.y * depth_.z_m.cols + p.x; }

    /// The pixel's vertex, or one on its ray where a curtain from the nearest depth ends.
    int hung(cv::Point p, double nearest_m) {
        const double z = static_cast<double>(depth_.z_m(p)), end = nearest_m + thickness_m_;
        if (z <= end)
            return index(p);
        mesh_.vertices.push_back(depth_.camera.point(p.x, p.y, end));
        return static_cast<int>(mesh_.vertices.size()) - 1;
    }

    const DepthImage& depth_;
    InverseDepth inverse_;
    double thickness_m_;
    Mesh mesh_;
    std::vector<std::array<int, 3>> curtains_;
};

// ---------------------------------------------------------------------------------------------------- normals

/// Direction of the surface along one image axis, by the better of both neighbours; none where neither will do.
class Tangents {
  public:
    explicit Tangents(const DepthImage& depth) : depth_(depth), inverse_(depth.z_m, clean_) {}

    [[nodiscard]] std::optional<Vector3d> along(cv::Point p, cv::Point axis, double focal) const {
        const double w = inverse_.at(p);
        cv::Point best;
        double least = 2;
        for (const cv::Point step : {axis, -axis})
            if (const double one = inverse_.at(p + step), two = inverse_.at(p + step * 2); one > 0 && two > 0) {
                const double bend = std::abs(2 * one - two - w) / w * focal;
                if (bend < least)
                    least = bend, best = step;
            }
        if (best == cv::Point())
            best = gentler(p, axis, focal);
        if (best == cv::Point())
            return std::nullopt;
        const Vector3d tangent = point(p + best) - point(p);
        return best == axis ? tangent : Vector3d(-tangent);
    }

    [[nodiscard]] Vector3d point(cv::Point p) const {
        return depth_.camera.point(p.x, p.y, static_cast<double>(depth_.z_m(p)));
    }

  private:
    /// The neighbour of smaller slope, if under 30.
    [[nodiscard]] cv::Point gentler(cv::Point p, cv::Point axis, double focal) const {
        const double z = 1 / inverse_.at(p);
        cv::Point best;
        double least = 30;
        for (const cv::Point step : {axis, -axis})
            if (const double w = inverse_.at(p + step); w > 0)
                if (const double slope = std::abs(1 / w - z) * focal / z; slope < least)
                    least = slope, best = step;
        return best;
    }

    const DepthImage& depth_;
    DepthNoise clean_;
    InverseDepth inverse_;
};

Vector3d normal_at(const Tangents& tangents, const Pinhole& camera, cv::Point p) {
    Vector3d to_eye = -tangents.point(p).normalized();
    std::optional<Vector3d> first, second; // rows and columns; beside holes diagonals stand in
    for (const cv::Point axis : {cv::Point(1, 0), cv::Point(0, 1), cv::Point(1, 1), cv::Point(1, -1)})
        if (auto tangent = tangents.along(p, axis, axis.x ? camera.fx : camera.fy); tangent && !second)
            (first ? second : first) = tangent;
    Vector3d normal = to_eye;
    if (first && second)
        normal = second->cross(*first);
    else if (first) // as far towards the camera as the one tangent allows: wires
        normal = to_eye - first->dot(to_eye) / first->squaredNorm() * *first;
    const double length = normal.norm();
    if (!(length > 0))
        return to_eye;
    return normal.dot(to_eye) < 0 ? Vector3d(-normal / length) : Vector3d(normal / length);
}

} // namespace

Mesh surface_of(const DepthImage& depth, const DepthNoise& noise, double thickness_m) {
    Weaver weaver(depth, noise, thickness_m);
    for (int v = 0; v + 1 < depth.z_m.rows; ++v)
        for (int u = 0; u + 1 < depth.z_m.cols; ++u)
            weaver.add_block(u, v);
    return std::move(weaver).mesh();
}

NormalImage normals_of(const DepthImage& depth) {
    NormalImage image{cv::Mat3f(depth.z_m.size(), cv::Vec3f(0, 0, 0))};
    const Tangents tangents(depth);
    for (int v = 0; v < depth.z_m.rows; ++v)
        for (int u = 0; u < depth.z_m.cols; ++u)
            if (depth.z_m(v, u) > 0) {
                const Eigen::Vector3f normal = normal_at(tangents, depth.camera, {u, v}).cast<float>();
                image.normals(v, u) = {normal.x(), normal.y(), normal.z()};
            }
    return image;
}

} // namespace scanshade
