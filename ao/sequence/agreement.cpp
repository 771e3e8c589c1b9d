#include "ao/sequence/agreement.h"

#include "projection/base/statistics.h"

#include <algorithm>
#include <cmath>
#include <Eigen/Eigenvalues>
#include <numbers>
#include <optional>
#include <tbb/parallel_for.h>

namespace scanshade {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

constexpr int apart_px = 12; // of the facets

/// The plane w = W + a x + b y in 1/z round a pixel, by least squares over 5x5 samples, twice: what is of another
/// surface has no say in the second round.
Facets::Facet facet_at(const DepthImage& depth, int u, int v, const DepthNoise& noise) {
    const double z = depth.z_m(v, u);
    if (!(z > 0))
        return {Vector3d::Zero(), Vector3d::Zero()};
    const Pinhole& camera = depth.camera;
    const double here = 1 / z, sigma = noise.at(z) * here * here;
    const double radius = std::clamp(
        std::sqrt(1.8 * noise.correlation_px * noise.correlation_px * noise.at(z) * camera.fx / z), 2.0, 12.0);
    Vector3d plane = Vector3d::Zero(); // a, b, offset from `here`
    for (int round = 0; round < 2; ++round) {
        const double limit = 4 * sigma + (round == 0 ? 0.7 * radius * here / camera.fx : 1e-3 * here);
        Eigen::Matrix3d products = Eigen::Matrix3d::Zero();
        Vector3d right = Vector3d::Zero();
        int used = 0;
        for (int j = -2; j <= 2; ++j)
            for (int i = -2; i <= 2; ++i) {
                const int x = cvRound(i * radius / 2), y = cvRound(j * radius / 2);
                if (u + x < 0 || v + y < 0 || u + x >= depth.z_m.cols || v + y >= depth.z_m.rows)
                    continue;
                const double other = depth.z_m(v + y, u + x);
                const Vector3d row(x, y, 1);
                if (!(other > 0) || std::abs(1 / other - here - row.dot(plane)) > limit)
                    continue;
                products += row * row.transpose();
                right += (1 / other - here) * row;
                ++used;
            }
        if (used < 10)
            return {Vector3d::Zero(), Vector3d::Zero()};
        plane = products.ldlt().solve(right);
    }
    const double w = here + plane.z(), fitted = 1 / w;
    const Vector3d normal(camera.fx * plane.x(), camera.fy * plane.y(),
                          w - plane.x() * (u - camera.cx) - plane.y() * (v - camera.cy));
    if (!(w > 0) || std::abs(plane.z()) > 4 * sigma + 1e-3 * here)
        return {Vector3d::Zero(), Vector3d::Zero()};
    return {camera.point(u, v, fitted), -normal.normalized()};
}

/// A point of the one frame, and the plane of the other that it meets or misses by a gate.
struct Encounter {
    Vector3d point, normal; ///< here
    double distance_m;      ///< from the plane, towards the camera
    double tolerable_m;
    bool meets, hides;
};

std::vector<Encounter> encounters(const Pair& pair, const Isometry3d& here_from_there, double gates = 1) {
    std::vector<Encounter> all;
    const Pinhole& camera = pair.here.depth.camera;
    const cv::Mat1f& z_m = pair.here.depth.z_m;
    for (const Facets::Facet& there : pair.there.all) {
        const Vector3d point = here_from_there * there.point;
        if (there.normal.isZero() || point.z() <= 1e-3 * pair.radius_m)
            continue;
        const double x = camera.fx * point.x() / point.z() + camera.cx,
                     y = camera.fy * point.y() / point.z() + camera.cy;
        if (!(x > -0.5 && y > -0.5 && x < z_m.cols - 0.5 && y < z_m.rows - 0.5) || !(z_m(cvRound(y), cvRound(x)) > 0))
            continue;
        const int column = std::min(static_cast<int>(x) / apart_px, pair.here.grid.width - 1);
        const int row = std::min(static_cast<int>(y) / apart_px, pair.here.grid.height - 1);
        const double seen_z = z_m(cvRound(y), cvRound(x));
        const Facets::Facet& here =
            pair.here.all[static_cast<std::size_t>(std::max(row, 0) * pair.here.grid.width + std::max(column, 0))];
        const double sigma = pair.noise.at(point.z()), gate = gates * (0.1 * pair.radius_m + 4 * sigma);
        const double distance = here.normal.dot(point - here.point);
        const bool alike = here.normal.dot(here_from_there.linear() * there.normal) > 0.7;
        const bool hides = point.z() < seen_z - gate;
        all.push_back({point, here.normal, distance, 0.02 * pair.radius_m + sigma, alike && std::abs(distance) < gate,
                       hides && !(alike && std::abs(distance) < gate)});
    }
    return all;
}

/// Distances of the planes that meet, in what is tolerable or in metres.
std::vector<double> alignment_errors(const std::vector<Encounter>& all, bool in_metres = false) {
    std::vector<double> values;
    for (const Encounter& each : all)
        if (each.meets)
            values.push_back(std::abs(each.distance_m) / (in_metres ? 1 : each.tolerable_m));
    return values;
}

Isometry3d moved(const Vector6d& by) {
    Isometry3d motion = Isometry3d::Identity();
    const Vector3d turn = by.head<3>();
    if (turn.norm() > 0)
        motion.linear() = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
    motion.translation() = by.tail<3>();
    return motion;
}

/// Of what the planes that meet say about a motion: a turn, then a shift.
struct NormalEquations {
    Matrix6d matrix;
    Vector6d gradient;
    Vector3d middle; ///< of the surfaces
};

/// After that motion; nothing where too few planes meet.
std::optional<NormalEquations> normal_equations(const Pair& pair, const Vector6d& motion,
                                                const Isometry3d& here_from_there, double gates) {
    const std::vector<Encounter> all = encounters(pair, moved(motion) * here_from_there, gates);
    std::vector<double> values = alignment_errors(all);
    if (values.size() < 30)
        return std::nullopt;
    const double limit = std::max(3 * quantile(values, 0.5), 0.3);
    constexpr double turn_sigma = 1.5 * std::numbers::pi / 180, shift_sigma_m = 0.06; // what poses may err at worst
    Vector6d prior;
    prior << Vector3d::Constant(1 / (turn_sigma * turn_sigma)), Vector3d::Constant(1 / (shift_sigma_m * shift_sigma_m));
    NormalEquations system{prior.asDiagonal(), prior.cwiseProduct(motion), Vector3d::Zero()};
    for (const Encounter& each : all) {
        system.middle += each.point / static_cast<double>(all.size());
        const double miss = each.distance_m / each.tolerable_m / limit;
        if (!each.meets || std::abs(miss) >= 1)
            continue;
        // A point's error is that of its patch, not of one pixel among many: a tenth of its weight is what it tells.
        const double weight = 0.1 * (1 - miss * miss) * (1 - miss * miss) / (each.tolerable_m * each.tolerable_m);
        Vector6d slope;
        slope << each.point.cross(each.normal), each.normal;
        system.matrix += weight * slope * slope.transpose();
        system.gradient += weight * each.distance_m * slope;
    }
    return system;
}

/// Sigma of where the surfaces' middle lies, in the direction that is known least, metres.
double uncertainty(const NormalEquations& system) {
    const Vector3d& p = system.middle;
    Eigen::Matrix<double, 3, 6> by_motion; // turned and shifted
    by_motion << Eigen::Matrix3d{{0, p.z(), -p.y()}, {-p.z(), 0, p.x()}, {p.y(), -p.x(), 0}},
        Eigen::Matrix3d::Identity();
    const Eigen::Matrix3d covariance = by_motion * system.matrix.ldlt().solve(by_motion.transpose());
    return std::sqrt(
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(covariance, Eigen::EigenvaluesOnly).eigenvalues().maxCoeff());
}

} // namespace

Facets facets_of(const DepthImage& depth, const DepthNoise& noise) {
    Facets facets{depth, {std::max(depth.z_m.cols / apart_px, 1), std::max(depth.z_m.rows / apart_px, 1)}, {}};
    facets.all.resize(static_cast<std::size_t>(facets.grid.area()));
    tbb::parallel_for(0, facets.grid.height, [&](int row) {
        for (int column = 0; column < facets.grid.width; ++column)
            facets.all[static_cast<std::size_t>(row * facets.grid.width + column)] =
                facet_at(depth, std::min(column * apart_px + apart_px / 2, depth.z_m.cols - 1),
                         std::min(row * apart_px + apart_px / 2, depth.z_m.rows - 1), noise);
    });
    return facets;
}

Agreement agreement(const Pair& pair, const Isometry3d& here_from_there) {
    const std::vector<Encounter> all = encounters(pair, here_from_there);
    std::vector<double> values = alignment_errors(all), metres = alignment_errors(all, true);
    if (values.empty())
        return {};
    const double met = static_cast<double>(values.size());
    const auto hiding = static_cast<double>(std::ranges::count(all, true, &Encounter::hides));
    const auto known = std::ranges::count_if(pair.there.all, [](const auto& facet) { return !facet.normal.isZero(); });
    return {met / static_cast<double>(known), hiding / (met + hiding), quantile(metres, 0.9), quantile(values, 0.5)};
}

Aligned aligned(const Pair& pair, const Isometry3d& here_from_there) {
    constexpr int rounds = 8;
    Vector6d motion = Vector6d::Zero();
    std::optional<NormalEquations> system;
    for (const double gates : {3, 1}) // what is far off must first be found
        for (int round = 0; round < rounds; ++round) {
            system = normal_equations(pair, motion, here_from_there, gates);
            if (!system)
                return {here_from_there, 0};
            const Vector6d step = system->matrix.ldlt().solve(-system->gradient);
            motion += step;
            if (step.norm() < 1e-5)
                break;
        }
    const Isometry3d better = moved(motion) * here_from_there;
    // Noise fits better after any adjustment; a pose that is off, much better.
    if (agreement(pair, better).alignment_error > 0.75 * agreement(pair, here_from_there).alignment_error)
        return {here_from_there, 0};
    return {better, uncertainty(*system)};
}

} // namespace scanshade
