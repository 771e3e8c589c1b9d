// A picture of a cloud without a camera: two views that show different parts of it.
#include "apps/results/cloud_picture.h"

#include "ao/cloud/surface/leaf_neighbours.h"
#include "apps/picture.h"
#include "io/clouds/cloud_file.h"
#include "projection/attach.h"
#include "projection/base/hash.h"
#include "projection/base/indices_where.h"
#include "projection/base/statistics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <numeric>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>

namespace scanshade {
namespace {

using Eigen::Vector3d, Eigen::Vector3f;
constexpr double pi = std::numbers::pi;

// ---------------------------------------------------------------------------------------------------- the points drawn

/// The points drawn, relative to their median, and how far apart each stands from those around it.
struct Drawn {
    Vector3d middle = Vector3d::Zero();
    std::vector<std::uint32_t> index; ///< in the cloud
    std::vector<Vector3d> at;
    std::vector<float> spacing;
    std::vector<Vector3f> normals; ///< empty, or one per point; zero where there is none
};

Vector3d median_of(const std::vector<Vector3d>& points) {
    Vector3d middle;
    tbb::parallel_for(0, 3, [&](int axis) {
        std::vector<double> along(points.size());
        std::ranges::transform(points, along.begin(), [&](const Vector3d& point) { return point[axis]; });
        middle[axis] = median(std::move(along), 0.0);
    });
    return middle;
}

/// The side of a square that holds one point, from the eight nearest neighbours: a disc of their distance holds nine.
std::vector<float> spacing_of(const std::vector<Vector3d>& points) {
    constexpr std::size_t wanted = 8;
    std::vector<Vector3f> single(points.size());
    std::ranges::transform(points, single.begin(), [](const Vector3d& point) { return Vector3f(point.cast<float>()); });
    const NeighbourTree tree(single);
    std::vector<float> spacing(points.size(), 0.0F);
    for_each_neighbourhood(tree, wanted, [&](std::size_t index, std::span<const Nearest::Neighbour> near) {
        if (!near.empty())
            spacing[tree.original(index)] =
                std::sqrt(near.back().distance2 * static_cast<float>(pi) / static_cast<float>(near.size() + 1));
    });
    const float usual = median(spacing, 0.0F); // a stray point is far from all others, and yet no large thing
    for (float& each : spacing)
        each = std::min(each, 12 * usual);
    return spacing;
}

/// At most about so many of the points, without their spacing.
Drawn some_of(const Cloud& cloud, const PointVisibility& found, std::size_t most) {
    Drawn drawn;
    const std::vector<std::uint32_t> valid =
        indices_where(cloud.points.size(), [&](std::size_t i) { return cloud.points[i].allFinite(); });
    const double share =
        std::min(1.0, static_cast<double>(most) / static_cast<double>(std::max(valid.size(), std::size_t(1))));
    const auto chosen = static_cast<std::uint64_t>(share * 0x1p32);
    drawn.index = indices_where(valid, [&](std::uint32_t i) { return hash(i) < chosen; });
    drawn.at.resize(drawn.index.size());
    tbb::parallel_for(std::size_t(0), drawn.at.size(),
                      [&](std::size_t i) { drawn.at[i] = cloud.points[drawn.index[i]]; });
    drawn.middle = median_of(drawn.at);
    for (Vector3d& point : drawn.at)
        point -= drawn.middle;
    const auto give_normals = [&](const auto& of) {
        drawn.normals.resize(drawn.index.size());
        tbb::parallel_for(std::size_t(0), drawn.index.size(),
                          [&](std::size_t i) { drawn.normals[i] = of(drawn.index[i]); });
    };
    if (!found.normals.empty())
        give_normals([&](std::uint32_t i) { return found.normals[i]; });
    else if (const std::vector<Vector3d> recorded = recorded_normals(cloud); !recorded.empty())
        give_normals([&](std::uint32_t i) {
            return recorded[i].allFinite() ? Vector3f(recorded[i].cast<float>()) : Vector3f(Vector3f::Zero());
        });
    return drawn;
}

/// Enough of the points to choose views by, without their spacing.
Drawn few_of(const Drawn& drawn) {
    constexpr std::size_t enough = 20000;
    const std::size_t step = std::max<std::size_t>(1, drawn.at.size() / enough);
    Drawn few;
    few.middle = drawn.middle;
    for (std::size_t i = 0; i < drawn.at.size(); i += step) {
        few.index.push_back(drawn.index[i]);
        few.at.push_back(drawn.at[i]);
        if (!drawn.normals.empty())
            few.normals.push_back(drawn.normals[i]);
    }
    return few;
}

Drawn drawn_of(const Cloud& cloud, const PointVisibility& found) {
    Drawn drawn = some_of(cloud, found, most_drawn);
    drawn.spacing = spacing_of(drawn.at);
    return drawn;
}

// ---------------------------------------------------------------------------------------------------- what it is

struct Range {
    double low = 0, high = 0;
    [[nodiscard]] double length() const { return high - low; }
    [[nodiscard]] double at(double share) const { return low + share * length(); }
};

/// The distances of a sample of the points along a direction, without the lowest and highest hundredth.
Range range_along(const Drawn& drawn, const Vector3d& direction) {
    constexpr std::size_t enough = 20000;
    const std::size_t step = std::max<std::size_t>(1, drawn.at.size() / enough);
    std::vector<double> values;
    values.reserve(drawn.at.size() / step + 1);
    for (std::size_t i = 0; i < drawn.at.size(); i += step)
        values.push_back(drawn.at[i].dot(direction));
    const double low = quantile(values, 0.01);
    return {low, quantile(values, 0.99)};
}

/// Share of the points for which the predicate holds.
template <class Holds>
double share_of(std::size_t count, Holds&& holds) {
    std::size_t number = 0;
    for (std::size_t i = 0; i < count; ++i)
        number += holds(i);
    return count == 0 ? 0 : static_cast<double>(number) / static_cast<double>(count);
}

double share_facing(const Drawn& drawn, const Vector3d& eye) {
    if (drawn.normals.empty())
        return 0;
    return share_of(drawn.at.size(),
                    [&](std::size_t i) { return drawn.normals[i].cast<double>().dot(eye - drawn.at[i]) > 0; });
}

/// Evenly spread directions of a half sphere.
std::vector<Vector3d> half_sphere(int count) {
    std::vector<Vector3d> directions;
    for (int i = 0; i < count; ++i) {
        const double z = (i + 0.5) / count, turn = i * pi * (3 - std::sqrt(5.0)), r = std::sqrt(1 - z * z);
        directions.emplace_back(r * std::cos(turn), r * std::sin(turn), z);
    }
    return directions;
}

/// Up where the file's format does not say it: across the largest plane, and floors are larger than walls because rooms
/// and yards are wider than high. Axes win by a little. The sign is that of most normals, since floors are seen from
/// above, and more often than ceilings. z without a plane.
Vector3d up_across_largest_plane(const Drawn& drawn) {
    constexpr double within = 0.97; // 14 degrees
    constexpr double plane = 0.2;   // of the normals; those of a pole's sides have 0.16 in any horizontal direction
    if (drawn.normals.empty())
        return Vector3d::UnitZ();
    std::vector<Vector3d> candidates = half_sphere(150);
    const std::size_t others = candidates.size();
    for (const Vector3d& axis : {Vector3d(0, 0, 1), Vector3d(0, 1, 0), Vector3d(1, 0, 0)})
        candidates.push_back(axis);
    const std::size_t step = std::max<std::size_t>(1, drawn.at.size() / 20000);
    std::vector<double> scores(candidates.size(), -1.0);
    tbb::parallel_for(std::size_t(0), candidates.size(), [&](std::size_t c) {
        double alike = 0;
        for (std::size_t i = 0; i < drawn.normals.size(); i += step)
            alike += std::abs(drawn.normals[i].cast<double>().dot(candidates[c])) > within;
        if (alike * static_cast<double>(step) < plane * static_cast<double>(drawn.normals.size()))
            return;
        const double height = std::max(range_along(drawn, candidates[c]).length(), 1e-12);
        scores[c] = alike / height * (c < others ? 1 : c == others ? 1.5 : 1.2);
    });
    const auto highest = std::ranges::max_element(scores);
    if (*highest < 0) // no plane, so no floor
        return Vector3d::UnitZ();
    const Vector3d& best = candidates[static_cast<std::size_t>(highest - scores.begin())];
    double sign = 0;
    for (const Vector3f& normal : drawn.normals)
        if (const double along = normal.cast<double>().dot(best); std::abs(along) > within)
            sign += along;
    return sign < 0 ? Vector3d(-best) : best;
}

// ---------------------------------------------------------------------------------------------------- views

/// Where a point is seen, in units of the view: lengths, tangents or radians.
struct Seen {
    double x = 0, y = 0, depth = 0;
    double scale = 1; ///< view units per unit of length there
};

struct PictureView {
    enum class Kind { orthographic, perspective, panorama };
    Kind kind = Kind::orthographic;
    Vector3d eye = Vector3d::Zero();                    ///< relative to Drawn::middle
    Eigen::Matrix3d axes = Eigen::Matrix3d::Identity(); ///< rows: right, down, forward
    std::function<bool(const Vector3d&)> shown = [](const Vector3d&) { return true; };

    [[nodiscard]] std::optional<Seen> seen(const Vector3d& point) const {
        const Vector3d p = axes * (point - eye);
        if (kind == Kind::orthographic)
            return Seen{p.x(), p.y(), p.z(), 1};
        const double range = p.norm();
        if (!(range > 0) || (kind == Kind::perspective && p.z() < 0.2 * range)) // 78 degrees off the axis
            return std::nullopt;
        if (kind == Kind::perspective)
            return Seen{p.x() / p.z(), p.y() / p.z(), p.z(), 1 / p.z()};
        return Seen{std::atan2(p.x(), p.z()), std::atan2(p.y(), std::hypot(p.x(), p.z())), range, 1 / range};
    }
    /// From the point to the eye.
    [[nodiscard]] Vector3d back(const Vector3d& point) const {
        return kind == Kind::orthographic ? Vector3d(-axes.row(2).transpose()) : Vector3d((eye - point).normalized());
    }
};

Eigen::Matrix3d axes_along(const Vector3d& forward, const Vector3d& up) {
    Vector3d right = forward.cross(up);
    if (right.norm() < 1e-6)
        right = forward.unitOrthogonal();
    right.normalize();
    Eigen::Matrix3d axes;
    axes << right.transpose(), forward.cross(right).transpose(), forward.transpose();
    return axes;
}

/// The horizontal directions of largest and least extent.
struct Ground {
    Vector3d up, wide, deep;
};

Ground ground_of(const Drawn& drawn, const Vector3d& up) {
    const Vector3d first = up.unitOrthogonal(), second = up.cross(first);
    Ground ground{up, first, second};
    double least = std::numeric_limits<double>::infinity();
    constexpr std::size_t steps = 36;
    std::array<Vector3d, steps> directions;
    std::array<double, steps> lengths{};
    tbb::parallel_for(std::size_t(0), steps, [&](std::size_t step) {
        const double turn = static_cast<double>(step) * pi / steps;
        directions[step] = std::cos(turn) * first + std::sin(turn) * second;
        lengths[step] = range_along(drawn, directions[step]).length();
    });
    for (std::size_t step = 0; step < steps; ++step) {
        const Vector3d& deep = directions[step];
        if (lengths[step] < least) {
            least = lengths[step];
            ground.deep = deep;
            ground.wide = deep.cross(up).normalized();
        }
    }
    return ground;
}

/// From outside: across the wide side, turned by `turn`, looking down by `tilt` (radians).
PictureView oblique(const Ground& ground, double turn, double tilt) {
    const Vector3d level = std::cos(turn) * ground.deep + std::sin(turn) * ground.wide;
    PictureView view;
    view.axes = axes_along(std::cos(tilt) * level - std::sin(tilt) * ground.up, ground.up);
    return view;
}

/// A room opened: the floor, and what is behind the middle below the ceiling.
PictureView dollhouse(const Drawn& drawn, const Ground& ground) {
    PictureView view = oblique(ground, pi / 6, 40 * pi / 180);
    const Vector3d forward = view.axes.row(2), level = (forward - forward.dot(ground.up) * ground.up).normalized();
    const Range height = range_along(drawn, ground.up), depth = range_along(drawn, level);
    view.shown = [up = ground.up, level, floor = height.at(0.2), ceiling = height.at(0.9),
                  middle = depth.at(0.4)](const Vector3d& point) {
        const double high = point.dot(up);
        return high < floor || (high < ceiling && point.dot(level) > middle);
    };
    return view;
}

PictureView panorama(const Vector3d& eye, const Ground& ground) {
    PictureView view;
    view.kind = PictureView::Kind::panorama;
    view.eye = eye;
    view.axes = axes_along(ground.wide, ground.up);
    return view;
}

/// Whether nearly all points are within 50 degrees of the line from the eye to their median, so that one image shows
/// them.
bool seen_in_one_image(const Drawn& drawn, const Vector3d& eye) {
    if (!(eye.norm() > 0))
        return false;
    const Vector3d forward = -eye.normalized();
    return share_of(drawn.at.size(), [&](std::size_t i) {
               const Vector3d ray = drawn.at[i] - eye;
               return ray.dot(forward) > 0.64 * ray.norm();
           }) > 0.97;
}

/// Whether the points are all round the eye: their directions cancel out.
bool surrounded(const Drawn& drawn, const Vector3d& eye) {
    Vector3d sum = Vector3d::Zero();
    for (const Vector3d& point : drawn.at)
        if (const Vector3d ray = point - eye; ray.norm() > 0)
            sum += ray.normalized();
    return sum.norm() < 0.6 * static_cast<double>(drawn.at.size());
}

/// Whether walls rise above the eye on nearly all sides.
bool enclosed(const Drawn& drawn, const Vector3d& eye, const Ground& ground) {
    std::array<std::size_t, 12> above{};
    for (const Vector3d& point : drawn.at) {
        const Vector3d ray = point - eye;
        if (ray.dot(ground.up) <= 0)
            continue;
        const double turn = std::atan2(ray.dot(ground.deep), ray.dot(ground.wide)) / (2 * pi) + 0.5;
        ++above[static_cast<std::size_t>(turn * 12) % above.size()];
    }
    return std::ranges::count_if(above, [&](std::size_t count) { return 200 * count > drawn.at.size(); }) >= 10;
}

/// The side that shows most fronts of surfaces, and the one that shows most among those at least 90 degrees away; the
/// opposite one if all show as many.
std::array<PictureView, 2> two_sides(const Drawn& drawn, const Ground& ground) {
    constexpr int turns = 12;
    constexpr double tilt = 25 * pi / 180;
    std::array<PictureView, turns> views;
    std::array<double, turns> fronts{};
    tbb::parallel_for(0, turns, [&](int turn) {
        views[turn] = oblique(ground, pi / 6 + 2 * pi * turn / turns, tilt);
        const Vector3f back = -views[turn].axes.row(2).transpose().cast<float>();
        fronts[turn] = share_of(drawn.normals.size(), [&](std::size_t i) { return drawn.normals[i].dot(back) > 0.2F; });
    });
    const auto better_than = [&](double& most, double value) { return value > most + 0.02 && (most = value, true); };
    int first = 0, second = turns / 2;
    double most = fronts[0];
    for (int turn = 1; turn < turns; ++turn)
        if (better_than(most, fronts[turn]))
            first = turn;
    second = (first + turns / 2) % turns;
    most = fronts[second];
    for (int apart = turns / 4; apart <= 3 * turns / 4; ++apart)
        if (const int turn = (first + apart) % turns; better_than(most, fronts[turn]))
            second = turn;
    return {views[first], views[second]};
}

/// Where the cloud was seen from, and how much of the world around.
struct Eye {
    enum class Sees { unknown, one_image, all_round };
    Sees sees = Sees::unknown;
    Vector3d at = Vector3d::Zero();
};

Eye eye_of(const Drawn& drawn, const std::optional<Vector3d>& recorded) {
    constexpr double nearly_all = 0.95;
    const bool is_recorded = recorded && recorded->norm() > 0; // zeros are what programs write that know no better
    const Vector3d eye = is_recorded ? Vector3d(*recorded - drawn.middle) : Vector3d(-drawn.middle);
    if (!is_recorded && share_facing(drawn, eye) < nearly_all)
        return {};
    if (seen_in_one_image(drawn, eye))
        return {Eye::Sees::one_image, eye};
    return {surrounded(drawn, eye) ? Eye::Sees::all_round : Eye::Sees::unknown, eye};
}

Vector3d up_of(const Cloud& cloud, const Drawn& drawn, const Eye& eye) {
    // A camera's cloud has y down and z forward, whatever its planes.
    const bool y_down = eye.sees == Eye::Sees::one_image && -eye.at.z() > 0.5 * eye.at.norm();
    return z_is_up(cloud) ? Vector3d(0, 0, 1) : y_down ? Vector3d(0, -1, 0) : up_across_largest_plane(drawn);
}

std::array<PictureView, 2> views_of(const Cloud& cloud, const Drawn& drawn, const std::optional<Vector3d>& recorded) {
    const Eye eye = eye_of(drawn, recorded);
    const bool camera = eye.sees == Eye::Sees::one_image;
    const Vector3d up = up_of(cloud, drawn, eye);
    const Ground ground = ground_of(drawn, up);
    if (camera) {
        PictureView front, side;
        front.kind = PictureView::Kind::perspective;
        front.eye = eye.at;
        const Vector3d forward = -eye.at.normalized();
        front.axes = axes_along(forward, up);
        const Vector3d turned = Eigen::AngleAxisd(pi / 4, up) * forward;
        side.axes = axes_along((turned - 0.5 * up).normalized(), up);
        return {front, side};
    }
    const Range height = range_along(drawn, up), wide = range_along(drawn, ground.wide),
                deep = range_along(drawn, ground.deep);
    const bool flat = height.length() < 0.25 * wide.length();
    const PictureView outside = oblique(ground, pi / 6, 35 * pi / 180);
    if (eye.sees == Eye::Sees::all_round)
        return {panorama(eye.at, ground), flat ? outside : dollhouse(drawn, ground)};
    if (flat) {
        PictureView above;
        above.axes = axes_along(-up, ground.deep);
        return {outside, above};
    }
    const Vector3d middle = height.at(0.5) * up + wide.at(0.5) * ground.wide + deep.at(0.5) * ground.deep;
    if (share_facing(drawn, middle) > 0.6 && enclosed(drawn, middle, ground))
        return {panorama(middle, ground), dollhouse(drawn, ground)};
    return two_sides(drawn, ground);
}

// ---------------------------------------------------------------------------------------------------- drawing

/// Maps view units to pixels of an image that holds nearly all points.
struct Raster {
    cv::Size size;
    double px_per_unit = 1, x = 0, y = 0; ///< what the pixel (0, 0) sees
};

/// The quantiles of some, widened by a tenth where there are points, and a border.
Range framed(const std::vector<double>& values) {
    constexpr std::size_t enough = 50000;
    std::vector<double> some;
    for (std::size_t i = 0; i < values.size(); i += std::max<std::size_t>(1, values.size() / enough))
        some.push_back(values[i]);
    const double lowest = quantile(some, 0.01);
    const Range usual{lowest, quantile(some, 0.99)};
    const auto [low, high] = std::ranges::minmax(values);
    const double slack = 0.1 * usual.length(), border = 0.02 * usual.length();
    return {std::max(low, usual.low - slack) - border, std::min(high, usual.high + slack) + border};
}

Raster raster_of(const std::vector<std::optional<Seen>>& seen, PictureView::Kind kind) {
    std::vector<double> x, y;
    for (const auto& each : seen)
        if (each) {
            x.push_back(each->x);
            y.push_back(each->y);
        }
    if (x.empty())
        return {};
    Range across, down;
    tbb::parallel_invoke([&] { across = framed(x); }, [&] { down = framed(y); });
    const bool panorama = kind == PictureView::Kind::panorama;
    const int widest = panorama ? 1800 : 900, highest = 900;
    const double largest = std::max({across.length(), down.length(), 1e-9});
    const double px_per_unit =
        std::min(widest / std::max(across.length(), 1e-3 * largest), highest / std::max(down.length(), 1e-3 * largest));
    const auto pixels = [&](double length, int most) {
        return std::clamp(static_cast<int>(std::ceil(length * px_per_unit)), 32, most);
    };
    const cv::Size size(pixels(across.length(), widest), pixels(down.length(), highest));
    return {size, px_per_unit, across.at(0.5) - size.width / (2 * px_per_unit),
            down.at(0.5) - size.height / (2 * px_per_unit)};
}

/// Points in cells of the image, of 8, 16, 32 and 64 pixels: how far apart they stand there.
class Density {
  public:
    explicit Density(cv::Size size) {
        for (std::size_t level = 0; level < counts_.size(); ++level)
            counts_[level] = cv::Mat1i((size.height >> (level + 3)) + 1, (size.width >> (level + 3)) + 1, 0);
    }
    void add(int u, int v) {
        for (std::size_t level = 0; level < counts_.size(); ++level)
            ++counts_[level](v >> (level + 3), u >> (level + 3));
    }
    /// Pixels; 0 for a lonely point.
    [[nodiscard]] double spacing(int u, int v) const {
        constexpr int enough = 4;
        for (std::size_t level = 0; level < counts_.size(); ++level)
            if (const int count = counts_[level](v >> (level + 3), u >> (level + 3)); count >= enough)
                return (8 << level) / std::sqrt(count);
        return 0;
    }

  private:
    std::array<cv::Mat1i, 4> counts_;
};

/// The distance of two pixels, whose coordinates differ by at most the largest splat's radius.
double offset_px(int across, int down) {
    static const auto known = [] {
        std::array<std::array<double, 64>, 64> all;
        for (int y = 0; y < 64; ++y)
            for (int x = 0; x < 64; ++x)
                all[static_cast<std::size_t>(y)][static_cast<std::size_t>(x)] = std::hypot(x, y);
        return all;
    }();
    return known[static_cast<std::size_t>(std::abs(down))][static_cast<std::size_t>(std::abs(across))];
}

/// A point as it is drawn.
struct Splat {
    cv::Point centre;
    double radius_px = 0, depth = 0, length_per_px = 0; ///< no radius: not drawn
    cv::Vec3b colour;
    float visibility = 0;
};

/// The picture of one view. The nearest splat wins; a splat is a cone, so that of two on one surface the pixel gets the
/// closer one.
struct Canvas {
    explicit Canvas(cv::Size size)
        : colour(size, nothing_there), visibility(size, std::numeric_limits<float>::quiet_NaN()),
          depth(size, std::numeric_limits<float>::infinity()) {}

    /// Only what is within `rows`.
    void draw(const Splat& splat, const cv::Range& rows) {
        const auto reach = static_cast<int>(splat.radius_px);
        const cv::Point centre = splat.centre;
        for (int y = std::max(centre.y - reach, rows.start); y <= std::min(centre.y + reach, rows.end - 1); ++y)
            for (int x = std::max(centre.x - reach, 0); x <= std::min(centre.x + reach, depth.cols - 1); ++x) {
                const double off = offset_px(x - centre.x, y - centre.y);
                const auto z = static_cast<float>(splat.depth + off * splat.length_per_px);
                if (off > splat.radius_px || z >= depth(y, x))
                    continue;
                depth(y, x) = z;
                colour(y, x) = std::isnan(splat.visibility) ? nothing_there : splat.colour;
                visibility(y, x) = splat.visibility;
            }
    }

    static inline const cv::Vec3b nothing_there{64, 40, 28};
    cv::Mat3b colour;
    cv::Mat1f visibility, depth;
};

Canvas drawing_of(const Cloud& cloud, const PointVisibility& found, const Drawn& drawn, const PictureView& view) {
    constexpr double overlap = 0.9; // of the spacing: more than half a square's diagonal, since neighbours are uneven
    const std::size_t count = drawn.at.size();
    std::vector<std::optional<Seen>> seen(count);
    tbb::parallel_for(std::size_t(0), count, [&](std::size_t i) {
        if (view.shown(drawn.at[i]))
            seen[i] = view.seen(drawn.at[i]);
    });
    const Raster raster = raster_of(seen, view.kind);
    if (raster.size.empty())
        return Canvas({32, 32});
    std::vector<Splat> splats(count);
    std::vector<double> own_px(count, 0.0); // radii from the distances in space
    const cv::Point outside(-1, -1);
    tbb::parallel_for(std::size_t(0), count, [&](std::size_t i) {
        splats[i].centre = outside;
        if (!seen[i])
            return;
        own_px[i] = overlap * double{drawn.spacing[i]} * seen[i]->scale * raster.px_per_unit;
        const double u = (seen[i]->x - raster.x) * raster.px_per_unit, v = (seen[i]->y - raster.y) * raster.px_per_unit;
        if (u >= 0 && v >= 0 && u < raster.size.width && v < raster.size.height)
            splats[i].centre = {static_cast<int>(u), static_cast<int>(v)};
    });
    Density density(raster.size);
    for (const Splat& splat : splats)
        if (splat.centre != outside)
            density.add(splat.centre.x, splat.centre.y);
    const double largest_px = std::clamp(2.5 * median(own_px, 0.0), 6.0, 40.0);
    const bool coloured = has_colours(cloud);
    tbb::parallel_for(std::size_t(0), count, [&](std::size_t i) {
        Splat& splat = splats[i];
        if (splat.centre == outside)
            return;
        const double around = overlap * density.spacing(splat.centre.x, splat.centre.y);
        splat.radius_px = std::min(std::max(own_px[i], std::min(around, 3 * own_px[i] + 1)) + 0.5, largest_px);
        splat.depth = seen[i]->depth;
        splat.length_per_px = 1 / (seen[i]->scale * raster.px_per_unit);
        splat.colour = cv::Vec3b::all(205);
        if (coloured)
            splat.colour = cloud.colours[drawn.index[i]];
        else if (!drawn.normals.empty())
            splat.colour = cv::Vec3b::all(cv::saturate_cast<uchar>(
                70 + 165 * std::abs(drawn.normals[i].cast<double>().dot(view.back(drawn.at[i])))));
        splat.visibility = found.visibility[drawn.index[i]];
    });
    Canvas canvas(raster.size);
    constexpr int bands = 8; // each is drawn by one thread, in the order of the points
    tbb::parallel_for(0, bands, [&](int band) {
        const cv::Range rows(raster.size.height * band / bands, raster.size.height * (band + 1) / bands);
        for (const Splat& splat : splats)
            if (splat.radius_px > 0)
                canvas.draw(splat, rows);
    });
    return canvas;
}

/// The images in a row or, where they are wide, in a column.
cv::Mat3b both(const cv::Mat3b& first, const cv::Mat3b& second) {
    cv::Mat3b joined;
    first.cols > 900 ? cv::vconcat(first, second, joined) : cv::hconcat(first, second, joined);
    return joined;
}

} // namespace

Vector3d up_of(const Cloud& cloud, const PointVisibility& found, const std::optional<Vector3d>& viewpoint) {
    constexpr std::size_t enough = 8000;
    const Drawn drawn = some_of(cloud, found, enough);
    return drawn.at.empty() ? Vector3d(0, -1, 0) : up_of(cloud, drawn, eye_of(drawn, viewpoint));
}

cv::Mat3b cloud_picture(const Cloud& cloud, const PointVisibility& found, const std::optional<Vector3d>& viewpoint,
                        double strength) {
    const Drawn drawn = drawn_of(cloud, found);
    const std::array<PictureView, 2> views = views_of(cloud, few_of(drawn), viewpoint);
    std::array<cv::Mat3b, 2> rows;
    tbb::parallel_for(std::size_t(0), rows.size(), [&](std::size_t i) {
        const Canvas canvas = drawing_of(cloud, found, drawn, views[i]);
        rows[i] = both(shade(canvas.colour, canvas.visibility, strength), visibility_picture(canvas.visibility));
    });
    constexpr int gap = 8;
    const int width = std::max(rows[0].cols, rows[1].cols);
    cv::Mat3b picture(rows[0].rows + gap + rows[1].rows, width, Canvas::nothing_there);
    rows[0].copyTo(picture(cv::Rect((width - rows[0].cols) / 2, 0, rows[0].cols, rows[0].rows)));
    rows[1].copyTo(picture(cv::Rect((width - rows[1].cols) / 2, rows[0].rows + gap, rows[1].cols, rows[1].rows)));
    return picture;
}

} // namespace scanshade
