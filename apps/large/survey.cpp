// Groups of adjoining boxes.
#include "apps/large/survey.h"

#include <algorithm>
#include <numeric>

namespace scanshade {
namespace {

using Eigen::AlignedBox3d, Eigen::Vector3d;

enum class Beside { apart, adjoining, overlapping };

/// Of two boxes, seen along z: tiles are cut upright.
Beside beside(const AlignedBox3d& a, const AlignedBox3d& b) {
    constexpr double gap = 0.02, slight = 0.2; // of the smaller box's sides, and of its footprint
    Vector3d common;
    for (int axis = 0; axis < 3; ++axis) {
        const double smaller = std::min(a.sizes()[axis], b.sizes()[axis]);
        common[axis] = std::min(a.max()[axis], b.max()[axis]) - std::max(a.min()[axis], b.min()[axis]);
        const double apart = axis < 2 ? gap * std::min(a.sizes().head<2>().maxCoeff(), b.sizes().head<2>().maxCoeff())
                                      : std::max(smaller, a.sizes().head<2>().maxCoeff()); // hills differ in height
        if (common[axis] < -apart)
            return Beside::apart;
    }
    const auto footprint = [](const AlignedBox3d& box) { return box.sizes().x() * box.sizes().y(); };
    const double shared = std::max(common.x(), 0.0) * std::max(common.y(), 0.0);
    return shared > slight * std::min(footprint(a), footprint(b)) ? Beside::overlapping : Beside::adjoining;
}

} // namespace

std::vector<std::vector<std::size_t>> surveys_in(const std::vector<std::optional<SurveyTile>>& files) {
    std::vector<std::size_t> group(files.size());
    std::iota(group.begin(), group.end(), std::size_t(0));
    std::vector<std::size_t> by_x; // so that only boxes near in x are compared
    for (std::size_t i = 0; i < files.size(); ++i)
        if (files[i])
            by_x.push_back(i);
    std::ranges::sort(by_x, {}, [&](std::size_t i) { return files[i]->box.min().x(); });
    const auto first_of = [&](std::size_t i) {
        while (group[i] != i)
            i = group[i] = group[group[i]];
        return i;
    };
    std::vector<char> one_place(files.size(), 0);
    for (std::size_t k = 0; k < by_x.size(); ++k)
        for (std::size_t l = k + 1; l < by_x.size(); ++l) {
            const SurveyTile &a = *files[by_x[k]], &b = *files[by_x[l]];
            if (b.box.min().x() > a.box.max().x() + a.box.sizes().head<2>().maxCoeff())
                break;
            const Beside how = a.kind == b.kind ? beside(a.box, b.box) : Beside::apart;
            if (how == Beside::apart)
                continue;
            group[first_of(by_x[l])] = first_of(by_x[k]);
            if (how == Beside::overlapping)
                one_place[by_x[k]] = 1;
        }
    std::vector<std::vector<std::size_t>> groups(files.size());
    for (std::size_t i = 0; i < files.size(); ++i)
        if (files[i])
            groups[first_of(i)].push_back(i);
    std::erase_if(groups, [&](const std::vector<std::size_t>& each) {
        return each.size() < 2 || std::ranges::any_of(each, [&](std::size_t i) { return one_place[i] != 0; });
    });
    return groups;
}

} // namespace scanshade
