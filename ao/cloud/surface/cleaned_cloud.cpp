// Cleaning in three steps: planes of seeds, points onto planes, discs onto discs.
#include "ao/cloud/surface/cleaned_cloud.h"

#include "ao/cloud/surface/moments.h"
#include "projection/base/hash.h"
#include "projection/base/statistics.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <Eigen/Geometry>
#include <limits>
#include <numbers>
#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

namespace scanshade {
namespace {

using Eigen::Vector3d, Eigen::Vector3f;

constexpr float thinnest = 0.2F;    ///< sigma / radius of a ball that holds a slab. Isotropic blobs have 0.45
constexpr float growth = 1.35F;     ///< from one ball to the next
constexpr float one_surface = 0.5F; ///< cosine between normals, at least
constexpr std::size_t few = 24;     ///< planes that a point chooses from
constexpr std::size_t in_ball = 80; ///< points that tell a plane: of more, a part is asked

/// The normals of points, some of which may have none (zero).
struct PointNormals {
    std::vector<Vector3f> normals; ///< by index in the tree, or empty

    [[nodiscard]] Vector3f of(std::size_t index) const {
        return normals.empty() ? Vector3f(Vector3f::Zero()) : normals[index];
    }
    /// 1 where one of them has no direction.
    [[nodiscard]] float cosine(const Vector3f& a, const Vector3f& b) const {
        if (a.isZero() || b.isZero())
            return 1;
        return a.dot(b);
    }
};

/// Points, and parts of them by a hash of their positions: a quarter, a sixteenth ... Balls of any size then hold about
/// as many. A part of a cloud has the same parts.
class Pyramid {
  public:
    Pyramid(const NeighbourTree& tree, std::span<const Vector3d> points) : tree_(tree) {
        if (points.empty())
            return;
        std::vector<std::uint32_t> left(tree.size());
        for (std::size_t i = 0; i < left.size(); ++i)
            left[i] = static_cast<std::uint32_t>(i);
        for (std::uint32_t level = 1; level <= levels && left.size() > 16 * in_ball; ++level) {
            std::erase_if(left, [&](std::uint32_t index) {
                std::uint32_t mixed = level;
                for (const double along : points[tree.original(index)]) {
                    const auto bits = std::bit_cast<std::uint64_t>(along);
                    mixed = hash(hash(static_cast<std::uint32_t>(bits), mixed), static_cast<std::uint32_t>(bits >> 32));
                }
                return mixed % 4 != 0;
            });
            std::vector<Vector3f> positions;
            for (const std::uint32_t index : left)
                positions.push_back(tree[index]);
            parts_.push_back({NeighbourTree(positions), left});
        }
    }

    /// The indices of about `in_ball` points within the ball, or of all there are. Returns how many points each stands
    /// for. `level` is where the search starts, and ends.
    float some_within(const Vector3f& at, float radius, std::size_t& level, std::vector<std::uint32_t>& found) const {
        constexpr std::size_t many = 5 * in_ball / 2, scarce = in_ball / 2;
        level = std::min(level, parts_.size());
        for (bool coarser = false;;) {
            found.clear();
            in(level).for_each_within(at, radius, [&](std::size_t index) {
                found.push_back(level == 0 ? static_cast<std::uint32_t>(index)
                                           : parts_[level - 1].index[parts_[level - 1].tree.original(index)]);
            });
            if (found.size() > many && level < parts_.size())
                ++level, coarser = true;
            else if (found.size() < scarce && level > 0 && !coarser)
                --level;
            else
                break;
        }
        return static_cast<float>(std::uint64_t(1) << (2 * level));
    }

    [[nodiscard]] const NeighbourTree& all() const { return tree_; }

  private:
    static constexpr std::uint32_t levels = 6;
    struct Part {
        NeighbourTree tree;
        std::vector<std::uint32_t> index; ///< in the tree of all, by number of the point
    };
    [[nodiscard]] const NeighbourTree& in(std::size_t level) const {
        return level == 0 ? tree_ : parts_[level - 1].tree;
    }
    const NeighbourTree& tree_;
    std::vector<Part> parts_;
};

/// The plane of a window, and how far points scatter about it.
struct WindowPlane {
    Vector3f at, normal;
    float radius = 0, scatter = 0; ///< of the window; one sigma. A radius of 0: there is none
    float spacing = 0;             ///< of the points if they lay in the plane
};

/// Robust planes of balls (Tukey's weights of 3 sigma, by the median).
class Windows {
  public:
    Windows(const Pyramid& points, const PointNormals& facing, float widest)
        : points_(points), facing_(facing), widest_(widest) {}

    /// The first of growing balls that holds a slab.
    [[nodiscard]] WindowPlane around(std::size_t index) {
        constexpr std::size_t first = 32;
        const Vector3f facing = facing_.of(index);
        Nearest nearest;
        points_.all().find_round(index, first, nearest);
        if (nearest.all().empty() || !(nearest.all().back().distance2 > 0))
            return {};
        std::size_t level = 0;
        for (float radius = std::sqrt(nearest.all().back().distance2); radius <= widest_;) {
            Fit fit = fitted(points_.all()[index], facing, radius, level);
            if (fit.is_slab) { // about the plane, so that the window is as wide on both sides
                const std::size_t before = level;
                Fit again = fitted(fit.plane.at, facing, radius, level);
                if (again.is_slab)
                    return again.plane;
                level = before;
            }
            // Wider balls are no thinner: what could not hold this slab is left out.
            radius *= growth;
            while (radius <= widest_ && radius * thinnest < 0.8F * fit.plane.scatter)
                radius *= growth;
        }
        return {};
    }

  private:
    struct Fit {
        WindowPlane plane;
        bool is_slab = false;
    };

    Fit fitted(const Vector3f& at, const Vector3f& facing, float radius, std::size_t& level) {
        offsets_.clear(), weights_.clear(), normals_.clear();
        const float each = points_.some_within(at, radius, level, found_);
        for (const std::uint32_t index : found_) {
            const Vector3f normal = facing_.of(index);
            if (facing_.cosine(normal, facing) < one_surface)
                continue;
            offsets_.push_back((points_.all()[index] - at) / radius);
            const float inside = 1 - 0.8F * offsets_.back().squaredNorm();
            weights_.push_back(inside * inside);
            if (!facing.isZero())
                normals_.push_back(normal.dot(facing) < 0 ? Vector3f(-normal) : normal);
        }
        constexpr std::size_t fewest = 12;
        if (offsets_.size() < fewest)
            return {};
        Vector3f normal = Vector3f::Zero(), middle = Vector3f::Zero();
        robust_ = weights_;
        float scatter = 0;
        Vector3f variances = Vector3f::Zero();
        for (int round = 0;; ++round) {
            constexpr int last = 2;
            Moments moments;
            Vector3f recorded = Vector3f::Zero();
            const bool spread = normals_.empty() || round == last;
            for (std::size_t k = 0; k < offsets_.size(); ++k) {
                if (spread) {
                    moments.add(offsets_[k], robust_[k]);
                } else {
                    moments.weight += robust_[k];
                    moments.sum += robust_[k] * offsets_[k];
                }
                if (!normals_.empty())
                    recorded += robust_[k] * normals_[k];
            }
            if (!(moments.weight > 0))
                return {};
            middle = moments.mean();
            if (spread) {
                const PrincipalAxes axes(moments.covariance());
                normal = axes.normal, variances = axes.variances;
            }
            if (!recorded.isZero())
                normal = recorded.stableNormalized();
            across_.resize(offsets_.size());
            for (std::size_t k = 0; k < offsets_.size(); ++k)
                across_[k] = std::abs((offsets_[k] - middle).dot(normal));
            sorted_.assign(across_.begin(), across_.end());
            const auto half = sorted_.begin() + static_cast<std::ptrdiff_t>(sorted_.size() / 2);
            std::nth_element(sorted_.begin(), half, sorted_.end());
            scatter = 1.4826F * *half;
            if (round == last)
                break;
            for (std::size_t k = 0; k < offsets_.size(); ++k) {
                const float far = scatter > 0 ? across_[k] / (3 * scatter) : across_[k] > 0;
                robust_[k] = far < 1 ? weights_[k] * (1 - far * far) * (1 - far * far) : 0;
            }
        }
        constexpr float narrowest = 0.2F; // no line
        Fit fit;
        const float off = (middle).dot(normal); // the seed moves along the normal only
        const float area = std::numbers::pi_v<float> * radius * radius;
        fit.plane = {at + radius * off * normal, normal, radius, scatter * radius,
                     std::sqrt(area / (each * static_cast<float>(offsets_.size())))};
        fit.is_slab = scatter < thinnest && std::sqrt(variances[1]) > narrowest;
        return fit;
    }

    const Pyramid& points_;
    const PointNormals& facing_;
    float widest_;
    std::vector<Vector3f> offsets_, normals_; ///< of the points in the ball, in radii
    std::vector<float> weights_, robust_, across_, sorted_;
    std::vector<std::uint32_t> found_;
};

PointNormals facing_of(const NeighbourTree& tree, std::span<const Vector3d> normals) {
    PointNormals facing;
    facing.normals.resize(normals.empty() ? 0 : tree.size());
    tbb::parallel_for(std::size_t(0), facing.normals.size(),
                      [&](std::size_t i) { facing.normals[i] = unit_normal(normals[tree.original(i)]); });
    return facing;
}

/// The direction of a normal, of six or, without signs, of three.
std::uint64_t direction_of(const Vector3f& normal, bool sides) {
    int axis = 0;
    normal.cwiseAbs().maxCoeff(&axis);
    return static_cast<std::uint64_t>(2 * axis + (sides && normal[axis] < 0));
}

/// The number of a voxel. What is farther than a million voxels from the origin shares numbers.
std::uint64_t voxel(const Vector3d& point, const Vector3d& origin, double side) {
    std::uint64_t number = 0;
    for (int axis = 0; axis < 3; ++axis)
        number = number << 19 | (static_cast<std::uint64_t>(static_cast<std::int64_t>(
                                     std::floor(std::clamp((point[axis] - origin[axis]) / side, -1e9, 1e9)))) &
                                 0x7ffff);
    return number;
}

struct Keyed {
    std::uint64_t key;
    std::uint32_t original, index;

    bool operator<(const Keyed& other) const { return key != other.key ? key < other.key : original < other.original; }
};

std::vector<Vector3f> positions_of(std::span<const WindowPlane> planes) {
    std::vector<Vector3f> all(planes.size());
    std::transform(planes.begin(), planes.end(), all.begin(), [](const WindowPlane& plane) { return plane.at; });
    return all;
}

/// Planes, each with the noise that is usual around it.
struct Seeds {
    std::vector<WindowPlane> planes; ///< good ones: they hold no relief
    std::vector<float> sigma;
    NeighbourTree tree{{}}; ///< of their positions
};

class Cleaning {
  public:
    Cleaning(const LocalCloud& local, std::span<const Vector3d> points, std::span<const Vector3d> normals,
             double radius, const ThinningGrid& grid)
        : tree_(local.tree), middle_(local.middle), points_(points), with_normals_(!normals.empty()),
          facing_(facing_of(local.tree, normals)), radius_(static_cast<float>(radius)), grid_(grid) {}

    FittedCloud run() {
        Seeds seeds = good(planes_of_seeds());
        if (seeds.planes.empty())
            return {};
        move(seeds);
        take_together();
        project();
        return gathered();
    }

  private:
    /// A point on its plane.
    struct Moved {
        Vector3f at, normal = Vector3f::Zero(); ///< zero: alone
        float sigma = 0, spacing = 0;
    };
    struct Disc {
        Vector3f at, normal;
        float sigma, side;
        std::uint32_t count; ///< of its points
    };

    [[nodiscard]] std::vector<WindowPlane> planes_of_seeds() const {
        constexpr double voxels = 8; // of the radius
        std::vector<Keyed> keyed(tree_.size());
        tbb::parallel_for(std::size_t(0), keyed.size(), [&](std::size_t i) {
            const std::uint32_t original = tree_.original(i);
            const std::uint64_t direction = with_normals_ ? direction_of(facing_.normals[i], true) : 6;
            keyed[i] = {voxel(points_[original], grid_.origin, static_cast<double>(radius_) / voxels) << 3 | direction,
                        original, static_cast<std::uint32_t>(i)};
        });
        tbb::parallel_sort(keyed.begin(), keyed.end());
        std::vector<std::uint32_t> seeds;
        for (std::size_t k = 0; k < keyed.size(); ++k)
            if (k == 0 || keyed[k].key != keyed[k - 1].key)
                seeds.push_back(keyed[k].index);
        tbb::parallel_sort(seeds.begin(), seeds.end()); // close ones ask for the same points
        const Pyramid pyramid(tree_, points_);
        std::vector<WindowPlane> planes(seeds.size());
        tbb::parallel_for(tbb::blocked_range<std::size_t>(0, seeds.size(), 64), [&](const auto& range) {
            Windows windows(pyramid, facing_, 0.7F * radius_);
            for (std::size_t k = range.begin(); k < range.end(); ++k)
                planes[k] = windows.around(seeds[k]);
        });
        std::erase_if(planes, [](const WindowPlane& plane) { return !(plane.radius > 0); });
        return planes;
    }

    /// Those that scatter no more than is usual near by: others hold relief.
    [[nodiscard]] static Seeds good(std::vector<WindowPlane> planes) {
        constexpr std::size_t step = 4, near = 24;
        constexpr double usual = 0.4;
        constexpr float relief = 1.6F;
        std::vector<WindowPlane> some;
        for (std::size_t k = 0; k < planes.size(); k += step)
            some.push_back(planes[k]);
        const NeighbourTree tree(positions_of(some));
        std::vector<float> sigma(planes.size());
        tbb::parallel_for(std::size_t(0), planes.size(), [&](std::size_t k) {
            Nearest nearest;
            tree.find_near(planes[k].at, near, nearest);
            std::vector<float> scatter;
            for (const auto& [distance2, index] : nearest.all())
                scatter.push_back(some[tree.original(index)].scatter);
            sigma[k] = quantile(scatter, usual);
        });
        Seeds seeds;
        for (std::size_t k = 0; k < planes.size(); ++k)
            if (planes[k].scatter < relief * sigma[k]) {
                seeds.planes.push_back(planes[k]);
                seeds.sigma.push_back(sigma[k]);
            }
        seeds.tree = NeighbourTree(positions_of(seeds.planes));
        return seeds;
    }

    void move(const Seeds& seeds) {
        moved_.resize(tree_.size());
        tbb::parallel_for(tbb::blocked_range<std::size_t>(0, moved_.size(), 256), [&](const auto& range) {
            Nearest nearest;
            for (std::size_t i = range.begin(); i < range.end(); ++i) {
                const auto known = nearest.all();
                float reach = std::numeric_limits<float>::infinity();
                if (i > range.begin() && known.size() == few)
                    reach = (std::sqrt(known.back().distance2) + (tree_[i] - tree_[i - 1]).norm()) * (1 + 1e-5F);
                seeds.tree.find_near(tree_[i], few, nearest, reach * reach);
                moved_[i] = onto_planes(i, seeds, nearest.all());
            }
        });
    }

    [[nodiscard]] Moved onto_planes(std::size_t i, const Seeds& seeds,
                                    std::span<const Nearest::Neighbour> nearest) const {
        const Vector3f &at = tree_[i], own = facing_.of(i);
        const auto in_plane2 = [](const Vector3f& apart, float off) { return apart.squaredNorm() - off * off; };
        std::size_t chosen = seeds.planes.size();
        float least = std::numeric_limits<float>::infinity();
        for (const auto& each : nearest) {
            const std::size_t k = seeds.tree.original(each.point);
            const WindowPlane& plane = seeds.planes[k];
            const float cosine = facing_.cosine(own, plane.normal);
            if (cosine < one_surface)
                continue;
            const Vector3f apart = at - plane.at;
            const float off = apart.dot(plane.normal), scale = 3 * std::max(seeds.sigma[k], plane.scatter);
            const float cost = off * off / (scale * scale) +
                               0.5F * in_plane2(apart, off) / (plane.radius * plane.radius) +
                               0.3F * std::max(0.0F, plane.scatter / seeds.sigma[k] - 1) + (1 - cosine);
            if (cost < least)
                least = cost, chosen = k;
        }
        if (chosen == seeds.planes.size())
            return {at};
        const WindowPlane& best = seeds.planes[chosen];
        const float off = (at - best.at).dot(best.normal), sigma = seeds.sigma[chosen];
        const float usual = std::max(sigma, best.scatter);
        float sum = 0, weights = 0;
        Vector3f normal = Vector3f::Zero();
        for (const auto& each : nearest) {
            const WindowPlane& plane = seeds.planes[seeds.tree.original(each.point)];
            constexpr float alike = 0.9F;
            const float cosine = plane.normal.dot(best.normal);
            if ((with_normals_ ? cosine : std::abs(cosine)) < alike)
                continue;
            const Vector3f apart = at - plane.at;
            const Vector3f facing = cosine < 0 ? Vector3f(-plane.normal) : plane.normal;
            const float there = apart.dot(facing), far = (there - off) / (2 * usual);
            if (!(std::abs(far) < 1))
                continue;
            const float weight = std::exp(-2 * in_plane2(apart, there) / (plane.radius * plane.radius)) *
                                 (1 - far * far) * (1 - far * far);
            sum += weight * there, weights += weight;
            normal += weight * facing;
        }
        const float by = weights > 0 ? sum / weights : off;
        normal = weights > 0 ? Vector3f(normal.stableNormalized()) : best.normal;
        if (std::abs(by) > 3 * usual)
            return {at};
        if (!own.isZero() && normal.dot(own) < 0)
            normal = -normal;
        return {at - by * normal, normal, sigma, best.spacing};
    }

    /// Points that share a voxel of the noise's size, to the power of sqrt 2 next to it.
    void take_together() {
        const float finest = radius_ / 60, coarsest = radius_ / 12;
        std::vector<Keyed> keyed(moved_.size());
        const auto size_of = [&](const Moved& point) {
            return static_cast<int>(std::round(
                2 * std::log2(std::clamp(1.5F * std::max(point.sigma, point.spacing), finest, coarsest) / finest)));
        };
        const auto side_of = [&](int size) { return finest * std::exp2(0.5F * static_cast<float>(size)); };
        constexpr std::uint64_t nowhere = ~std::uint64_t(0);
        tbb::parallel_for(std::size_t(0), keyed.size(), [&](std::size_t i) {
            const Moved& point = moved_[i];
            const std::uint32_t original = tree_.original(i);
            keyed[i] = {nowhere, original, static_cast<std::uint32_t>(i)};
            if (point.normal.isZero())
                return;
            const int size = size_of(point);
            const Vector3d at = point.at.cast<double>() + middle_;
            keyed[i].key = voxel(at, grid_.origin, static_cast<double>(side_of(size))) << 6 |
                           static_cast<std::uint64_t>(size) << 3 | direction_of(point.normal, with_normals_);
        });
        tbb::parallel_sort(keyed.begin(), keyed.end());
        disc_of_.assign(moved_.size(), alone);
        for (std::size_t begin = 0, end = 0; begin < keyed.size() && keyed[begin].key != nowhere; begin = end) {
            const Moved& first = moved_[keyed[begin].index];
            Vector3f sum = Vector3f::Zero(), normal = Vector3f::Zero();
            float sigma = 0;
            for (end = begin; end < keyed.size() && keyed[end].key == keyed[begin].key; ++end) {
                const Moved& point = moved_[keyed[end].index];
                sum += point.at - first.at;
                normal += point.normal.dot(first.normal) < 0 ? Vector3f(-point.normal) : point.normal;
                sigma += point.sigma;
                disc_of_[keyed[end].index] = static_cast<std::uint32_t>(discs_.size());
            }
            const auto count = static_cast<float>(end - begin);
            discs_.push_back({first.at + sum / count, normal.stableNormalized(), sigma / count, side_of(size_of(first)),
                              static_cast<std::uint32_t>(end - begin)});
        }
    }

    [[nodiscard]] NeighbourTree tree_of_discs() const {
        std::vector<Vector3f> positions;
        for (const Disc& disc : discs_)
            positions.push_back(disc.at);
        return NeighbourTree(positions);
    }

    /// Onto the surface of the discs around each: the median of their offsets, then Tukey's mean of 4 and of 2 sigma.
    void project() {
        const NeighbourTree tree = tree_of_discs();
        std::vector<Vector3f> projected(discs_.size());
        tbb::parallel_for(tbb::blocked_range<std::size_t>(0, discs_.size(), 256), [&](const auto& range) {
            Nearest nearest;
            struct Offset {
                float off, weight;
            };
            std::vector<Offset> offsets;
            for (std::size_t index = range.begin(); index < range.end(); ++index) {
                const Disc& disc = discs_[tree.original(index)];
                Vector3f& at = projected[tree.original(index)];
                at = disc.at;
                constexpr std::size_t round = 32;
                tree.find_round(index, round, nearest);
                if (nearest.all().empty())
                    continue;
                offsets.assign(1, {0, static_cast<float>(disc.count)});
                float all = offsets[0].weight;
                for (const auto& [distance2, other] : nearest.all()) {
                    const Disc& there = discs_[tree.original(other)];
                    constexpr float alike = 0.85F;
                    const float cosine = disc.normal.dot(there.normal);
                    if ((with_normals_ ? cosine : std::abs(cosine)) < alike)
                        continue;
                    const Vector3f between = (disc.normal + (cosine < 0 ? -1 : 1) * there.normal).normalized();
                    offsets.push_back(
                        {(there.at - disc.at).dot(between),
                         static_cast<float>(there.count) * std::exp(-2 * distance2 / nearest.all().back().distance2)});
                    all += offsets.back().weight;
                }
                std::sort(offsets.begin(), offsets.end(),
                          [](const Offset& a, const Offset& b) { return a.off < b.off; });
                float passed = 0, surface = 0;
                for (const Offset& each : offsets)
                    if ((passed += each.weight) >= all / 2) {
                        surface = each.off;
                        break;
                    }
                if (std::abs(surface) > 3 * disc.sigma)
                    continue;
                for (const float wide : {4.0F, 2.0F}) {
                    float sum = 0, weights = 0;
                    for (const Offset& each : offsets) {
                        const float far = (each.off - surface) / (wide * disc.sigma);
                        const float inside = std::max(1 - far * far, 0.0F);
                        sum += each.weight * inside * inside * each.off;
                        weights += each.weight * inside * inside;
                    }
                    if (weights > 0)
                        surface = sum / weights;
                }
                at += surface * disc.normal;
            }
        });
        for (std::size_t k = 0; k < discs_.size(); ++k)
            discs_[k].at = projected[k];
    }

    [[nodiscard]] FittedCloud gathered() const {
        FittedCloud fitted;
        std::vector<Vector3f> positions;
        constexpr float widest = 1.3F; // of a voxel's side: wires and flying pixels are no ribbons
        for (std::size_t k = 0; k < discs_.size(); ++k) {
            positions.push_back(discs_[k].at);
            fitted.points.push_back(discs_[k].at.cast<double>() + middle_);
            fitted.axes.push_back(discs_[k].normal);
            if (with_normals_)
                fitted.normals.push_back(discs_[k].normal.cast<double>());
            fitted.largest_disc.push_back(widest * discs_[k].side);
            fitted.sigma.push_back(discs_[k].sigma);
        }
        if (positions.empty())
            return {};
        fitted.alone.assign(positions.size(), 0);
        fitted.noise = median(std::vector(fitted.sigma));
        fitted.fitted_of.resize(points_.size());
        const NeighbourTree tree(positions);
        std::vector<char> gone(moved_.size());
        tbb::parallel_for(tbb::blocked_range<std::size_t>(0, moved_.size(), 256), [&](const auto& range) {
            Nearest nearest;
            for (std::size_t i = range.begin(); i < range.end(); ++i) {
                std::uint32_t& of = fitted.fitted_of[tree_.original(i)];
                if (disc_of_[i] != alone) {
                    of = disc_of_[i];
                    continue;
                }
                gone[i] = 1;
                constexpr std::size_t round = 8;
                tree.find_near(moved_[i].at, round, nearest);
                of = tree.original(nearest.all()[0].point);
                for (const auto& each : nearest.all())
                    if (const std::uint32_t disc = tree.original(each.point);
                        facing_.cosine(facing_.of(i), fitted.axes[disc]) > one_surface) {
                        of = disc;
                        break;
                    }
            }
        });
        fitted.moved = moved_.size() - static_cast<std::size_t>(std::count(gone.begin(), gone.end(), 1));
        return fitted;
    }

    static constexpr std::uint32_t alone = ~std::uint32_t(0);

    const NeighbourTree& tree_;
    const Vector3d& middle_; ///< that the tree's points are relative to
    std::span<const Vector3d> points_;
    bool with_normals_;
    PointNormals facing_;
    float radius_;
    const ThinningGrid& grid_;
    std::vector<Moved> moved_; ///< by index in the tree
    std::vector<Disc> discs_;
    std::vector<std::uint32_t> disc_of_; ///< by index in the tree
};

} // namespace

std::vector<std::optional<Slab>> slabs_around(const NeighbourTree& tree, std::span<const Vector3d> normals,
                                              std::span<const std::size_t> indices, float widest) {
    const Pyramid pyramid(tree, {});
    const PointNormals facing = facing_of(tree, normals);
    std::vector<std::optional<Slab>> slabs(indices.size());
    tbb::parallel_for(std::size_t(0), slabs.size(), [&](std::size_t k) {
        if (const WindowPlane plane = Windows(pyramid, facing, widest).around(indices[k]); plane.radius > 0)
            slabs[k] = {plane.scatter, plane.spacing};
    });
    return slabs;
}

bool noise_exceeds_spacing(std::span<const std::optional<Slab>> slabs) {
    // Of 14 clouds merged from depth frames, 40 % of the places read above 0.38 (time of flight) to 1.3, of exact and
    // noisy scans below 0.32. Higher shares do not separate them: leaves and boards look like noise, too.
    constexpr float larger = 0.36F;
    constexpr double enough = 0.4;
    const auto count = std::ranges::count_if(
        slabs, [](const std::optional<Slab>& slab) { return slab && slab->sigma > larger * slab->spacing; });
    return static_cast<double>(count) > enough * static_cast<double>(slabs.size());
}

FittedCloud cleaned_cloud(const LocalCloud& local, std::span<const Vector3d> points, std::span<const Vector3d> normals,
                          double radius, const ThinningGrid& grid) {
    return Cleaning(local, points, normals, radius, grid).run();
}

} // namespace scanshade
