#include "projection/found_frames.h"

#include "projection/first_view.h"

#include <algorithm>
#include <cmath>
#include <Eigen/Dense>
#include <functional>
#include <limits>
#include <map>
#include <utility>

namespace scanshade {
namespace {

using Eigen::Isometry3d, Eigen::Matrix3d, Eigen::Vector2d, Eigen::Vector3d;
using frame_rows::Points, frame_rows::Row, frame_rows::Core, frame_rows::View, frame_rows::pixel_tolerance;
using frame_rows::rows_of, frame_rows::core_of, frame_rows::first_view, frame_rows::grain_of;

constexpr std::size_t enough_of_frame = 4000; ///< points that tell its camera

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
