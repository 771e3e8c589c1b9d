#include "ao/texture/surface_means.h"

#include "projection/base/hash.h"
#include "projection/base/memory.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <memory>
#include <numbers>
#include <optional>
#include <tbb/parallel_for.h>

namespace scanshade {
namespace {

using Eigen::Vector3f;

/// A texel with what its mean depends on.
struct Place {
    Vector3f point, normal;
    float value = 0;
    float reach = 0; ///< of the mean, in space
};

/// A mean to which neighbours of other charts may be added.
struct Partial {
    Place place;
    std::int32_t x = 0, y = 0;
    float sum = 0, weights = 0;
};

constexpr float like_normals = 0.9F; ///< cosine: 26 degrees

/// Texels of a tile and round it, number by number, so that the means of eight neighbours are computed at once.
class Tile {
  public:
    static constexpr int size = 64, reach = means_reach, wide = size + 2 * reach;

    void set(int x, int y, const Place* place) { // from -reach on
        const auto i = static_cast<std::size_t>((y + reach) * wide + x + reach);
        for (std::size_t axis = 0; axis < 3; ++axis) {
            point_[axis][i] = place ? place->point[static_cast<Eigen::Index>(axis)] : nowhere;
            normal_[axis][i] = place ? place->normal[static_cast<Eigen::Index>(axis)] : 0;
        }
        value_[i] = place ? place->value : 0;
        reach_[i] = place ? place->reach : 0;
    }
    [[nodiscard]] bool has(int x, int y) const {
        return reach_[static_cast<std::size_t>((y + reach) * wide + x + reach)] > 0;
    }
    [[nodiscard]] Place at(int x, int y) const {
        const auto i = static_cast<std::size_t>((y + reach) * wide + x + reach);
        return {{point_[0][i], point_[1][i], point_[2][i]},
                {normal_[0][i], normal_[1][i], normal_[2][i]},
                value_[i],
                reach_[i]};
    }

    /// Sums over the neighbours of a row's texels; `farthest`: squared, of all neighbours in the image, in reaches.
    struct Row {
        alignas(64) std::array<float, size> sum{}, weights{}, farthest{};
    };
    [[nodiscard]] Row row(int y, float most_difference) const {
        Row row;
        for (int j = -reach; j <= reach; ++j)
            for (int i = -reach; i <= reach; ++i)
                add(row, static_cast<std::size_t>((y + reach) * wide + reach),
                    static_cast<std::size_t>((y + reach + j) * wide + reach + i), most_difference);
        return row;
    }

  private:
    static constexpr float nowhere = 1e15F; ///< farther than any surface, and its square is still a number
    using Numbers = std::array<float, static_cast<std::size_t>(wide) * wide>;

    void add(Row& row, std::size_t here, std::size_t there, float most_difference) const {
        for (std::size_t x = 0; x < size; ++x) {
            const std::size_t a = here + x, b = there + x;
            const float dx = point_[0][a] - point_[0][b], dy = point_[1][a] - point_[1][b],
                        dz = point_[2][a] - point_[2][b];
            const float distance = (dx * dx + dy * dy + dz * dz) / (reach_[a] * reach_[a] + 1e-30F);
            const float cosine =
                normal_[0][a] * normal_[0][b] + normal_[1][a] * normal_[1][b] + normal_[2][a] * normal_[2][b];
            const float near = distance < 1 ? 1 - distance : 0.0F;
            const float alike = std::abs(value_[a] - value_[b]) <= most_difference ? near : 0.0F;
            const float weight = cosine >= like_normals ? alike : 0.0F;
            row.sum[x] += weight * value_[b];
            row.weights[x] += weight;
            row.farthest[x] = row.farthest[x] > distance ? row.farthest[x] : distance;
        }
    }

    std::array<Numbers, 3> point_, normal_;
    Numbers value_, reach_;
};

class SurfaceMeans {
  public:
    SurfaceMeans(const Texels& texels, const TexelSurface& surface, const cv::Mat1f& values, float most, float noise)
        : texels_(texels), surface_(surface), values_(values), most_(most), most_difference_(few * noise) {}

    cv::Mat1f means() {
        means_ = values_.clone();
        const int tiles = (texels_.size + Tile::size - 1) / Tile::size;
        std::vector<std::vector<Partial>> open(static_cast<std::size_t>(tiles) * static_cast<std::size_t>(tiles));
        tbb::parallel_for(std::size_t(0), open.size(), [&](std::size_t i) {
            const int row = static_cast<int>(i) / tiles, column = static_cast<int>(i) % tiles;
            open[i] = tile_at(column * Tile::size, row * Tile::size);
        });
        for (std::vector<Partial>& part : open) {
            std::ranges::move(part, std::back_inserter(open_));
            part = {};
        }
        join_charts();
        return means_;
    }

  private:
    static constexpr int reach = means_reach;
    static constexpr float few = 3 * std::numbers::sqrt2_v<float>; ///< standard deviations of a difference are three

    /// Of a neighbour beyond a cut, as Tile::add() has it.
    [[nodiscard]] float weight(const Place& place, const Place& other, float reach_in_space) const {
        const float distance = (place.point - other.point).squaredNorm() / (reach_in_space * reach_in_space);
        const bool same = distance < 1 && std::abs(place.value - other.value) <= most_difference_ &&
                          place.normal.dot(other.normal) >= like_normals;
        return same ? 1 - distance : 0;
    }

    /// Nothing where a texel shows no surface, or several.
    [[nodiscard]] std::optional<Place> place_at(int x, int y) const {
        if (x < 0 || y < 0 || x >= texels_.size || y >= texels_.size)
            return std::nullopt;
        const std::int32_t face = texels_.face[texels_.index(x, y)];
        if (face < 0 || std::isnan(values_(y, x)))
            return std::nullopt;
        return Place{surface_.local(face, x, y), surface_.normal(face), values_(y, x),
                     std::min((reach + 0.5F) * surface_.step(face), most_)};
    }

    /// The means of a tile. Returns texels that have neighbours in the image that are far away on the surface, or show
    /// none: there a chart ends, and others may go on.
    std::vector<Partial> tile_at(int left, int top) {
        std::vector<Partial> open;
        const auto tile = std::make_unique<Tile>();
        bool any = false;
        for (int y = -reach; y < Tile::size + reach; ++y)
            for (int x = -reach; x < Tile::size + reach; ++x) {
                const std::optional<Place> place = place_at(left + x, top + y);
                tile->set(x, y, place ? &*place : nullptr);
                any = any || place;
            }
        for (int y = 0; any && y < Tile::size; ++y) {
            const Tile::Row row = tile->row(y, most_difference_);
            for (int x = 0; x < Tile::size; ++x)
                if (const auto i = static_cast<std::size_t>(x); tile->has(x, y)) {
                    means_(top + y, left + x) = row.sum[i] / row.weights[i];
                    constexpr float far_away = 9; // three reaches, squared: no neighbour in the image is so far
                    if (row.farthest[i] > far_away)
                        open.push_back({tile->at(x, y), left + x, top + y, row.sum[i], row.weights[i]});
                }
        }
        return open;
    }

    using Cell = std::array<std::int32_t, 3>;
    [[nodiscard]] Cell cell_of(const Vector3f& point) const {
        Cell cell;
        for (std::size_t i = 0; i < 3; ++i)
            cell[i] = static_cast<std::int32_t>(
                std::clamp(std::floor(point[static_cast<Eigen::Index>(i)] / cell_size_), -1e9F, 1e9F));
        return cell;
    }
    [[nodiscard]] std::size_t bucket_of(const Cell& cell) const {
        const auto u = [&](std::size_t i) { return static_cast<std::uint32_t>(cell[i]); };
        return hash(u(0), hash(u(1), u(2))) & (starts_.size() - 2);
    }

    /// Adds neighbours from beyond the charts' ends, found in cells of space as wide as a mean reaches.
    void join_charts() {
        if (open_.empty())
            return;
        require_memory(open_.size() * 8, "neighbours beyond the ends of charts");
        std::vector<float> reaches;
        for (const Partial& mean : open_)
            reaches.push_back(mean.place.reach);
        const auto middle = reaches.begin() + static_cast<std::ptrdiff_t>(reaches.size() / 2);
        std::ranges::nth_element(reaches, middle);
        cell_size_ = *middle; // wider means reach no farther over a cut
        starts_.assign(std::bit_ceil(open_.size()) + 1, 0);
        for (const Partial& mean : open_)
            ++starts_[bucket_of(cell_of(mean.place.point)) + 1];
        for (std::size_t i = 1; i < starts_.size(); ++i)
            starts_[i] += starts_[i - 1];
        order_.resize(open_.size());
        std::vector<std::uint32_t> next(starts_.begin(), starts_.end() - 1);
        for (std::size_t i = 0; i < open_.size(); ++i)
            order_[next[bucket_of(cell_of(open_[i].place.point))]++] = static_cast<std::uint32_t>(i);
        tbb::parallel_for(std::size_t(0), open_.size(), [&](std::size_t i) { add_beyond(open_[i]); });
    }

    void add_beyond(const Partial& mean) {
        const float in_space = std::min(mean.place.reach, cell_size_);
        const Cell middle = cell_of(mean.place.point);
        float sum = mean.sum, weights = mean.weights;
        for (int k = 0; k < 27; ++k) {
            const Cell cell{middle[0] + k % 3 - 1, middle[1] + k / 3 % 3 - 1, middle[2] + k / 9 - 1};
            const std::size_t bucket = bucket_of(cell);
            for (std::uint32_t at = starts_[bucket]; at < starts_[bucket + 1]; ++at) {
                const Partial& other = open_[order_[at]];
                const bool in_window = std::abs(other.x - mean.x) <= reach && std::abs(other.y - mean.y) <= reach;
                if (in_window || cell_of(other.place.point) != cell)
                    continue;
                const float w = weight(mean.place, other.place, in_space);
                sum += w * other.place.value;
                weights += w;
            }
        }
        means_(mean.y, mean.x) = sum / weights;
    }

    const Texels& texels_;
    const TexelSurface& surface_;
    const cv::Mat1f& values_;
    float most_, most_difference_;
    cv::Mat1f means_;
    std::vector<Partial> open_;
    float cell_size_ = 0;
    std::vector<std::uint32_t> starts_, order_; ///< by bucket; indices of `open_`
};

} // namespace

cv::Mat1f means_on_surface(const Texels& texels, const TexelSurface& surface, const cv::Mat1f& values, float most,
                           float noise) {
    return SurfaceMeans(texels, surface, values, most, noise).means();
}

} // namespace scanshade
