// Rays against discs: a tree with eight children a node, made of the k-d tree's boxes.
#include "ao/cloud/surface/disc_tree.h"

#include "ao/raycast/ray_surface.h"
#include "shaders/shared/cloud.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <Eigen/Geometry>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>

namespace scanshade {

using Eigen::Vector3d, Eigen::Vector3f;

namespace {

constexpr float farthest = std::numeric_limits<float>::max();
constexpr std::array<std::uint32_t, 8> bit_of{1, 2, 4, 8, 16, 32, 64, 128};

/// Lets rays pass the discs that belong to the surface they start from.
bool is_own(const DiscRay& ray, const Vector3f& normal, float distance) {
    if (distance >= ray.own_reach)
        return false;
    const Vector3f met = ray.origin + distance * ray.direction;
    const float length = normal.norm();
    const bool alike = ray.own_normal.isZero() || std::abs(normal.dot(ray.own_normal)) > shared::own_alike * length;
    return alike && std::abs(normal.dot(ray.own_point - met)) <= ray.own_depth * length;
}

/// The box of a disc, a little wider, so that rounding does not lose hits on its rim.
Eigen::AlignedBox3f box_of(const Vector3f& centre, const Vector3f& normal, float radius) {
    const Vector3f half =
        1.00001F * radius * (Vector3f::Ones() - normal.cwiseProduct(normal)).cwiseMax(1e-6F).cwiseSqrt();
    return {centre - half, centre + half};
}

} // namespace

/// One ray on its way. The functions are compiled for the processor's vectors: what they call is inlined.
struct Traversal {
    using Boxes = std::array<std::array<float, 8>, 6>;

    const DiscTree& tree;
    const DiscRay& ray;
    std::array<float, 3> origin, direction, inverse;
    float near, far;

    [[gnu::always_inline]] Traversal(const DiscTree& of, const DiscRay& cast)
        : tree(of), ray(cast), near(cast.near), far(cast.far) {
        for (std::size_t axis = 0; axis < 3; ++axis) {
            constexpr float level = 1e-12F;
            origin[axis] = cast.origin[static_cast<int>(axis)];
            direction[axis] = cast.direction[static_cast<int>(axis)];
            inverse[axis] = 1 / (std::abs(direction[axis]) < level ? level : direction[axis]);
        }
    }

    /// Bits of the boxes that the ray enters before `far`, and where it enters them.
    [[gnu::always_inline]] std::uint32_t enter(const Boxes& boxes, std::array<float, 8>& entry) const {
        const auto& [x0, y0, z0] = origin;
        const auto& [ix, iy, iz] = inverse;
        const auto &near_x = boxes[ix < 0 ? 3 : 0], &near_y = boxes[iy < 0 ? 4 : 1], &near_z = boxes[iz < 0 ? 5 : 2];
        const auto &far_x = boxes[ix < 0 ? 0 : 3], &far_y = boxes[iy < 0 ? 1 : 4], &far_z = boxes[iz < 0 ? 2 : 5];
        std::uint32_t mask = 0;
        for (std::size_t i = 0; i < 8; ++i) {
            const float ax = (near_x[i] - x0) * ix, ay = (near_y[i] - y0) * iy, az = (near_z[i] - z0) * iz;
            const float bx = (far_x[i] - x0) * ix, by = (far_y[i] - y0) * iy, bz = (far_z[i] - z0) * iz;
            float enters = ax > ay ? ax : ay, leaves = bx < by ? bx : by;
            enters = enters > az ? enters : az;
            enters = enters > 0 ? enters : 0;
            leaves = leaves < bz ? leaves : bz;
            leaves = leaves < far ? leaves : far;
            entry[i] = enters;
            constexpr float rounding = 1.00001F; // may not lose a disc that lies in the box's side
            mask |= enters <= leaves * rounding ? bit_of[i] : 0U;
        }
        return mask;
    }

    /// Bits of the discs `at` .. `at` + 7 that the ray hits, and how far away.
    [[gnu::always_inline]] std::uint32_t hit(std::size_t at, std::array<float, 8>& distance) const {
        const float *cx = tree.coordinate(0) + at, *cy = tree.coordinate(1) + at, *cz = tree.coordinate(2) + at,
                    *nx = tree.coordinate(3) + at, *ny = tree.coordinate(4) + at, *nz = tree.coordinate(5) + at,
                    *radius = tree.coordinate(6) + at;
        const auto& [x0, y0, z0] = origin;
        const auto& [dx, dy, dz] = direction;
        std::uint32_t mask = 0;
        for (std::size_t i = 0; i < 8; ++i) {
            const float steep = dx * nx[i] + (dy * ny[i] + dz * nz[i]);
            const float t = ((cx[i] - x0) * nx[i] + ((cy[i] - y0) * ny[i] + (cz[i] - z0) * nz[i])) / steep;
            const float ox = (x0 + dx * t) - cx[i], oy = (y0 + dy * t) - cy[i], oz = (z0 + dz * t) - cz[i];
            const float off2 = ox * ox + (oy * oy + oz * oz);
            distance[i] = t;
            const bool is_hit = (t >= near) & (t <= far) & (off2 < radius[i] * radius[i]); // false for NaN
            mask |= is_hit ? bit_of[i] : 0U;
        }
        return mask;
    }

    /// Calls `visit(index, distance)` for the discs of a leaf that the ray hits, its own surface aside, until it
    /// returns true.
    template <class Visit>
    [[gnu::always_inline]] bool visit_leaf(std::size_t leaf, Visit&& visit) const {
        std::array<float, 8> distance;
        const std::uint32_t end = tree.begins_[leaf + 1];
        for (std::uint32_t at = tree.begins_[leaf]; at < end; at += 8) {
            std::uint32_t hits = hit(at, distance);
            if (end - at < 8)
                hits &= (1U << (end - at)) - 1;
            for (; hits != 0; hits &= hits - 1) {
                const auto i = static_cast<std::uint32_t>(std::countr_zero(hits));
                const std::size_t disc = at + i;
                const Vector3f normal(tree.coordinate(3)[disc], tree.coordinate(4)[disc], tree.coordinate(5)[disc]);
                if (!is_own(ray, normal, distance[i]) && visit(at + i, distance[i]))
                    return true;
            }
        }
        return false;
    }

    struct Waiting {
        std::uint32_t level, number;
        float entry;
    };
    static constexpr std::size_t deepest = DiscTree::Start::most + 8 * 12; ///< eight for each level below

    /// Visits the discs that the ray hits, in any order, until `visit(index, distance)` returns true. Returns whether
    /// it did.
    template <class Visit>
    [[gnu::always_inline]] bool visit_hits(const DiscTree::Start& start, Visit&& visit) const {
        std::array<Waiting, deepest> stack;
        std::size_t depth = 0;
        std::array<float, 8> entry;
        const auto last = static_cast<std::uint32_t>(tree.levels_.size() - 1);
        for (std::size_t first = 0; first < start.count_; first += 8)
            for (std::uint32_t mask = enter(start.box_[first / 8], entry); mask != 0; mask &= mask - 1)
                stack[depth++] = {static_cast<std::uint32_t>(start.level_),
                                  start.node_[first + static_cast<std::size_t>(std::countr_zero(mask))], 0};
        while (depth > 0) {
            const auto [level, number, unused] = stack[--depth];
            std::uint32_t mask = enter(tree.nodes_[tree.levels_[level] + number].box, entry);
            for (; mask != 0; mask &= mask - 1) {
                const std::uint32_t child = 8 * number + static_cast<std::uint32_t>(std::countr_zero(mask));
                if (level < last)
                    stack[depth++] = {level + 1, child, 0};
                else if (visit_leaf(child, visit))
                    return true;
            }
        }
        return false;
    }

    [[gnu::always_inline]] bool blocked(const DiscTree::Start& start) const {
        return visit_hits(start, [](std::uint32_t, float) { return true; });
    }

    [[gnu::always_inline]] float transmitted(const DiscTree::Start& start) const {
        constexpr float dark = 1.0F / 512; // half a step of a byte
        float left = 1;
        visit_hits(start, [&](std::uint32_t index, float distance) {
            const SoftDisc& disc = tree.soft_[index];
            const Vector3f centre(tree.coordinate(0)[index], tree.coordinate(1)[index], tree.coordinate(2)[index]);
            const Vector3f offset = (ray.origin - centre) + distance * ray.direction;
            const float along_u = disc.u.dot(offset), along_v = disc.v.dot(offset);
            left *= 1 - disc.opacity * std::exp(-(along_u * along_u + along_v * along_v) / 2);
            return left < dark;
        });
        return left < dark ? 0 : left;
    }

    /// Opens what is entered first, first.
    [[gnu::always_inline]] std::optional<DiscTree::Hit> first() {
        std::array<Waiting, deepest> stack;
        std::size_t depth = 0;
        std::array<float, 8> entry;
        const auto last = static_cast<std::uint32_t>(tree.levels_.size() - 1);
        std::optional<DiscTree::Hit> found;
        stack[depth++] = {0, 0, 0};
        while (depth > 0) {
            const auto [level, number, entered] = stack[--depth];
            if (entered > far)
                continue;
            if (level > last) {
                visit_leaf(number, [&](std::uint32_t index, float distance) {
                    if (!found || distance < far || index < found->index) {
                        found = {distance, index};
                        far = distance;
                    }
                    return false;
                });
                continue;
            }
            const std::size_t before = depth;
            std::uint32_t mask = enter(tree.nodes_[tree.levels_[level] + number].box, entry);
            for (; mask != 0; mask &= mask - 1) {
                const auto i = static_cast<std::uint32_t>(std::countr_zero(mask));
                std::size_t at = depth++;
                for (; at > before && stack[at - 1].entry < entry[i]; --at)
                    stack[at] = stack[at - 1];
                stack[at] = {level + 1, 8 * number + i, entry[i]};
            }
        }
        return found;
    }
};

namespace {

/// The same for vectors of four and of eight.
struct Compiled {
    bool (*blocked)(const DiscTree&, const DiscTree::Start&, const DiscRay&);
    float (*transmitted)(const DiscTree&, const DiscTree::Start&, const DiscRay&);
    std::optional<DiscTree::Hit> (*first)(const DiscTree&, const DiscRay&);
};

bool blocked_any(const DiscTree& tree, const DiscTree::Start& start, const DiscRay& ray) {
    return Traversal(tree, ray).blocked(start);
}
float transmitted_any(const DiscTree& tree, const DiscTree::Start& start, const DiscRay& ray) {
    return Traversal(tree, ray).transmitted(start);
}
std::optional<DiscTree::Hit> first_any(const DiscTree& tree, const DiscRay& ray) {
    return Traversal(tree, ray).first();
}
#if defined(__x86_64__)
[[gnu::target("avx2")]] bool blocked_avx2(const DiscTree& tree, const DiscTree::Start& start, const DiscRay& ray) {
    return Traversal(tree, ray).blocked(start);
}
[[gnu::target("avx2")]] float transmitted_avx2(const DiscTree& tree, const DiscTree::Start& start, const DiscRay& ray) {
    return Traversal(tree, ray).transmitted(start);
}
[[gnu::target("avx2")]] std::optional<DiscTree::Hit> first_avx2(const DiscTree& tree, const DiscRay& ray) {
    return Traversal(tree, ray).first();
}
#endif

Compiled fastest_compiled() {
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx2"))
        return {blocked_avx2, transmitted_avx2, first_avx2};
#endif
    return {blocked_any, transmitted_any, first_any};
}
const Compiled compiled = fastest_compiled();

} // namespace

const DiscTree::Node DiscTree::nobody = [] {
    Node node;
    for (auto& side : node.box) // low and high alike, so that no sign of a direction makes a box of them
        side.fill(farthest);
    return node;
}();

DiscTree::DiscTree(const CloudSurface& surface, std::span<const SoftDisc> soft)
    : stride_(surface.size() + wide), soft_(soft) {
    copy_discs(surface);
    join_boxes(surface.tree);
}

void DiscTree::copy_discs(const CloudSurface& surface) {
    using Box = Eigen::AlignedBox3f;
    const NeighbourTree& tree = surface.tree;
    const auto radius_of = [&](std::size_t i) {
        return surface.normals[i].isZero() ? 0 : is_soft() ? soft_[i].radius : surface.disc_radius[i];
    };
    const Box all = tbb::parallel_reduce(
        tbb::blocked_range<std::size_t>(0, tree.size()), Box(),
        [&](const auto& range, Box box) {
            for (std::size_t i = range.begin(); i < range.end(); ++i)
                if (radius_of(i) > 0)
                    box.extend(tree[i]);
            return box;
        },
        [](const Box& a, const Box& b) { return a.merged(b); });
    if (!all.isEmpty()) {
        middle_ = (all.min().cast<double>() + all.max().cast<double>()) / 2;
        rounding_ = rounding_at(static_cast<float>((all.max().cast<double>() - middle_).maxCoeff()));
    }
    discs_ = std::make_unique_for_overwrite<float[]>(7 * stride_);
    const auto put = [&](std::size_t which, std::size_t i, float value) { discs_[which * stride_ + i] = value; };
    for (std::size_t which = 0; which < 7; ++which)
        for (std::size_t i = tree.size(); i < stride_; ++i) // a leaf's last vector may reach beyond it
            put(which, i, 0);
    tbb::parallel_for(std::size_t(0), tree.size(), [&](std::size_t i) {
        const Vector3f at = local(tree[i].cast<double>());
        for (int axis = 0; axis < 3; ++axis) {
            put(static_cast<std::size_t>(axis), i, at[axis]);
            put(static_cast<std::size_t>(axis) + 3, i, surface.normals[i][axis]);
        }
        put(6, i, radius_of(i));
    });
}

void DiscTree::join_boxes(const NeighbourTree& tree) {
    std::vector<std::size_t> sizes; // of the levels, the root's first
    for (std::size_t below = tree.leaves(); sizes.empty() || below > 1;) {
        below = (below + wide - 1) / wide;
        sizes.insert(sizes.begin(), below);
    }
    std::size_t all = 0;
    for (const std::size_t size : sizes) {
        levels_.push_back(all);
        all += size;
    }
    nodes_.resize(all);
    tbb::parallel_for(std::size_t(0), all, [&](std::size_t i) { nodes_[i] = nobody; });
    const auto put = [&](std::size_t level, std::size_t child, const Eigen::AlignedBox3f& box) {
        Node& node = nodes_[levels_[level] + child / wide];
        for (int axis = 0; axis < 3 && !box.isEmpty(); ++axis) {
            node.box[static_cast<std::size_t>(axis)][child % wide] = box.min()[axis];
            node.box[static_cast<std::size_t>(axis) + 3][child % wide] = box.max()[axis];
        }
    };
    begins_.resize(tree.leaves() + 1);
    begins_.back() = static_cast<std::uint32_t>(tree.size());
    tbb::parallel_for(std::size_t(0), tree.leaves(), [&](std::size_t leaf) {
        const auto [begin, end] = tree.leaf_range(leaf);
        begins_[leaf] = static_cast<std::uint32_t>(begin);
        Eigen::AlignedBox3f box;
        for (std::size_t i = begin; i < end; ++i) {
            const auto of_disc = [&](std::size_t which) { return coordinate(which)[i]; };
            if (of_disc(6) > 0)
                box.extend(
                    box_of({of_disc(0), of_disc(1), of_disc(2)}, {of_disc(3), of_disc(4), of_disc(5)}, of_disc(6)));
        }
        put(sizes.size() - 1, leaf, box);
    });
    for (std::size_t level = sizes.size() - 1; level > 0; --level)
        tbb::parallel_for(std::size_t(0), sizes[level], [&](std::size_t number) {
            const auto& of = nodes_[levels_[level] + number].box;
            Eigen::AlignedBox3f box;
            for (std::size_t i = 0; i < wide; ++i)
                if (of[0][i] < farthest)
                    box.extend(Eigen::AlignedBox3f(Vector3f(of[0][i], of[1][i], of[2][i]),
                                                   Vector3f(of[3][i], of[4][i], of[5][i])));
            put(level - 1, number, box);
        });
}

DiscTree::Start DiscTree::start_at_root() const {
    Start start;
    start.box_[0] = nobody.box;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        start.box_[0][axis][0] = -farthest;
        start.box_[0][axis + 3][0] = farthest;
    }
    start.node_[0] = 0;
    start.count_ = 1;
    return start;
}

/// Descends from the root, level by level, while the nodes within reach are few.
DiscTree::Start DiscTree::start_near(const Origins& origins, float reach) const {
    Start start = start_at_root(), below;
    const float widened = 1.0001F * reach, reach2 = widened * widened;
    const Vector3f least = origins.positions.min(), most = origins.positions.max(), middle = origins.positions.center();
    constexpr float level = 1e-6F; // a direction along the plane may point below it by rounding
    const float surely_below = origins.lowest - level * reach - static_cast<float>(rounding_);
    while (start.level_ + 1 < levels_.size()) {
        below.count_ = 0;
        below.level_ = start.level_ + 1;
        for (std::size_t k = 0; k < start.count_; ++k) {
            const auto& of = nodes_[levels_[start.level_] + start.node_[k]].box;
            for (std::size_t i = 0; i < wide; ++i) {
                float apart2 = 0, height = 0; // of the box's highest point, over the middle
                for (int axis = 0; axis < 3; ++axis) {
                    const float low = of[static_cast<std::size_t>(axis)][i],
                                high = of[static_cast<std::size_t>(axis) + 3][i];
                    const float apart = std::max({low - most[axis], least[axis] - high, 0.0F});
                    apart2 += apart * apart;
                    const float down = low - middle[axis], up = high - middle[axis];
                    const float from = origins.normals.min()[axis], to = origins.normals.max()[axis];
                    height += std::max(std::max(from * down, from * up), std::max(to * down, to * up));
                }
                if (!(apart2 <= reach2) || height < surely_below || of[0][i] == farthest)
                    continue;
                if (below.count_ == Start::most)
                    return start;
                if (below.count_ % wide == 0)
                    below.box_[below.count_ / wide] = nobody.box;
                for (std::size_t side = 0; side < 6; ++side)
                    below.box_[below.count_ / wide][side][below.count_ % wide] = of[side][i];
                below.node_[below.count_++] = static_cast<std::uint32_t>(wide * start.node_[k] + i);
            }
        }
        start = below;
    }
    return start;
}

bool DiscTree::blocked(const Start& start, const DiscRay& ray) const { return compiled.blocked(*this, start, ray); }

float DiscTree::transmitted(const Start& start, const DiscRay& ray) const {
    return compiled.transmitted(*this, start, ray);
}

std::optional<DiscTree::Hit> DiscTree::first_hit(const DiscRay& ray) const { return compiled.first(*this, ray); }

} // namespace scanshade
