// Points joined piece by piece (union and find), whose normals may oppose each other.
#pragma once

#include <cstdint>
#include <numeric>
#include <utility>
#include <vector>

namespace scanshade {

/// Points joined into pieces. Each point knows whether it must be turned to agree with its piece.
class Pieces {
  public:
    explicit Pieces(std::size_t points) : parent_(points), turned_(points, 0), size_(points, 1) {
        std::iota(parent_.begin(), parent_.end(), 0U);
    }

    struct Member {
        std::uint32_t piece;
        bool turned; ///< against the piece's first point
    };
    /// Leaves all as it is, so several threads may ask.
    [[nodiscard]] Member found(std::uint32_t point) const {
        bool turned = false;
        for (; parent_[point] != point; point = parent_[point])
            turned ^= turned_[point] != 0;
        return {point, turned};
    }
    /// The same, with path compression: all points on the way become the root's children.
    Member find(std::uint32_t point) {
        const Member member = found(point);
        for (bool rest = member.turned; parent_[point] != point;) {
            const std::uint32_t next = parent_[point];
            const bool own = turned_[point] != 0;
            parent_[point] = member.piece;
            turned_[point] = rest;
            rest ^= own;
            point = next;
        }
        return member;
    }
    [[nodiscard]] std::uint32_t size(const Member& member) const { return size_[member.piece]; }

    void join(Member one, Member other, bool opposed) {
        if (size(one) < size(other))
            std::swap(one, other);
        parent_[other.piece] = one.piece;
        turned_[other.piece] = one.turned ^ other.turned ^ opposed;
        size_[one.piece] += size_[other.piece];
    }

  private:
    std::vector<std::uint32_t> parent_;
    std::vector<char> turned_;
    std::vector<std::uint32_t> size_;
};

} // namespace scanshade
