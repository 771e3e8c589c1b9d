#include "projection/found_frames.h"

#include "projection/base/comb.h"
#include "projection/base/line_fit.h"
#include "projection/base/statistics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <Eigen/Dense>
#include <functional>
#include <limits>
#include <map>
#include <numbers>
#include <numeric>
#include <utility>

namespace scanshade {
namespace {

using Eigen::Isometry3d, Eigen::Matrix3d, Eigen::Vector2d, Eigen::Vector3d;
using Points = std::span<const Vector3d>;

constexpr double pixel_tolerance = 0.2;       ///< of a pixel; a fifth, as pixel_cloud() has it
constexpr std::size_t enough_of_frame = 4000; ///< points that tell its camera

/// Points one after the other, of one row or a piece of one, and the plane that they lie in.
struct Row {
    std::size_t first, last; ///< one past its end
    Vector3d middle, normal;
    double weight; ///< how well the plane's angle is known: the points' spread across the row in grains, by root of
                   ///< their number
};

/// How far coordinates may be off: they are single-precision numbers or were reckoned in these, whose errors are
/// several steps, or have so many digits.
double grain_of(Points points) {
    constexpr double single = 4 * std::numeric_limits<float>::epsilon();
    constexpr int most_digits = 12;
    double largest = 0, extent = 0;
    bool are_single = true;
    for (const Vector3d& point : points) {
        largest = std::max(largest, point.cwiseAbs().maxCoeff());
        extent = std::max(extent, (point - points[points.size() / 2]).cwiseAbs().maxCoeff());
        are_single = are_single && point.cast<float>().cast<double>() == point;
    }
    const double grain = single * (are_single ? largest : extent);
    for (int digits = 1; digits < most_digits; ++digits) {
        const double step = std::pow(10, std::round(std::log10(std::max(largest, 1e-12))) - digits);
        const bool whole = 0.6 * step > grain && std::ranges::all_of(points, [&](const Vector3d& point) {
                               const Eigen::Array3d steps = point.array() / step;
                               return ((steps - steps.round()).abs() < 0.01 + grain / step).all();
                           });
        if (whole)
            return 0.6 * step;
    }
    return grain;
}

/// The ends of rows among the points: where the step goes against the chords of what comes before and after, and is
/// longer than one of them. In a corner of a room, rows end far from square to where the next begins.
std::vector<std::size_t> row_ends(Points points) {
    constexpr std::size_t chord = 12;
    constexpr double against = -0.7;
    std::vector<std::size_t> ends;
    for (std::size_t i = 0; i + 1 < points.size(); ++i) {
        const Vector3d step = points[i + 1] - points[i];
        const Vector3d before = points[i] - points[i - std::min(i, chord)];
        const Vector3d after = points[std::min(i + 1 + chord, points.size() - 1)] - points[i + 1];
        const double length = step.norm(), b = before.norm(), a = after.norm();
        if (!(length > std::min(a, b)))
            continue;
        const double to_before = step.dot(before) / (length * b), to_after = step.dot(after) / (length * a);
        if (to_before < 0 && to_after < 0 && to_before + to_after < against)
            ends.push_back(i + 1);
    }
    ends.push_back(points.size());
    return ends;
}

/// The rows whose planes are known: flat to the grain, and wide enough across. Walls without noise are lines, which
/// leave the plane open; two rows in one are no plane.
std::vector<Row> rows_of(Points points, double grain) {
    constexpr std::size_t fewest = 12;
    constexpr double widest = 25;
    std::vector<Row> rows;
    std::size_t first = 0;
    for (const std::size_t last : row_ends(points)) {
        const std::size_t begin = std::exchange(first, last), count = last - begin;
        if (count < fewest)
            continue;
        Vector3d middle = Vector3d::Zero();
        for (std::size_t i = begin; i < last; ++i)
            middle += points[i];
        middle /= static_cast<double>(count);
        Matrix3d spread = Matrix3d::Zero();
        for (std::size_t i = begin; i < last; ++i)
            spread += (points[i] - middle) * (points[i] - middle).transpose();
        const Eigen::SelfAdjointEigenSolver<Matrix3d> axes(spread / static_cast<double>(count));
        const Vector3d sizes = axes.eigenvalues().cwiseMax(0).cwiseSqrt();
        if (sizes[0] < grain && sizes[1] > widest * grain)
            rows.push_back({begin, last, middle, axes.eigenvectors().col(0),
                            sizes[1] / grain * std::sqrt(static_cast<double>(count))});
    }
    return rows;
}

/// The line that planes of rows share.
struct RowLine {
    Vector3d at, along;

    /// Whether a plane holds it, as far as its points tell.
    [[nodiscard]] bool fits(const Row& row) const {
        constexpr double least_angle = 0.002, uncertain = 1.5;
        const double distance = (row.middle - at).norm();
        const double angle = least_angle + uncertain / row.weight;
        return std::abs(row.normal.dot(along)) < angle && std::abs(row.normal.dot(row.middle - at)) < angle * distance;
    }
};

RowLine line_of(std::span<const Row> rows) {
    Matrix3d normals = Matrix3d::Zero();
    Vector3d offsets = Vector3d::Zero();
    for (const Row& row : rows) {
        const double weight = row.weight * row.weight;
        normals += weight * row.normal * row.normal.transpose();
        offsets += weight * row.normal.dot(row.middle) * row.normal;
    }
    const Eigen::SelfAdjointEigenSolver<Matrix3d> axes(normals);
    RowLine line{Vector3d::Zero(), axes.eigenvectors().col(0)};
    for (int k = 1; k < 3; ++k)
        line.at += axes.eigenvectors().col(k).dot(offsets) / axes.eigenvalues()[k] * axes.eigenvectors().col(k);
    return line;
}

/// Rows of one frame, and the line through its camera.
struct Core {
    std::vector<Row> rows;
    RowLine line;
};

/// From the first rows on whose planes share a line: all that follow and hold it, too.
std::optional<Core> core_of(std::span<const Row> rows, std::size_t& s) {
    constexpr std::size_t start = 8, fewest = 12, most = 80, misses_end = 4;
    for (; s + fewest <= rows.size(); ++s) {
        Core core{
            {rows.begin() + static_cast<std::ptrdiff_t>(s), rows.begin() + static_cast<std::ptrdiff_t>(s + start)}, {}};
        core.line = line_of(core.rows);
        if (!std::ranges::all_of(core.rows, [&](const Row& row) { return core.line.fits(row); }))
            continue;
        std::size_t misses = 0;
        for (std::size_t r = s + start; r < rows.size() && misses < misses_end && core.rows.size() < most; ++r) {
            if (!core.line.fits(rows[r])) {
                ++misses;
                continue;
            }
            misses = 0;
            core.rows.push_back(rows[r]);
            core.line = line_of(core.rows);
        }
        const std::size_t had = core.rows.size();
        std::erase_if(core.rows, [&](const Row& row) { return !core.line.fits(row); }); // the last of another frame
        if (core.rows.size() >= fewest) {
            s += had;
            core.line = line_of(core.rows);
            return core;
        }
    }
    return std::nullopt;
}

/// The points of a row by the line: along it, across it, and at what angle the row is about it.
struct Column {
    double a, b;
};
struct FlatRow {
    std::vector<Column> points;
    double angle = 0;
};
struct FlatCore {
    std::vector<FlatRow> rows;
    Vector3d along, forward, down; ///< a frame of axes at line.at; angles count from `forward` to `down`
};

FlatCore flattened(const Core& core, Points points) {
    FlatCore flat;
    flat.along = core.line.along;
    Vector3d middle = Vector3d::Zero();
    for (const Row& row : core.rows)
        middle += row.middle - core.line.at;
    flat.forward = (middle - middle.dot(flat.along) * flat.along).normalized();
    flat.down = flat.forward.cross(flat.along);
    for (const Row& row : core.rows) {
        FlatRow made;
        const Vector3d to = row.middle - core.line.at;
        made.angle = std::atan2(to.dot(flat.down), to.dot(flat.forward));
        const Vector3d across = std::cos(made.angle) * flat.forward + std::sin(made.angle) * flat.down;
        for (std::size_t i = row.first; i < row.last; ++i)
            made.points.push_back({(points[i] - core.line.at).dot(flat.along), (points[i] - core.line.at).dot(across)});
        if (std::ranges::all_of(made.points, [](const Column& c) { return c.b > 0; }))
            flat.rows.push_back(std::move(made));
    }
    return flat;
}

/// The densest place of values: the mean of most of them that lie within a width; nothing where few do.
std::optional<double> densest(std::vector<double> values, double width, double least_share) {
    std::ranges::sort(values);
    std::size_t most = 0, at = 0;
    for (std::size_t i = 0, k = 0; i < values.size(); ++i) {
        while (k < values.size() && values[k] < values[i] + width)
            ++k;
        if (k - i > most) {
            most = k - i;
            at = i;
        }
    }
    if (static_cast<double>(most) < least_share * static_cast<double>(values.size()) || most < 10)
        return std::nullopt;
    return values[at + most / 2];
}

/// Where the camera is along the line. Steps by as many pixels differ by what (1 / b) differs times t; pairs by other
/// numbers tell anything.
std::optional<double> place_on_line(const FlatCore& flat, double grain) {
    constexpr std::array<std::size_t, 4> partners{1, 3, 7, 18};
    constexpr double width = 0.01, least_share = 0.02, farthest = 3;
    std::vector<double> votes, across;
    for (const FlatRow& row : flat.rows) {
        const std::vector<Column>& p = row.points;
        for (std::size_t i = 0; i + 1 < p.size(); ++i) {
            across.push_back(p[i].b);
            for (const std::size_t partner : partners) {
                const std::size_t k = i + partner;
                if (k + 1 >= p.size())
                    break;
                const double a =
                    (p[i + 1].a / p[i + 1].b - p[i].a / p[i].b) - (p[k + 1].a / p[k + 1].b - p[k].a / p[k].b);
                const double b = (1 / p[i + 1].b - 1 / p[i].b) - (1 / p[k + 1].b - 1 / p[k].b);
                if (std::abs(b) * width * p[i].b > 2 * grain / p[i].b)
                    votes.push_back(a / b);
            }
        }
    }
    const double distance = median(across, 0);
    std::vector<double> near;
    std::vector<double> along;
    for (const FlatRow& row : flat.rows)
        for (const Column& c : row.points)
            along.push_back(c.a);
    const double middle = median(std::move(along), 0);
    for (const double vote : votes)
        if (std::abs(vote - middle) < farthest * distance)
            near.push_back(vote);
    const std::optional<double> coarse = densest(near, width * distance, least_share);
    if (!coarse)
        return std::nullopt;
    std::erase_if(near, [&](double vote) { return std::abs(vote - *coarse) > width * distance; });
    const std::optional<double> fine = densest(near, width / 20 * distance, 0);
    return fine ? fine : coarse;
}

/// Whether columns fall from point to point.
bool runs_backwards(const FlatCore& flat, double t) {
    std::ptrdiff_t rising = 0;
    for (const FlatRow& row : flat.rows)
        for (std::size_t i = 1; i < row.points.size(); ++i)
            rising +=
                (row.points[i].a - t) / row.points[i].b > (row.points[i - 1].a - t) / row.points[i - 1].b ? 1 : -1;
    return rising < 0;
}

void turn_round(FlatCore& flat) {
    flat.along = -flat.along;
    flat.down = -flat.down;
    for (FlatRow& row : flat.rows) {
        row.angle = -row.angle;
        for (Column& column : row.points)
            column.a = -column.a;
    }
}

/// A row with columns by whole pixels, the first of them 0.
struct CountedRow {
    double angle = 0, pitch = 0; ///< tangents along the line per column
    std::size_t points = 0;
};

/// Columns from steps that are whole multiples of a pitch; nothing where they are none.
std::optional<CountedRow> counted(const FlatRow& row, double t, int divisor) {
    constexpr double whole = 0.1, most_whole = 0.85, low = 0.15, longest = 60;
    std::vector<double> tangents, steps;
    for (const Column& c : row.points)
        tangents.push_back((c.a - t) / c.b);
    for (std::size_t i = 1; i < tangents.size(); ++i)
        steps.push_back(tangents[i] - tangents[i - 1]);
    std::vector<double> ordered = steps;
    std::erase_if(ordered, [](double step) { return step <= 0; });
    if (2 * ordered.size() < steps.size())
        return std::nullopt;
    CountedRow found{row.angle, quantile(ordered, low) / divisor, tangents.size()};
    for (int round = 0; round < 3; ++round) {
        double times = 0, squares = 0;
        std::size_t fitting = 0;
        for (const double step : steps) {
            const double m = std::round(step / found.pitch);
            if (m < 1 || m > longest || std::abs(step / found.pitch - m) > whole)
                continue;
            ++fitting;
            times += m * step;
            squares += m * m;
        }
        if (static_cast<double>(fitting) < most_whole * static_cast<double>(steps.size()))
            return std::nullopt;
        found.pitch = times / squares;
    }
    LineFit columns;
    double column = 0;
    columns.add(0, tangents.front());
    for (std::size_t i = 0; i < steps.size(); ++i) {
        column += std::round(steps[i] / found.pitch);
        if (std::abs(steps[i] / found.pitch - std::round(steps[i] / found.pitch)) < whole)
            columns.add(column, tangents[i + 1]);
    }
    if (columns.determined())
        found.pitch = columns.line().slope;
    return found;
}

/// A camera with its pixels' place as numbers to be fitted: pixels of the world's points.
struct View {
    Isometry3d world_from_camera;
    double fx, fy, cx = 0, cy = 0;

    [[nodiscard]] Vector3d seen(const Vector3d& world) const {
        return world_from_camera.linear().transpose() * (world - world_from_camera.translation());
    }
    [[nodiscard]] Vector2d pixel(const Vector3d& camera) const {
        return {fx * camera.x() / camera.z() + cx, fy * camera.y() / camera.z() + cy};
    }
    /// Whether a point is on a whole pixel, to `tolerance`.
    [[nodiscard]] bool holds(const Vector3d& world, double tolerance = pixel_tolerance) const {
        constexpr double widest = 2.5; // tangents: a view of 136 degrees
        const Vector3d camera = seen(world);
        if (!(camera.z() > 0) || std::abs(camera.x()) > widest * camera.z() ||
            std::abs(camera.y()) > widest * camera.z())
            return false;
        const Vector2d at = pixel(camera);
        return (at - at.array().round().matrix()).cwiseAbs().maxCoeff() < tolerance;
    }
};

/// The coarsest of a pitch's whole parts at which tangents are at the same place in their pixels.
std::optional<Comb> comb_of(std::span<const double> tangents, double pitch) {
    constexpr int most_parts = 12;
    constexpr double alike = 0.8;
    for (int parts = 1; parts <= most_parts; ++parts)
        if (const Comb comb = comb_at(tangents, parts / pitch); comb.alike > alike)
            return comb;
    return std::nullopt;
}

/// pitch = k cos(angle - axis): linear in the sine and cosine of the axis.
struct Optics {
    double pitch, axis;
};
std::optional<Optics> optics_of(std::span<const CountedRow> rows) {
    Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
    Vector2d right = Vector2d::Zero();
    std::vector<double> pitches;
    for (const CountedRow& row : rows)
        pitches.push_back(row.pitch);
    const double usual = median(pitches, 0);
    for (const CountedRow& row : rows) {
        if (std::abs(row.pitch / usual - 1) > 0.1)
            continue;
        const Vector2d terms(std::cos(row.angle), std::sin(row.angle));
        const double weight = static_cast<double>(row.points);
        normal += weight * terms * terms.transpose();
        right += weight * row.pitch * terms;
    }
    const Vector2d found = normal.ldlt().solve(right);
    if (!found.allFinite() || !(found.norm() > 0))
        return std::nullopt;
    return Optics{found.norm(), std::atan2(found.y(), found.x())};
}

/// The tangent from a row to the next: the mean of the short steps. Pieces of one row count as one: their steps are
/// small against `pitch`, that of columns.
double pitch_of_rows(std::span<const double> tangents, double pitch) {
    constexpr double same_row = 0.05, low = 0.15, alike = 0.2;
    std::vector<double> steps;
    for (std::size_t i = 1; i < tangents.size(); ++i)
        steps.push_back(std::abs(tangents[i] - tangents[i - 1]));
    std::erase_if(steps, [&](double step) { return step < same_row * pitch; });
    if (steps.empty())
        return 0;
    const double shortest = quantile(steps, low);
    std::erase_if(steps, [&](double step) { return std::abs(step / shortest - 1) > alike; });
    return std::accumulate(steps.begin(), steps.end(), 0.0) / static_cast<double>(steps.size());
}

std::optional<View> first_view(const Core& core, Points points, double grain) {
    constexpr int largest_divisor = 6;
    FlatCore flat = flattened(core, points);
    if (flat.rows.size() < 6)
        return std::nullopt;
    std::optional<double> t = place_on_line(flat, grain);
    if (t && runs_backwards(flat, *t)) {
        turn_round(flat);
        t = -*t;
    }
    if (!t)
        return std::nullopt;
    std::vector<CountedRow> rows;
    int divisor = 0;
    while (divisor < largest_divisor && 2 * rows.size() < flat.rows.size()) {
        ++divisor;
        rows.clear();
        for (const FlatRow& row : flat.rows)
            if (const std::optional<CountedRow> one = counted(row, *t, divisor))
                rows.push_back(*one);
    }
    if (2 * rows.size() < flat.rows.size())
        return std::nullopt;
    const std::optional<Optics> optics = optics_of(rows);
    if (!optics)
        return std::nullopt;
    View view;
    const Vector3d forward = std::cos(optics->axis) * flat.forward + std::sin(optics->axis) * flat.down;
    view.world_from_camera = Isometry3d::Identity();
    view.world_from_camera.linear() << flat.along, forward.cross(flat.along), forward;
    view.world_from_camera.translation() = core.line.at + *t * flat.along;
    std::vector<double> x, y;
    for (const Row& row : core.rows) {
        y.push_back(view.seen(row.middle).y() / view.seen(row.middle).z());
        for (std::size_t i = row.first; i < row.last; ++i)
            x.push_back(view.seen(points[i]).x() / view.seen(points[i]).z());
    }
    const std::optional<Comb> u = comb_of(x, divisor * optics->pitch);
    const std::optional<Comb> v = comb_of(y, pitch_of_rows(y, optics->pitch));
    if (!u || !v)
        return std::nullopt;
    view.fx = u->per_unit;
    view.fy = v->per_unit;
    view.cx = -u->place;
    view.cy = -v->place;
    return view;
}

/// What turns, moves (6 numbers) and stretches (4) a view so that points are on whole pixels, by least squares. Rays do
/// not tell depth, so noise along them does not matter.
struct Equations {
    Eigen::Matrix<double, 10, 10> normal = Eigen::Matrix<double, 10, 10>::Zero();
    Eigen::Matrix<double, 10, 1> right = Eigen::Matrix<double, 10, 1>::Zero();
    std::size_t fitting = 0, asked = 0;
    double squares = 0; ///< of the weighted residuals

    [[nodiscard]] double share() const {
        return static_cast<double>(fitting) / static_cast<double>(std::max<std::size_t>(asked, 1));
    }
    void add(const View& view, const Vector3d& point, double grain) {
        constexpr double tolerance = 0.4; // of a pixel: those in another pixel are left out
        ++asked;
        const Vector3d p = view.seen(point);
        if (!(p.z() > 0))
            return;
        const Vector2d at = view.pixel(p), off = at - at.array().round().matrix();
        if (!(off.cwiseAbs().maxCoeff() < tolerance))
            return;
        ++fitting;
        Eigen::Matrix<double, 2, 3> by_point;
        by_point << view.fx / p.z(), 0, -view.fx * p.x() / (p.z() * p.z()), 0, view.fy / p.z(),
            -view.fy * p.y() / (p.z() * p.z());
        Matrix3d turned;
        turned << 0, -p.z(), p.y(), p.z(), 0, -p.x(), -p.y(), p.x(), 0;
        Eigen::Matrix<double, 2, 10> by;
        by << by_point * turned, -by_point, Eigen::Matrix<double, 2, 4>::Zero();
        by(0, 6) = p.x() / p.z();
        by(1, 7) = p.y() / p.z();
        by(0, 8) = by(1, 9) = 1;
        const double weight = 1 / (1e-4 + std::pow(view.fx * grain / p.z(), 2));
        normal += weight * by.transpose() * by;
        right -= weight * by.transpose() * off;
        squares += weight * off.squaredNorm();
    }
};

Equations equations_of(const View& view, Points points, double grain, std::size_t enough) {
    Equations all;
    const std::size_t step = std::max<std::size_t>(1, points.size() / enough);
    for (std::size_t i = 0; i < points.size(); i += step)
        all.add(view, points[i], grain);
    all.normal.diagonal() *= 1 + 1e-9;
    return all;
}

void turn_and_move(View& view, const Eigen::Matrix<double, 6, 1>& by) {
    const Vector3d turn = by.head<3>();
    if (turn.norm() > 0)
        view.world_from_camera.linear() =
            view.world_from_camera.linear() * Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
    view.world_from_camera.translation() += view.world_from_camera.linear() * by.tail<3>();
}

/// Focal lengths and principal point.
using Intrinsics = Eigen::Vector4d;
Intrinsics intrinsics_of(const View& view) { return {view.fx, view.fy, view.cx, view.cy}; }
void set_intrinsics(View& view, const Intrinsics& numbers) {
    view.fx = numbers[0];
    view.fy = numbers[1];
    view.cx = numbers[2];
    view.cy = numbers[3];
}

/// Fits a view to its points (Gauss-Newton). Returns the share of the points that are on whole pixels.
double refine(View& view, Points points, double grain, int rounds, std::size_t enough) {
    double share = 0;
    for (int round = 0; round < rounds; ++round) {
        const Equations equations = equations_of(view, points, grain, enough);
        share = equations.share();
        if (equations.fitting < 50)
            return 0;
        const Eigen::Matrix<double, 10, 1> by = equations.normal.ldlt().solve(equations.right);
        if (!by.allFinite())
            return 0;
        turn_and_move(view, by.head<6>());
        set_intrinsics(view, intrinsics_of(view) + by.tail<4>());
    }
    return share;
}

struct Range {
    std::size_t first, last; ///< one past its end
    [[nodiscard]] std::size_t size() const { return last - first; }
};

/// How far from `from` points stay on whole pixels: the first that is not, of several that are not.
std::size_t reached(const View& view, Points points, std::size_t from, std::size_t limit, bool forwards) {
    constexpr int several = 6;
    std::size_t end = from;
    int misses = 0;
    for (std::size_t at = from; at != limit; forwards ? ++at : --at) {
        if (view.holds(points[forwards ? at : at - 1])) {
            misses = std::max(0, misses - 1);
            continue;
        }
        if (misses == 0)
            end = at;
        if (++misses == several)
            return end;
    }
    return misses == 0 ? limit : end;
}

struct Found {
    View view;
    Range range;
};

/// Refines while the part of the cloud that fits grows. Points before `free` belong to other frames.
std::optional<Found> grown(View view, Points points, Range core, std::size_t free, double grain) {
    constexpr std::size_t fewest = 400;
    constexpr double least_share = 0.9, growth = 1.5;
    Range range = core;
    if (refine(view, points.subspan(range.first, range.size()), grain, 5, 600) < least_share)
        return std::nullopt;
    while (true) {
        const auto margin = static_cast<std::size_t>((growth - 1) * static_cast<double>(range.size()));
        const Range wider{
            reached(view, points, range.first, std::max(free, range.first - std::min(margin, range.first)), false),
            reached(view, points, range.last, std::min(points.size(), range.last + margin), true)};
        const bool stays = wider.size() == range.size();
        range = wider;
        if (refine(view, points.subspan(range.first, range.size()), grain, 2, stays ? enough_of_frame : 600) <
            least_share)
            return std::nullopt;
        if (stays)
            break;
    }
    std::size_t fitting = 0;
    for (std::size_t i = range.first; i < range.last; ++i)
        fitting += view.holds(points[i]);
    if (range.size() < fewest || static_cast<double>(fitting) < least_share * static_cast<double>(range.size()))
        return std::nullopt;
    return Found{view, range};
}

/// The first frame whose rows begin within a window.
std::optional<Found> frame_in(Points points, Range window, std::size_t free, double grain) {
    constexpr int attempts = 8;
    const Points part = points.subspan(window.first, window.size());
    const std::vector<Row> rows = rows_of(part, grain);
    std::size_t next = 0;
    for (int attempt = 0; attempt < attempts; ++attempt) {
        const std::optional<Core> core = core_of(rows, next);
        if (!core)
            return std::nullopt;
        const std::optional<View> view = first_view(*core, part, grain);
        std::optional<Found> found;
        if (view)
            found =
                grown(*view, points, {window.first + core->rows.front().first, window.first + core->rows.back().last},
                      free, grain);
        if (found)
            return found;
    }
    return std::nullopt;
}

/// Frames one after the other. Where none is found in a window, the next begins in its middle.
std::vector<Found> all_frames(Points points, double grain) {
    constexpr std::size_t window = 40000;
    std::vector<Found> found;
    std::size_t at = 0, free = 0;
    while (at < points.size()) {
        const Range part{at, std::min(points.size(), at + window)};
        if (std::optional<Found> frame = frame_in(points, part, free, grain)) {
            at = free = frame->range.last;
            found.push_back(*std::move(frame));
        } else {
            at = part.last == points.size() ? part.last : at + window / 2;
        }
    }
    return found;
}

// ------------------------------------------------------------------------------------ one camera of several frames

/// What a frame's points say of its camera's intrinsics, whatever its pose: normal equations without the pose (its
/// Schur complement), in units of the points' own errors.
struct KnownIntrinsics {
    Intrinsics numbers;
    Eigen::Matrix4d information = Eigen::Matrix4d::Zero();

    /// Both together.
    [[nodiscard]] KnownIntrinsics with(const KnownIntrinsics& other) const {
        const Eigen::Matrix4d sum = information + other.information;
        return {sum.ldlt().solve(information * numbers + other.information * other.numbers), sum};
    }
    /// By how many standard deviations both differ.
    [[nodiscard]] double differs(const KnownIntrinsics& other) const {
        const Intrinsics by = numbers - other.numbers;
        const Intrinsics weighted =
            information * (information + other.information).ldlt().solve(other.information * by);
        return std::sqrt(std::max(0.0, by.dot(weighted)));
    }
};

KnownIntrinsics known_intrinsics(const Found& frame, Points points, double grain) {
    const Equations all =
        equations_of(frame.view, points.subspan(frame.range.first, frame.range.size()), grain, enough_of_frame);
    const double variance =
        std::max(all.squares / static_cast<double>(std::max<std::size_t>(2 * all.fitting, 1)), 1e-12);
    const auto of_pose = all.normal.topLeftCorner<6, 6>();
    const auto both = all.normal.bottomLeftCorner<4, 6>();
    const Eigen::Matrix4d left = all.normal.bottomRightCorner<4, 4>() - both * of_pose.ldlt().solve(both.transpose());
    return {intrinsics_of(frame.view), left / variance};
}

/// Fits the pose alone. Returns the share of the points that are on whole pixels.
double refine_pose(View& view, Points points, double grain) {
    constexpr int rounds = 3;
    double share = 0;
    for (int round = 0; round < rounds; ++round) {
        const Equations equations = equations_of(view, points, grain, enough_of_frame);
        share = equations.share();
        const Eigen::Matrix<double, 6, 6> of_pose = equations.normal.topLeftCorner<6, 6>();
        const Eigen::Matrix<double, 6, 1> by = of_pose.ldlt().solve(equations.right.head<6>());
        if (!by.allFinite())
            return 0;
        turn_and_move(view, by);
    }
    return share;
}

/// Frames of one camera get one: those whose intrinsics differ by no more than their errors. Several cameras in turn
/// stay several. The principal point is known up to whole pixels, and those of the first frame that fits are taken.
void share_cameras(std::vector<Found>& found, Points points, double grain) {
    constexpr double alike = 8, loss = 0.002;
    struct Group {
        KnownIntrinsics camera;
        std::vector<std::size_t> frames;
    };
    std::vector<Group> groups;
    for (std::size_t i = 0; i < found.size(); ++i) {
        KnownIntrinsics own = known_intrinsics(found[i], points, grain);
        const auto group = std::ranges::find_if(groups, [&](const Group& each) {
            for (Eigen::Index k = 2; k < 4; ++k)
                own.numbers[k] -= std::round(own.numbers[k] - each.camera.numbers[k]);
            return own.differs(each.camera) < alike;
        });
        if (group == groups.end()) {
            groups.push_back({own, {i}});
            continue;
        }
        group->camera = group->camera.with(own);
        group->frames.push_back(i);
    }
    for (const Group& group : groups)
        for (const std::size_t i : group.frames) {
            const Points own = points.subspan(found[i].range.first, found[i].range.size());
            View shared = found[i].view;
            set_intrinsics(shared, group.camera.numbers);
            if (refine_pose(shared, own, grain) >=
                equations_of(found[i].view, own, grain, enough_of_frame).share() - loss)
                found[i].view = shared;
        }
}

constexpr std::size_t fewest_of_frame = 1000; ///< points that are looked at

/// The points of a range that are finite.
struct FinitePoints {
    std::vector<std::uint32_t> numbers;
    std::vector<Vector3d> points; ///< relative to `middle`, since map coordinates are large
    Vector3d middle = Vector3d::Zero();
    double grain = 0;

    FinitePoints(Points all, const Range& range) {
        for (std::size_t i = range.first; i < range.last; ++i)
            if (all[i].allFinite() && !all[i].isZero()) {
                numbers.push_back(static_cast<std::uint32_t>(i));
                points.push_back(all[i]);
            }
        if (!are_enough())
            return;
        grain = grain_of(points);
        middle = points[points.size() / 2];
        for (Vector3d& point : points)
            point -= middle;
    }
    [[nodiscard]] bool are_enough() const { return points.size() >= fewest_of_frame; }
};

/// By a few places, before anything looks at all points: other clouds, however large, cost next to nothing.
bool has_frames(Points points) {
    constexpr std::size_t window = 40000, places = 4;
    for (std::size_t place = 0; place < places; ++place) {
        const std::size_t first = (points.size() - std::min(points.size(), window)) / (places - 1) * place;
        const FinitePoints some(points, {first, std::min(points.size(), first + window)});
        if (some.are_enough() && frame_in(some.points, {0, some.points.size()}, 0, some.grain))
            return true;
        if (points.size() <= window)
            break;
    }
    return false;
}

struct Pixel {
    int u, v;
};
Pixel pixel_of(const View& view, const Vector3d& point) {
    const Vector2d at = view.pixel(view.seen(point));
    return {static_cast<int>(std::lround(at.x())), static_cast<int>(std::lround(at.y()))};
}

/// The smallest image that holds the pixels of all frames, but for columns and rows beyond it with next to no point: a
/// frame may take the first points of the next.
struct Grid {
    int left, top, right, bottom;

    [[nodiscard]] cv::Size size() const { return {right - left + 1, bottom - top + 1}; }
    [[nodiscard]] bool has(Pixel at) const { return at.u >= left && at.u <= right && at.v >= top && at.v <= bottom; }
};

/// The lowest and highest number that is there several times.
std::pair<int, int> usual_range(const std::map<int, int>& counts) {
    constexpr int several = 5;
    const auto is_usual = [](const auto& each) { return each.second >= several; };
    const auto low = std::ranges::find_if(counts, is_usual);
    const auto high = std::find_if(counts.rbegin(), counts.rend(), is_usual);
    return low == counts.end() ? std::pair(0, 0) : std::pair(low->first, high->first);
}

/// Frames of one camera get the same principal point.
Grid common_grid(std::vector<Found>& found, Points points) {
    std::map<int, int> columns, rows;
    for (Found& frame : found) {
        View& view = frame.view;
        view.cx -= std::round(view.cx - found.front().view.cx);
        view.cy -= std::round(view.cy - found.front().view.cy);
        for (std::size_t i = frame.range.first; i < frame.range.last; ++i)
            if (view.holds(points[i])) {
                const Pixel at = pixel_of(view, points[i]);
                ++columns[at.u];
                ++rows[at.v];
            }
    }
    const auto [left, right] = usual_range(columns);
    const auto [top, bottom] = usual_range(rows);
    return {left, top, right, bottom};
}

/// Every point that is on a whole pixel of its frame takes it. Of two on one pixel the second has none.
void take_pixels(FoundFrames& result, const Found& frame, std::size_t index, Points points, const Grid& grid,
                 const std::function<std::size_t(std::size_t)>& number) {
    const cv::Size size = grid.size();
    std::vector<char> taken(static_cast<std::size_t>(size.area()), 0);
    for (std::size_t i = frame.range.first; i < frame.range.last; ++i) {
        if (!frame.view.holds(points[i]))
            continue;
        const Pixel at = pixel_of(frame.view, points[i]);
        if (!grid.has(at))
            continue;
        const int pixel = (at.v - grid.top) * size.width + at.u - grid.left;
        if (std::exchange(taken[static_cast<std::size_t>(pixel)], 1) != 0)
            continue;
        result.frame[number(i)] = static_cast<std::int32_t>(index);
        result.pixel[number(i)] = pixel;
    }
}

/// Of all points, none has a pixel.
FoundFrames without_pixels(std::size_t points) {
    return {{}, std::vector<std::int32_t>(points, -1), std::vector<std::int32_t>(points, -1), 0};
}

double share_on_pixels(const FoundFrames& found, std::size_t points) {
    const auto on_pixels = std::ranges::count_if(found.pixel, [](std::int32_t pixel) { return pixel >= 0; });
    return static_cast<double>(on_pixels) / static_cast<double>(std::max<std::size_t>(points, 1));
}

} // namespace

cv::Mat1f FoundFrames::depth(std::size_t index, Points points) const {
    const FoundFrame& of = frames[index];
    cv::Mat1f z(of.camera.size, 0.0F);
    const Isometry3d camera_from_world = of.world_from_camera.inverse();
    for (std::size_t i = of.first; i < of.last; ++i)
        if (frame[i] == static_cast<std::int32_t>(index))
            z(pixel[i] / z.cols, pixel[i] % z.cols) = static_cast<float>((camera_from_world * points[i]).z());
    return z;
}

std::optional<FoundFrames> found_frames(Points points) {
    constexpr std::size_t most_pixels = 50; // per point: images that are nearly all holes are none
    if (!has_frames(points))
        return std::nullopt;
    const FinitePoints all(points, {0, points.size()});
    const std::vector<Vector3d>& finite = all.points;
    std::vector<Found> found = all_frames(finite, all.grain);
    if (found.empty())
        return std::nullopt;
    share_cameras(found, finite, all.grain);
    const Grid grid = common_grid(found, finite);
    const cv::Size size = grid.size();
    const double pixels = static_cast<double>(size.width) * size.height * static_cast<double>(found.size());
    if (pixels > static_cast<double>(most_pixels * finite.size()))
        return std::nullopt;
    FoundFrames result = without_pixels(points.size());
    for (std::size_t i = 0; i < found.size(); ++i) {
        const View& view = found[i].view;
        const Range& range = found[i].range;
        FoundFrame made{{view.fx, view.fy, view.cx - grid.left, view.cy - grid.top, size},
                        view.world_from_camera,
                        all.numbers[range.first],
                        all.numbers[range.last - 1] + std::size_t(1)};
        made.world_from_camera.translation() += all.middle;
        result.frames.push_back(made);
        take_pixels(result, found[i], i, finite, grid, [&](std::size_t point) { return all.numbers[point]; });
    }
    result.share = share_on_pixels(result, finite.size());
    return result;
}

FoundFrames pixels_of(std::span<const FoundFrame> frames, Points points) {
    FoundFrames result = without_pixels(points.size());
    result.frames.assign(frames.begin(), frames.end());
    for (std::size_t i = 0; i < frames.size(); ++i) {
        const Pinhole& camera = frames[i].camera;
        const Found known{{frames[i].world_from_camera, camera.fx, camera.fy, camera.cx, camera.cy},
                          {frames[i].first, frames[i].last}};
        take_pixels(result, known, i, points, {0, 0, camera.size.width - 1, camera.size.height - 1},
                    [](std::size_t point) { return point; });
    }
    const auto finite = std::ranges::count_if(points, [](const Vector3d& point) { return point.allFinite(); });
    result.share = share_on_pixels(result, static_cast<std::size_t>(finite));
    return result;
}

} // namespace scanshade
