// A cloud too large to be computed at once: two passes over its points, tile after tile, and a check on a part.
#pragma once

#include "ao/base/method.h"
#include "ao/cloud/cloud_error.h"

#include <cstdint>
#include <Eigen/Core>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace scanshade {

struct CloudSetup;

/// A cloud whose points pass by in the order of their numbers, any number of times.
class PointSource {
  public:
    virtual ~PointSource() = default;
    [[nodiscard]] virtual std::size_t size() const = 0;
    /// `normals` is empty or holds one per point.
    using Visit = std::function<void(std::size_t first, std::span<const Eigen::Vector3d> points,
                                     std::span<const Eigen::Vector3d> normals)>;
    virtual void pass(const Visit& visit) = 0;
    /// Known after the first pass: whether the normals are to be used, and what PointSet says of the whole.
    [[nodiscard]] virtual bool has_normals() const = 0;
    [[nodiscard]] virtual bool z_up() const = 0;
    [[nodiscard]] virtual std::optional<Eigen::Vector3d> scanner() const = 0;
    /// As PointSet has it.
    [[nodiscard]] virtual std::span<const Eigen::Vector3d> seen_from() const { return {}; }
};

/// Points of a tile by number, ascending.
struct TilePoints {
    std::vector<std::uint32_t> numbers;
    std::vector<Eigen::Vector3d> points, normals; ///< normals in single precision; empty where there are none
    std::vector<char> in_core;                    ///< 0 = in the rim
};

/// What a tile's core came to, by number, ascending.
struct TileValues {
    std::vector<std::uint32_t> numbers;
    std::vector<float> visibility;
    std::vector<float> error;             ///< expected; until `checked` what CloudWork::TileResult has
    std::vector<KeptSigns> kept_signs;    ///< likewise; empty where nothing is to be checked
    std::vector<std::uint32_t> shown;     ///< places in `numbers`: those points whose normals are kept
    std::vector<Eigen::Vector3f> normals; ///< of these
    bool checked = false;                 ///< errors have what the check found
    // For the notes.
    std::uint64_t round = 0, twins = 0, moved = 0, discs = 0, fitted_from = 0;
    float noise = 0;
    bool on_gpu = false;
};

/// Where the points of tiles wait, and their values. Tiles are numbered from 0; the last two of `begin()` hold strays
/// and the part for the check.
class TileStore {
  public:
    virtual ~TileStore() = default;
    /// What all tiles depend on, as text. Returns true where the store has all points of an earlier run that is equal
    /// in this; then `decided` is what decide() got. Else points follow.
    virtual bool begin(const std::string& plan, std::size_t tiles, bool normals, double copies,
                       std::string& decided) = 0;
    virtual void add(std::size_t tile, std::uint32_t number, const Eigen::Vector3d& point,
                     const Eigen::Vector3f& normal, bool core) = 0;
    /// All points are there; `decided` is kept with them.
    virtual void decide(const std::string& decided) = 0;
    [[nodiscard]] virtual std::size_t count(std::size_t tile) const = 0;
    [[nodiscard]] virtual TilePoints points(std::size_t tile) = 0;
    /// Values of an earlier run; nothing where there are none.
    [[nodiscard]] virtual std::optional<TileValues> values(std::size_t tile) = 0;
    virtual void keep(std::size_t tile, TileValues values) = 0;
    /// The tile is this process's until release(); false while another process computes it.
    [[nodiscard]] virtual bool claim(std::size_t /*tile*/) { return true; }
    virtual void release() {}
    /// Whether another process finishes the cloud: then this one computes tiles, and no more.
    [[nodiscard]] virtual bool helps() const { return false; }
};

/// Everything but the values, which the store has. `shown`: how many normals to keep with them, about.
/// `stop`: asked between tiles; true ends it with an Outage.
[[nodiscard]] PointVisibility compute_large(const CloudSetup& setup, PointSource& source, TileStore& store,
                                            double shown, const std::function<bool()>& stop = {});

/// The same for points in memory, with their values.
[[nodiscard]] PointVisibility in_tiles(const CloudSetup& setup, const PointSet& cloud,
                                       const std::optional<Eigen::Vector3d>& scanner);

/// The points whose normals are kept: about `wanted` of `all`, by a hash of their numbers.
class ShownPoints {
  public:
    ShownPoints(double wanted, std::size_t all);
    [[nodiscard]] bool operator()(std::uint32_t number) const;

  private:
    std::uint64_t below_;
};

} // namespace scanshade
