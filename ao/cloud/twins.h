// Points recorded twice: they count once, since a neighbourhood of copies is half as wide as it seems.
#pragma once

#include <cstdint>
#include <Eigen/Core>
#include <span>
#include <vector>

namespace scanshade {

/// A point, and an earlier one at the same coordinates that stands for it.
struct Twin {
    std::uint32_t point, same_as;
};

/// Takes copies out of `indices`, which stays in its order. Points whose recorded normals face away from each other are
/// the two sides of a sheet, not copies. Finite points only. A look at some of the coordinates tells whether there are
/// any: where fewer than one in a thousand are copies, they stay.
[[nodiscard]] std::vector<Twin> take_out_twins(std::span<const Eigen::Vector3d> points,
                                               std::span<const Eigen::Vector3d> normals,
                                               std::vector<std::uint32_t>& indices);

} // namespace scanshade
