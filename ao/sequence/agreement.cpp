#include "ao/sequence/agreement.h"

#include "projection/base/statistics.h"

#include <algorithm>
#include <cmath>
#include <Eigen/Eigenvalues>
#include <optional>
#include <tbb/parallel_for.h>

namespace scanshade {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

constexpr int most_apart_px = 12;      // of the facets
constexpr double enough_facets = 2100; // of small images, as many as of 640x480 pixels
/// What is taken for a plane is one to this share of its distance.
constexpr double flat_to = 1e-4;
/// Noisy sensors bend space by about this share of the distance. Redwood's poses stay by it, and 7-Scenes' get better.
constexpr double bent_by = 1e-3;
constexpr double pose_sigma_m = 0.06; // what poses may err at worst
/// A direction is aligned where the planes tell it to this share of the radius, and left as recorded elsewhere.
constexpr double sufficient = 0.02;
constexpr double tiny = 0.001; // share of the radius; surfaces that miss by less are aligned already

/// The slope of 1/z along a row or a column: the median between five samples, which a step in the window does not move.
/// A start of zero would lose planes seen at a grazing angle, such as the floor.
double slope_along(const DepthImage& depth, cv::Point at, cv::Point direction, double apart) {
    std::vector<double> slopes;
    int previous = 0;
    double before = 0; // no depth
    for (int i = -2; i <= 2; ++i) {
        const int by = cvRound(i * apart);
        const cv::Point p = at + by * direction;
        const bool inside = p.x >= 0 && p.y >= 0 && p.x < depth.z_m.cols && p.y < depth.z_m.rows;
        const double z = inside ? static_cast<double>(depth.z_m(p)) : 0, w = z > 0 ? 1 / z : 0;
        if (w > 0 && before > 0)
            slopes.push_back((w - before) / (by - previous));
        previous = by;
        before = w;
    }
    return slopes.empty() ? 0 : quantile(slopes, 0.5);
}

/// The plane w = W + a x + b y in 1/z round a pixel, by least squares over 5x5 samples, twice: what is of another
/// surface has no say in the second round.
Facets::Facet facet_at(const DepthImage& depth, int u, int v, const DepthNoise& noise) {
    const double z = depth.z_m(v, u);
    if (!(z > 0))
        return {};
    const Pinhole& camera = depth.camera;
    const double here = 1 / z, sigma = noise.at(z) * here * here;
    const double radius = std::clamp(
        std::sqrt(1.8 * noise.correlation_px * noise.correlation_px * noise.at(z) * camera.fx / z), 2.0, 12.0);
    Vector3d plane(slope_along(depth, {u, v}, {1, 0}, radius / 2), slope_along(depth, {u, v}, {0, 1}, radius / 2), 0);
    double variance = 0; // of the offset, for samples of variance 1
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
            return {};
        const auto solved = products.ldlt();
        plane = solved.solve(right);
        variance = solved.solve(Vector3d::UnitZ()).z();
    }
    const double w = here + plane.z(), fitted = 1 / w;
    const Vector3d normal(camera.fx * plane.x(), camera.fy * plane.y(),
                          w - plane.x() * (u - camera.cx) - plane.y() * (v - camera.cy));
    if (!(variance > 0 && variance < 1) || !(w > 0) || std::abs(plane.z()) > 4 * sigma + 1e-3 * here)
        return {};
    const Vector3d point = camera.point(u, v, fitted), unit = -normal.normalized();
    const double bent = noise.any() ? bent_by * fitted : 0;
    const double correlated = std::max(1.0, 2 * noise.correlation_px / radius); // samples that err together
    const double across = std::abs(unit.dot(point)) / fitted;
    return {point, unit, correlated * std::sqrt(variance) * noise.at(fitted) * across + flat_to * fitted + bent,
            radius};
}

/// A point of the one frame, and the plane of the other that it meets or misses by a gate.
struct Encounter {
    Vector3d point, normal; ///< here
    double distance_m;      ///< from the plane, towards the camera
    double sigma_m;         ///< of the distance
    double tolerable_m;
    bool meets, hides;
};

std::vector<Encounter> encounters(const Pair& pair, const Isometry3d& here_from_there, double gates = 1) {
    std::vector<Encounter> all;
    all.reserve(pair.there.all.size());
    const Pinhole& camera = pair.here.depth.camera;
    const int apart_px = pair.here.apart_px;
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
        const double du = x - std::min(column * apart_px + apart_px / 2, z_m.cols - 1),
                     dv = y - std::min(row * apart_px + apart_px / 2, z_m.rows - 1);
        // The variance of a plane away from the middle of a square of samples.
        const double away = here.radius_px > 0 ? 1 + 2 * (du * du + dv * dv) / (here.radius_px * here.radius_px) : 1;
        all.push_back({point, here.normal, distance,
                       std::sqrt(there.sigma_m * there.sigma_m + away * here.sigma_m * here.sigma_m),
                       0.02 * pair.radius_m + sigma, alike && std::abs(distance) < gate,
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

/// The motions of a frame that are looked for: turns about the middle of the surfaces, and shifts. Turns are measured
/// by what they move at the surfaces' distance from that middle, so all six numbers are metres.
struct Motions {
    Vector3d middle;
    double extent_m;

    [[nodiscard]] Isometry3d operator()(const Vector6d& by) const {
        const Vector3d turn = by.head<3>() / extent_m;
        Isometry3d motion = Isometry3d::Identity();
        if (turn.norm() > 0)
            motion.linear() = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
        motion.translation() = by.tail<3>() + middle - motion.linear() * middle;
        return motion;
    }
    /// How a point moves along a normal.
    [[nodiscard]] Vector6d slope(const Vector3d& point, const Vector3d& normal) const {
        Vector6d slope;
        slope << (point - middle).cross(normal) / extent_m, normal;
        return slope;
    }
};

Motions motions_about(const std::vector<Encounter>& all) {
    Motions motions{Vector3d::Zero(), 0};
    for (const Encounter& each : all)
        motions.middle += each.point / static_cast<double>(all.size());
    for (const Encounter& each : all)
        motions.extent_m += (each.point - motions.middle).squaredNorm() / static_cast<double>(all.size());
    motions.extent_m = std::max(std::sqrt(motions.extent_m), 1e-9);
    return motions;
}

/// What the planes that meet say about a motion, along six directions.
struct Evidence {
    Matrix6d directions; ///< columns, from the one that the planes tell least about
    Vector6d sigma_m;    ///< along each; infinite where no planes tell
    Vector6d step_m;     ///< along each, to where the planes meet
    double scale;        ///< of the distances, in their sigmas; at least 1. Contained in the sigmas

    /// 1 for each direction that is known well enough, 0 for the others.
    [[nodiscard]] Vector6d known(double limit_m) const { return (sigma_m.array() < limit_m).cast<double>(); }
    /// The square of the motion in sigmas, each direction that is known.
    [[nodiscard]] double significance(const Vector6d& along, const Vector6d& known) const {
        return known.cwiseProduct(along.cwiseQuotient(sigma_m)).squaredNorm();
    }
};

/// Nothing where too few planes meet.
std::optional<Evidence> evidence(const Motions& motions, const std::vector<Encounter>& all, double blur = 0) {
    struct Row {
        const Encounter* plane;
        double sigma_m, weight = 0;
        Vector6d slope = Vector6d::Zero();
    };
    std::vector<Row> rows;
    rows.reserve(all.size());
    std::vector<double> misses;
    for (const Encounter& each : all)
        if (each.meets) {
            const double blurred_m = blur * each.tolerable_m;
            rows.push_back({&each, std::sqrt(each.sigma_m * each.sigma_m + blurred_m * blurred_m)});
            misses.push_back(std::abs(each.distance_m) / rows.back().sigma_m);
        }
    if (rows.size() < 30)
        return std::nullopt;
    const double scale = std::max(1.0, 1.4826 * quantile(misses, 0.5)); // the robust estimate of a sigma
    Matrix6d matrix = Matrix6d::Zero();
    for (Row& row : rows) {
        // Tukey's weight. Where most planes meet already, those of other directions may still be off by more.
        const double sigma = scale * row.sigma_m;
        const double miss = row.plane->distance_m / std::max(4.685 * sigma, 0.3 * row.plane->tolerable_m);
        if (std::abs(miss) >= 1)
            continue;
        row.weight = (1 - miss * miss) * (1 - miss * miss) / (sigma * sigma);
        row.slope = motions.slope(row.plane->point, row.plane->normal);
        matrix += row.weight * row.slope * row.slope.transpose();
    }
    const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(matrix);
    Evidence result{eigen.eigenvectors(), {}, {}, scale};
    for (int i = 0; i < 6; ++i) {
        const Vector6d direction = eigen.eigenvectors().col(i);
        double told = 0, pull = 0;
        for (const Row& row : rows) {
            const double along = row.slope.dot(direction);
            pull -= row.weight * along * row.plane->distance_m;
            if (std::abs(along) > 0.2) // less is also what noise makes of a plane that lies along the direction
                told += row.weight * along * along;
        }
        result.sigma_m[i] = 1 / std::sqrt(told);
        result.step_m[i] = pull / (eigen.eigenvalues()[i] + 1 / (pose_sigma_m * pose_sigma_m));
    }
    return result;
}

} // namespace

Facets facets_of(const DepthImage& depth, const DepthNoise& noise) {
    const int apart_px =
        std::clamp(cvRound(std::sqrt(static_cast<double>(depth.z_m.total()) / enough_facets)), 1, most_apart_px);
    Facets facets{
        depth, apart_px, {std::max(depth.z_m.cols / apart_px, 1), std::max(depth.z_m.rows / apart_px, 1)}, {}};
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
    constexpr double largest = 0.5; // of what is tolerable
    const double met = static_cast<double>(values.size());
    const auto hiding = static_cast<double>(std::ranges::count(all, true, &Encounter::hides));
    const auto known = std::ranges::count_if(pair.there.all, [](const auto& facet) { return !facet.normal.isZero(); });
    return {met / static_cast<double>(known), hiding / (met + hiding), quantile(metres, 0.9),
            quantile(values, 0.5) / largest};
}

Aligned aligned(const Pair& pair, const Isometry3d& here_from_there) {
    constexpr int rounds = 8;
    constexpr double three_sigma = 9;
    const double limit_m = sufficient * pair.radius_m;
    const std::vector<Encounter> all = encounters(pair, here_from_there);
    const Motions motions = motions_about(all);
    if (std::vector<double> misses_m = alignment_errors(all, true);
        !misses_m.empty() && quantile(misses_m, 0.9) < tiny * pair.radius_m)
        return {here_from_there, 0};
    // Noise fits better after any motion: one that is not significant is none. What is off has a large scale.
    if (const auto first = evidence(motions, all)) {
        const Vector6d known = first->known(limit_m * first->scale);
        if (first->scale * first->scale * first->significance(first->step_m, known) < three_sigma * known.sum())
            return {here_from_there, 0};
    }
    Vector6d motion = Vector6d::Zero(), along, known;
    std::optional<Evidence> found;
    // What is far off must first be found, and must not be given up for what meets sooner: errors that count fully
    // shrink from round to round. How well a direction is known is told by where the planes meet at last.
    struct Stage {
        double gates, last_blur, limit_m;
    };
    for (const Stage& stage : {Stage{3, 0.5, pose_sigma_m}, {1, 0, pose_sigma_m}, {1, 0, limit_m}})
        for (int round = 0; round < rounds; ++round) {
            found = evidence(motions, encounters(pair, motions(motion) * here_from_there, stage.gates),
                             stage.last_blur * std::exp2(std::max(3 - round, 0)));
            if (!found)
                return {here_from_there, 0};
            known = found->known(stage.limit_m);
            along = known.cwiseProduct(found->directions.transpose() * motion + found->step_m);
            const Vector6d before = motion;
            motion = found->directions * along;
            if ((motion - before).norm() < 1e-5 && (stage.last_blur == 0 || round >= 3))
                break;
        }
    const Isometry3d better = motions(motion) * here_from_there;
    if (found->significance(along, known) < three_sigma * known.sum() || known.isZero() ||
        agreement(pair, better).alignment_error > agreement(pair, here_from_there).alignment_error)
        return {here_from_there, 0};
    // What is left as recorded may be off by as much as the rest was.
    const double left_m = std::sqrt(along.squaredNorm() / known.sum());
    double sigma_m = 0;
    for (int i = 0; i < 6; ++i)
        sigma_m = std::max(sigma_m, known[i] > 0 ? found->sigma_m[i] : left_m);
    return {better, sigma_m};
}

} // namespace scanshade
