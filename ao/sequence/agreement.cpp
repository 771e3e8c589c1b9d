#include "ao/sequence/agreement.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

namespace scanshade {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

constexpr int apart_px = 12; // of the pixels looked at

/// A packed pixel (shaders/lib/surfel.glsl); depth 0 = hole.
struct Surface {
    Vector3d point, normal;
    [[nodiscard]] bool known() const { return point.z() > 0; }
};

Surface surface_at(const PackedSurfaces& surfaces, int u, int v) {
    const cv::Vec2i word = surfaces.words(v, u);
    const Pinhole& camera = surfaces.camera;
    const double z = std::bit_cast<float>(word[0]);
    const auto byte = [&](int shift) { return static_cast<double>(static_cast<std::int8_t>(word[1] >> shift)) / 127; };
    return {{(u - camera.cx) / camera.fx * z, (v - camera.cy) / camera.fy * z, z}, {byte(24), byte(16), byte(8)}};
}

/// A point of the one frame, and the plane of the other that it meets or misses.
struct Meeting {
    Vector3d point, normal; ///< here
    double distance_m;      ///< from the plane, towards the camera
    double tolerable_m;
    bool meets, hides;
};

std::vector<Meeting> meetings(const Pair& pair, const Isometry3d& here_from_there) {
    std::vector<Meeting> all;
    const Pinhole& camera = pair.here.camera;
    for (int v = apart_px / 2; v < pair.there.words.rows; v += apart_px)
        for (int u = apart_px / 2; u < pair.there.words.cols; u += apart_px) {
            const Surface there = surface_at(pair.there, u, v);
            const Vector3d point = here_from_there * there.point;
            if (!there.known() || point.z() <= 1e-3 * pair.radius_m)
                continue;
            const double x = camera.fx * point.x() / point.z() + camera.cx, y = camera.fy * point.y() / point.z() + camera.cy;
            if (!(x > -0.5 && y > -0.5 && x < pair.here.words.cols - 0.5 && y < pair.here.words.rows - 0.5))
                continue;
            const Surface here = surface_at(pair.here, cvRound(x), cvRound(y));
            if (!here.known())
                continue;
            const double distance = here.normal.dot(point - here.point), sigma = pair.noise.at(point.z());
            const double gate = 0.1 * pair.radius_m + 4 * sigma;
            const bool alike = here.normal.dot(here_from_there.linear() * there.normal) > 0.7;
            all.push_back({point, here.normal, distance, 0.02 * pair.radius_m + sigma, alike && std::abs(distance) < gate,
                           point.z() < here.point.z() - gate && distance > gate});
        }
    return all;
}

/// What the share of them stays below.
double quantile(std::vector<double>& values, double share) {
    const auto rank = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), rank, values.end());
    return *rank;
}

/// Distances of the planes that meet, in what is tolerable or in metres.
std::vector<double> misfits(const std::vector<Meeting>& all, bool in_metres = false) {
    std::vector<double> values;
    for (const Meeting& each : all)
        if (each.meets)
            values.push_back(std::abs(each.distance_m) / (in_metres ? 1 : each.tolerable_m));
    return values;
}

Isometry3d moved(const Eigen::Matrix<double, 6, 1>& by) {
    Isometry3d motion = Isometry3d::Identity();
    const Vector3d turn = by.head<3>();
    if (turn.norm() > 0)
        motion.linear() = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
    motion.translation() = by.tail<3>();
    return motion;
}

} // namespace

Agreement agreement(const Pair& pair, const Isometry3d& here_from_there) {
    const std::vector<Meeting> all = meetings(pair, here_from_there);
    std::vector<double> values = misfits(all), metres = misfits(all, true);
    if (values.empty())
        return {};
    const double met = static_cast<double>(values.size());
    const auto hiding = static_cast<double>(std::ranges::count(all, true, &Meeting::hides));
    const double looked_at = static_cast<double>(pair.there.words.total()) / (apart_px * apart_px);
    return {met / looked_at, hiding / (met + hiding), quantile(metres, 0.9), quantile(values, 0.5)};
}

Isometry3d aligned(const Pair& pair, const Isometry3d& here_from_there) {
    using Matrix6d = Eigen::Matrix<double, 6, 6>;
    using Vector6d = Eigen::Matrix<double, 6, 1>;
    constexpr int rounds = 6;
    constexpr double turn_sigma = 0.5 * std::numbers::pi / 180, shift_sigma_m = 0.02; // poses err so much before all is said
    Vector6d prior;
    prior << Vector3d::Constant(1 / (turn_sigma * turn_sigma)), Vector3d::Constant(1 / (shift_sigma_m * shift_sigma_m));
    Vector6d whole = Vector6d::Zero();
    for (int round = 0; round < rounds; ++round) {
        const std::vector<Meeting> all = meetings(pair, moved(whole) * here_from_there);
        std::vector<double> values = misfits(all);
        if (values.size() < 30)
            return here_from_there;
        const double limit = std::max(3 * quantile(values, 0.5), 0.3);
        // A point's error is that of its patch, not of one pixel among many: a hundredth of them count as independent.
        Matrix6d normal_matrix = prior.asDiagonal();
        Vector6d gradient = prior.cwiseProduct(whole);
        for (const Meeting& each : all) {
            const double miss = each.distance_m / each.tolerable_m / limit;
            if (!each.meets || std::abs(miss) >= 1)
                continue;
            const double weight = 0.1 * (1 - miss * miss) * (1 - miss * miss) / (each.tolerable_m * each.tolerable_m);
            Vector6d slope;
            slope << each.point.cross(each.normal), each.normal;
            normal_matrix += weight * slope * slope.transpose();
            gradient += weight * each.distance_m * slope;
        }
        const Vector6d step = normal_matrix.ldlt().solve(-gradient);
        whole += step;
        if (step.head<3>().norm() < 1e-5 && step.tail<3>().norm() < 1e-5)
            break;
    }
    const Isometry3d better = moved(whole) * here_from_there;
    return agreement(pair, better).misfit < agreement(pair, here_from_there).misfit ? better : here_from_there;
}

} // namespace scanshade
