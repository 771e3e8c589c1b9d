#include "projection/first_view.h"

#include "projection/base/comb.h"
#include "projection/base/line_fit.h"
#include "projection/base/statistics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <Eigen/Dense>
#include <limits>
#include <numeric>
#include <utility>

namespace scanshade::frame_rows {

using Eigen::Isometry3d, Eigen::Matrix3d, Eigen::Vector2d, Eigen::Vector3d;

namespace {

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

} // namespace

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

} // namespace scanshade::frame_rows
