// Thinning, plane fits over windows that follow the noise, and projection (after "moving least squares" surfaces).
#include "ao/cloud/surface/fitted_cloud.h"

#include "ao/cloud/surface/cleaned_cloud.h"
#include "ao/cloud/surface/cloud_noise.h"
#include "ao/cloud/surface/moments.h"
#include "projection/base/statistics.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <Eigen/Geometry>
#include <limits>
#include <numeric>
#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

namespace scanshade {
namespace {

using Eigen::Vector3d, Eigen::Vector3f;
using Indices = std::vector<std::uint32_t>;

constexpr float felt_from = 0.02F;        ///< sigma / spacing from which noise is felt
constexpr float thinned_to = 6;           ///< the diagonal of a cell, in sigma
constexpr float least_alike = 0.8F;       ///< cosine between planes of one surface, at least
constexpr std::size_t fewest_fitted = 64; ///< points: fewer tell nothing
constexpr float outlying = 3;             ///< sigma off the surface that no noise explains

/// Some points taken together.
struct Cell {
    Vector3f middle = Vector3f::Zero();
    Vector3f normal = Vector3f::Zero();               ///< recorded: their mean, unit; zero where there is none
    Eigen::Matrix3f spread = Eigen::Matrix3f::Zero(); ///< covariance of its points
    float sigma = 0;                                  ///< of the noise; 0 where it is not felt
    std::uint32_t begin = 0, count = 0;               ///< of its members
    bool alone = false;                               ///< the noise explains no other cells near it as of its surface
};

/// The points in cells. Members are indices in the tree.
struct Cells {
    std::vector<Cell> all;
    Indices members;
};

/// Halves the points of each box of a grid until each part is a cell.
class Thinning {
  public:
    Thinning(const LocalCloud& cloud, std::span<const Vector3d> points, std::span<const Vector3d> normals,
             const CloudNoise& noise, bool sides, const ThinningGrid& grid)
        : tree_(cloud.tree), middle_(cloud.middle), points_(points), normals_(normals), noise_(noise), sides_(sides),
          grid_(grid) {}

    /// Empty where noise is felt nowhere.
    [[nodiscard]] Cells run() const {
        if (!may_be_felt())
            return {};
        const std::vector<Boxed> boxed = in_boxes();
        std::vector<std::size_t> starts;
        for (std::size_t k = 0; k < boxed.size(); ++k)
            if (k == 0 || boxed[k].box != boxed[k - 1].box)
                starts.push_back(k);
        starts.push_back(boxed.size());
        std::vector<Cells> parts(starts.size() - 1);
        std::atomic<bool> felt = false;
        tbb::parallel_for(std::size_t(0), parts.size(), [&](std::size_t i) {
            Cells& part = parts[i];
            for (std::size_t k = starts[i]; k < starts[i + 1]; ++k)
                part.members.push_back(boxed[k].index);
            const Vector3d middle =
                grid_.origin + grid_.side * (place_of(boxed[starts[i]].original) + Vector3d::Constant(0.5));
            if (in_blocks(part, 0, part.members.size(), noise_.at((middle - middle_).cast<float>())))
                felt.store(true, std::memory_order_relaxed);
        });
        if (!felt)
            return {};
        Cells cells;
        for (Cells& part : parts) {
            const auto before = static_cast<std::uint32_t>(cells.members.size());
            cells.members.insert(cells.members.end(), part.members.begin(), part.members.end());
            for (Cell& cell : part.all) {
                cell.begin += before;
                cells.all.push_back(cell);
            }
        }
        return cells;
    }

  private:
    static constexpr std::size_t block = 256; ///< points that are asked together whether noise is felt

    struct Boxed {
        std::uint64_t box;
        std::uint32_t original, index;
    };

    /// Of a point, the box in the grid.
    [[nodiscard]] Vector3d place_of(std::uint32_t original) const {
        return ((points_[original] - grid_.origin) / grid_.side).array().floor();
    }

    /// Box by box, those of a box in the order given: neither depends on the points in other boxes.
    [[nodiscard]] std::vector<Boxed> in_boxes() const {
        std::vector<Boxed> boxed(tree_.size());
        tbb::parallel_for(std::size_t(0), boxed.size(), [&](std::size_t i) {
            constexpr double most = (1 << 20) - 1; // 21 bits; beyond, boxes are larger
            const std::uint32_t original = tree_.original(i);
            const Vector3d place = place_of(original).cwiseMax(-most).cwiseMin(most);
            std::uint64_t box = 0;
            for (const double along : place)
                box = box << 21 | static_cast<std::uint64_t>(along + most);
            boxed[i] = {box, original, static_cast<std::uint32_t>(i)};
        });
        tbb::parallel_sort(boxed.begin(), boxed.end(), [](const Boxed& a, const Boxed& b) {
            return a.box != b.box ? a.box < b.box : a.original < b.original;
        });
        return boxed;
    }

    /// False where noise is far too small to be felt anywhere, so that the points need not be sorted. The tree tells
    /// the spacing within a factor of two.
    [[nodiscard]] bool may_be_felt() const {
        std::vector<std::pair<std::size_t, std::size_t>> blocks;
        tree_.walk([&](float, std::size_t begin, std::size_t end, bool leaf) {
            if (end - begin > block && !leaf)
                return true;
            blocks.emplace_back(begin, end);
            return false;
        });
        constexpr float surely = 4;
        std::atomic<bool> may = false;
        tbb::parallel_for(std::size_t(0), blocks.size(), [&](std::size_t i) {
            Indices members(blocks[i].second - blocks[i].first);
            std::iota(members.begin(), members.end(), static_cast<std::uint32_t>(blocks[i].first));
            if (surely * noise_.largest() > felt_from / 4 * spacing_in(members))
                may.store(true, std::memory_order_relaxed);
        });
        return may;
    }

    /// Cells of runs of few points. Returns whether noise is felt in any.
    bool in_blocks(Cells& part, std::size_t begin, std::size_t end, float sigma) const {
        const auto members = std::span(part.members).subspan(begin, end - begin);
        if (members.size() > block) {
            const std::size_t half = halved(members);
            const bool low = in_blocks(part, begin, begin + half, sigma);
            return in_blocks(part, begin + half, end, sigma) || low;
        }
        // A quarter: spacing varies within a block. Fit looks at every cell again.
        const float felt = sigma > felt_from / 4 * spacing_in(members) ? sigma : 0;
        halve(part, begin, end, felt);
        return felt > 0;
    }

    /// The points' spacing, by the smallest of eight parts, since a stray widens its own. 0 for few points.
    [[nodiscard]] float spacing_in(std::span<std::uint32_t> members, int halvings = 3) const {
        constexpr std::size_t fewest = 16;
        if (members.size() < fewest)
            return 0;
        if (halvings > 0 && members.size() >= 2 * fewest) {
            const std::size_t half = halved(members);
            return std::min(spacing_in(members.first(half), halvings - 1),
                            spacing_in(members.subspan(half), halvings - 1));
        }
        Vector3f sizes = box_of(members).sizes();
        std::sort(sizes.begin(), sizes.end());
        return std::sqrt(sizes[2] * sizes[1] / static_cast<float>(members.size()));
    }

    [[nodiscard]] Eigen::AlignedBox3f box_of(std::span<const std::uint32_t> members) const {
        Eigen::AlignedBox3f box;
        for (const std::uint32_t index : members)
            box.extend(tree_[index]);
        return box;
    }

    /// Along the longest axis; points side by side in the order given. Returns how many are in the first half.
    std::size_t halved(std::span<std::uint32_t> members) const {
        int axis = 0;
        box_of(members).sizes().maxCoeff(&axis);
        const std::size_t half = members.size() / 2;
        std::nth_element(members.begin(), members.begin() + static_cast<std::ptrdiff_t>(half), members.end(),
                         [&](std::uint32_t a, std::uint32_t b) {
                             return tree_[a][axis] != tree_[b][axis] ? tree_[a][axis] < tree_[b][axis]
                                                                     : tree_.original(a) < tree_.original(b);
                         });
        return half;
    }

    void halve(Cells& part, std::size_t begin, std::size_t end, float sigma) const {
        const auto members = std::span(part.members).subspan(begin, end - begin);
        if (!(sigma > 0)) {
            for (std::size_t k = begin; k < end; ++k) {
                part.all.push_back(cell_of(members.subspan(k - begin, 1), 0));
                part.all.back().begin = static_cast<std::uint32_t>(k);
            }
            return;
        }
        const Vector3f sizes = box_of(members).sizes();
        if (members.size() == 1 || (sizes.norm() <= thinned_to * sigma && one_side(members))) {
            part.all.push_back(cell_of(members, sigma));
            part.all.back().begin = static_cast<std::uint32_t>(begin);
            return;
        }
        if (sizes.norm() <= thinned_to * sigma) { // two sides of a thin board
            const Vector3f first = first_normal(members);
            const auto middle = std::stable_partition(members.begin(), members.end(),
                                                      [&](std::uint32_t index) { return on_side_of(first, index); });
            const auto front = static_cast<std::size_t>(middle - members.begin());
            halve(part, begin, begin + front, sigma);
            halve(part, begin + front, end, sigma);
            return;
        }
        const std::size_t half = halved(members);
        halve(part, begin, begin + half, sigma);
        halve(part, begin + half, end, sigma);
    }

    [[nodiscard]] Vector3f normal_of(std::uint32_t index) const { return unit_normal(normals_[tree_.original(index)]); }

    [[nodiscard]] float alike_to(const Vector3f& first, const Vector3f& other) const {
        return sides_ ? first.dot(other) : std::abs(first.dot(other));
    }

    /// Of the first member that has one; zero if none has.
    [[nodiscard]] Vector3f first_normal(std::span<const std::uint32_t> members) const {
        for (const std::uint32_t index : members)
            if (Vector3f normal = normal_of(index); !normal.isZero())
                return normal;
        return Vector3f::Zero();
    }
    [[nodiscard]] bool on_side_of(const Vector3f& first, std::uint32_t index) const {
        constexpr float from = 0.5F;
        const Vector3f normal = normal_of(index);
        return normal.isZero() || alike_to(first, normal) >= from;
    }
    [[nodiscard]] bool one_side(std::span<const std::uint32_t> members) const {
        if (normals_.empty())
            return true;
        const Vector3f first = first_normal(members);
        return std::all_of(members.begin(), members.end(),
                           [&](std::uint32_t index) { return on_side_of(first, index); });
    }

    [[nodiscard]] Cell cell_of(std::span<const std::uint32_t> members, float sigma) const {
        const Vector3f origin = tree_[members.front()];
        Moments moments;
        Vector3f normal = Vector3f::Zero();
        for (const std::uint32_t index : members) {
            moments.add(tree_[index] - origin);
            if (!normals_.empty()) {
                const Vector3f of_point = normal_of(index);
                normal += !sides_ && normal.dot(of_point) < 0 ? Vector3f(-of_point) : of_point;
            }
        }
        return {origin + moments.mean(),
                normal.stableNormalized(),
                moments.covariance(),
                sigma,
                0,
                static_cast<std::uint32_t>(members.size())};
    }

    const NeighbourTree& tree_;
    const Vector3d& middle_; ///< that the tree's points are relative to
    std::span<const Vector3d> points_, normals_;
    const CloudNoise& noise_;
    bool sides_;
    const ThinningGrid& grid_;
};

/// The surface through the cells.
class Fit {
  public:
    /// `sides`: the cells' normals tell them.
    Fit(std::vector<Cell>& cells, bool sides)
        : cells_(cells), sides_(sides), tree_(middles(cells)), planes_(cells.size()) {}

    /// Moves the cells where noise is felt onto the surface. Returns axes by cell; zero where nothing moves.
    std::vector<Vector3f> run() {
        near_.resize(cells_.size() * most);
        tbb::parallel_for(tbb::blocked_range<std::size_t>(0, cells_.size(), 256), [&](const auto& range) {
            Search search;
            for (std::size_t index = range.begin(); index < range.end(); ++index)
                fit(index, search);
        });
        std::vector<Vector3f> axes(cells_.size(), Vector3f::Zero());
        choose_planes();
        std::vector<Vector3f> moved(cells_.size());
        tbb::parallel_for(std::size_t(0), cells_.size(), [&](std::size_t index) {
            const std::uint32_t i = tree_.original(index);
            moved[i] = tree_[index];
            if (planes_[index].near == 0)
                return;
            axes[i] = planes_[index].normal;
            const Offset found = offset(index);
            moved[i] += found.distance * planes_[index].normal;
            constexpr int fewest = 3;
            cells_[i].alone = found.support < fewest && near_surfaces(index);
        });
        for (std::size_t i = 0; i < cells_.size(); ++i)
            cells_[i].middle = moved[i];
        return axes;
    }

  private:
    static constexpr std::size_t few = 16, most = 32; ///< cells in a window
    static constexpr float many_from = 0.12F;         ///< sigma / spacing

    struct Plane {
        Vector3f normal = Vector3f::Zero();
        float thickness = 0;    ///< sigma of the window's points off the plane
        float middle_off = 0;   ///< how far the plane lies from the cell, along the normal
        float reach2 = 0;       ///< the window's radius, squared
        std::uint32_t near = 0; ///< cells in the window; 0 = noise is not felt here
        bool flat = false;
    };

    static std::vector<Vector3f> middles(const std::vector<Cell>& cells) {
        std::vector<Vector3f> all(cells.size());
        std::transform(cells.begin(), cells.end(), all.begin(), [](const Cell& cell) { return cell.middle; });
        return all;
    }

    [[nodiscard]] const Cell& cell(std::size_t index) const { return cells_[tree_.original(index)]; }
    [[nodiscard]] std::span<const std::uint32_t> near(std::size_t index) const {
        return {near_.data() + index * most, planes_[index].near};
    }

    /// Neighbours of one cell after the other: those of the last one are near the next one's.
    struct Search {
        Nearest found;
        std::size_t last = 0;
        float reach = std::numeric_limits<float>::infinity();
    };
    std::span<const Nearest::Neighbour> nearest(std::size_t index, std::size_t wanted, Search& search) const {
        const float known = (search.reach + (tree_[index] - tree_[search.last]).norm()) * (1 + 1e-5F);
        tree_.find_round(index, wanted, search.found, known * known);
        return search.found.all();
    }

    void fit(std::size_t index, Search& search) {
        Plane& plane = planes_[index];
        const Cell& own = cell(index);
        if (!(own.sigma > 0))
            return;
        auto all = nearest(index, few, search);
        search.last = index;
        search.reach = all.size() == few ? std::sqrt(all.back().distance2) : std::numeric_limits<float>::infinity();
        if (all.size() < 6 || !(all[5].distance2 > 0))
            return;
        const float spacing = std::sqrt(all[5].distance2) / 1.414F;
        if (own.sigma < felt_from * spacing)
            return;
        if (own.sigma > many_from * spacing) {
            tree_.find_round(index, most, search.found);
            all = search.found.all();
        }
        plane.near = static_cast<std::uint32_t>(all.size());
        plane.reach2 = all.back().distance2;
        for (std::size_t k = 0; k < all.size(); ++k)
            near_[index * most + k] = all[k].point;
        Moments moments;
        add(moments, own, Vector3f::Zero(), 1);
        for (const auto& [distance2, other] : all)
            if (const Cell& there = cell(other); own.normal.isZero() || alike(own.normal, there.normal))
                add(moments, there, tree_[other] - tree_[index], weight(distance2, plane.reach2));
        const PrincipalAxes axes(moments.covariance());
        plane.normal = own.normal.isZero() ? axes.normal : own.normal;
        plane.thickness = std::sqrt(axes.variances[0]);
        plane.middle_off = moments.mean().dot(plane.normal);
        plane.flat = plane.thickness <= 1.4F * own.sigma;
        if (plane.flat)
            plane.normal = checked_normal(plane.normal, axes.normal);
    }

    static float weight(float distance2, float reach2) { return std::exp(-2 * distance2 / reach2); }
    static void add(Moments& moments, const Cell& cell, const Vector3f& offset, float weight) {
        const float all = weight * static_cast<float>(cell.count);
        moments.add(offset, all);
        moments.products += all * cell.spread;
    }

    /// Where a window holds two surfaces, the plane of a flat window near by that passes the cell.
    void choose_planes() {
        std::vector<Vector3f> chosen(cells_.size());
        tbb::parallel_for(std::size_t(0), cells_.size(), [&](std::size_t index) {
            const Plane& own = planes_[index];
            chosen[index] = own.normal;
            if (own.near == 0 || own.flat || !cell(index).normal.isZero())
                return;
            float least = 1;
            for (const std::uint32_t other : near(index)) {
                const Plane& there = planes_[other];
                if (!there.flat)
                    continue;
                const Vector3f apart = tree_[index] - tree_[other];
                const float off = (apart.dot(there.normal) - there.middle_off) / (outlying * cell(index).sigma);
                const float cost = off * off + apart.squaredNorm() / own.reach2 / 4;
                if (std::abs(off) < 1 && cost < least) {
                    least = cost;
                    chosen[index] = there.normal;
                }
            }
        });
        for (std::size_t index = 0; index < cells_.size(); ++index)
            planes_[index].normal = chosen[index];
    }

    /// Whether most cells near it lie on flat surfaces. Where they do not, as among leaves, nothing is out of place.
    [[nodiscard]] bool near_surfaces(std::size_t index) const {
        const auto all = near(index);
        const auto flat =
            std::count_if(all.begin(), all.end(), [&](std::uint32_t other) { return planes_[other].flat; });
        return 2 * static_cast<std::size_t>(flat) > all.size();
    }

    /// How far the surface lies from the cell along its normal. Offsets along the mean of both normals: on a round
    /// surface those along either normal alone err in opposite directions.
    struct Offset {
        float distance = 0;
        int support = 0; ///< cells of the window that are of the same surface
    };
    [[nodiscard]] Offset offset(std::size_t index) const {
        const Plane& own = planes_[index];
        const float sigma = cell(index).sigma;
        float surface = 0;
        int support = 0;
        for (const float wide : {2 * outlying, outlying}) {
            float sum = 0, weights = 0;
            const auto take = [&](float off, float of_weight) {
                const float far = (off - surface) / (wide * sigma), inside = std::max(1 - far * far, 0.0F);
                sum += of_weight * inside * inside * off;
                weights += of_weight * inside * inside;
                support += inside > 0;
            };
            support = -1; // the cell itself
            take(0, static_cast<float>(cell(index).count));
            for (const std::uint32_t other : near(index)) {
                const Vector3f there = planes_[other].near > 0 ? planes_[other].normal : cell(other).normal;
                const float cosine = own.normal.dot(there);
                if (!alike(own.normal, there))
                    continue;
                const Vector3f apart = tree_[other] - tree_[index];
                const Vector3f between = (own.normal + (cosine < 0 ? -1 : 1) * there).normalized();
                take(apart.dot(between),
                     static_cast<float>(cell(other).count) * weight(apart.squaredNorm(), own.reach2));
            }
            if (weights > 0)
                surface = sum / weights;
        }
        return {surface, support};
    }

    /// Whether two planes may be of one surface.
    [[nodiscard]] bool alike(const Vector3f& a, const Vector3f& b) const {
        return (sides_ ? a.dot(b) : std::abs(a.dot(b))) > least_alike;
    }

    std::vector<Cell>& cells_;
    bool sides_;
    NeighbourTree tree_; ///< of the cells' middles
    std::vector<Plane> planes_;
    Indices near_;
};

} // namespace

ThinningGrid thinning_grid(const Vector3d& centre, double spacing) {
    constexpr double spacings = 20;
    const double side = spacing > 0 ? std::exp2(std::round(std::log2(spacings * spacing))) : 1;
    const Vector3d off = Vector3d(0.37, 0.41, 0.39) * side; // floors and walls are at round coordinates
    return {(centre / side).array().round().matrix() * side + off, side};
}

std::optional<bool> opposed_beside(const NeighbourTree& tree, std::span<const Vector3d> normals, std::size_t index) {
    Nearest nearest;
    tree.find_round(index, 1, nearest);
    if (nearest.all().empty())
        return std::nullopt;
    return unit_normal(normals[tree.original(index)]).dot(unit_normal(normals[tree.original(nearest.all()[0].point)])) <
           -0.7F;
}

bool sides_agree(std::span<const std::optional<bool>> opposed, bool exceeds_spacing) {
    // Right normals of merged frames: 0.004 at most. Boxes of 0.3 m turned over: 0.03 and more, by their number.
    constexpr double layers_from = 0.015, random_from = 0.1;
    const double most = exceeds_spacing ? layers_from : random_from;
    const auto pairs = std::ranges::count_if(opposed, [](const auto& each) { return each.has_value(); });
    const auto against = std::ranges::count_if(opposed, [](const auto& each) { return each.value_or(false); });
    return static_cast<double>(against) < most * static_cast<double>(pairs);
}

namespace {

/// Signs that do not agree would split a slab into layers. Then discs are made without them, and each takes the side
/// that most of its points recorded.
FittedCloud cleaned(const LocalCloud& local, std::span<const Vector3d> points, std::span<const Vector3d> normals,
                    bool sides, double radius, const ThinningGrid& grid) {
    if (sides || normals.empty())
        return cleaned_cloud(local, points, normals, radius, grid);
    FittedCloud cloud = cleaned_cloud(local, points, {}, radius, grid);
    std::vector<int> votes(cloud.points.size());
    for (std::size_t i = 0; i < cloud.fitted_of.size(); ++i)
        if (const double side = normals[i].dot(cloud.axes[cloud.fitted_of[i]].cast<double>()); side != 0)
            votes[cloud.fitted_of[i]] += side < 0 ? -1 : static_cast<int>(side > 0); // NaN: no vote
    for (std::size_t disc = 0; disc < votes.size(); ++disc)
        cloud.normals.push_back((votes[disc] < 0 ? -1 : 1) * cloud.axes[disc].cast<double>());
    return cloud;
}

/// `fewest`: of the points must move, else none does.
FittedCloud fitted_by(const CloudNoise& noise, bool sides, const LocalCloud& local, std::span<const Vector3d> points,
                      std::span<const Vector3d> normals, const ThinningGrid& grid, std::size_t fewest) {
    FittedCloud fitted;
    const NeighbourTree& tree = local.tree;
    Cells cells = Thinning(local, points, normals, noise, sides, grid).run();
    if (cells.all.empty())
        return fitted;
    fitted.axes = Fit(cells.all, sides).run();
    for (std::size_t i = 0; i < cells.all.size(); ++i)
        if (cells.all[i].count > 1 || !fitted.axes[i].isZero())
            fitted.moved += cells.all[i].count;
    if (fitted.moved < fewest)
        return {};
    fitted.noise = noise.median();
    fitted.fitted_of.resize(points.size());
    fitted.points.resize(cells.all.size());
    fitted.alone.resize(cells.all.size());
    if (!normals.empty())
        fitted.normals.resize(cells.all.size());
    tbb::parallel_for(std::size_t(0), cells.all.size(), [&](std::size_t i) {
        const Cell& cell = cells.all[i];
        fitted.points[i] = cell.count > 1 || !fitted.axes[i].isZero()
                               ? Vector3d(cell.middle.cast<double>() + local.middle)
                               : points[tree.original(cells.members[cell.begin])];
        if (!normals.empty())
            fitted.normals[i] =
                (cell.normal.isZero() || fitted.axes[i].isZero() ? cell.normal : fitted.axes[i]).cast<double>();
        fitted.alone[i] = cell.alone;
        for (std::uint32_t k = cell.begin; k < cell.begin + cell.count; ++k)
            fitted.fitted_of[tree.original(cells.members[k])] = static_cast<std::uint32_t>(i);
    });
    return fitted;
}

} // namespace

FittedCloud fitted_cloud(const LocalCloud& local, std::span<const Vector3d> points, std::span<const Vector3d> normals,
                         double radius, const ThinningGrid& grid, bool exceeds_spacing) {
    if (points.size() < fewest_fitted)
        return {};
    constexpr std::size_t sample = 2000;
    std::vector<std::optional<bool>> opposed(normals.empty() ? 0 : sample);
    for (std::size_t k = 0; k < opposed.size(); ++k)
        opposed[k] = opposed_beside(local.tree, normals, (2 * k + 1) * local.size() / (2 * sample));
    const bool sides = !normals.empty() && sides_agree(opposed, exceeds_spacing);
    if (exceeds_spacing)
        return cleaned(local, points, normals, sides, radius, grid);
    const CloudNoise noise(local.tree, static_cast<float>(radius) / 3, sides ? normals : std::span<const Vector3d>());
    return noise.known() ? fitted_by(noise, sides, local, points, normals, grid, (points.size() + 99) / 100)
                         : FittedCloud();
}

FittedCloud fitted_cloud(const LocalCloud& local, std::span<const Vector3d> points, std::span<const Vector3d> normals,
                         double radius, const SharedNoise& noise, const ThinningGrid& grid) {
    if (points.size() < fewest_fitted)
        return {};
    if (noise.exceeds_spacing)
        return cleaned(local, points, normals, noise.sides, radius, grid);
    return fitted_by(noise.noise.moved(local.middle - noise.middle), noise.sides && !normals.empty(), local, points,
                     normals, grid, 1);
}

} // namespace scanshade
