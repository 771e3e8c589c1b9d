// Points recorded twice: they count once, since a neighbourhood of copies is half as wide as it seems.
#pragma once

#include <cstdint>
#include <Eigen/Core>
#include <span>
#include <unordered_map>
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
/// The same without that look, where it is known that there are many.
[[nodiscard]] std::vector<Twin> all_twins(std::span<const Eigen::Vector3d> points,
                                          std::span<const Eigen::Vector3d> normals,
                                          std::vector<std::uint32_t>& indices);

/// Tells how many points are copies, from those that pass by: those whose coordinates have the lowest hashes.
class TwinLook {
  public:
    void add(const Eigen::Vector3d& point);
    /// Different positions / points.
    [[nodiscard]] double distinct() const;
    /// Whether copies count, as take_out_twins() decides.
    [[nodiscard]] bool many() const;

  private:
    std::unordered_map<std::uint64_t, std::uint32_t> counts_; ///< by hash
    std::uint64_t below_ = ~std::uint64_t(0);                 ///< hashes from there on are left out
};

} // namespace scanshade
