// Which triangle of a mesh each texel of an image shows, and where on it.
#pragma once

#include "projection/textured_mesh.h"

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace scanshade {

/// A square image, row by row from the top. Coordinates outside 0 .. 1 repeat.
struct Texels {
    static constexpr std::int32_t none = -1, several = -2;

    /// A triangle that covers a texel's centre; x and y continue past the image where coordinates repeat.
    struct Claim {
        std::int32_t x, y, face;
    };

    int size = 0;
    std::vector<std::int32_t> face; ///< index of a triangle; none; or several, which are in `claims`
    std::vector<Claim> claims;      ///< of all texels that several cover; those of one texel stand together
    std::size_t covered = 0;        ///< texels whose centre lies in a triangle
    std::size_t shared = 0;         ///< of these, texels of several triangles
    bool too_many = false;          ///< more than four claims per texel of the image: `claims` are not complete

    [[nodiscard]] std::size_t index(int x, int y) const {
        return static_cast<std::size_t>(y % size) * static_cast<std::size_t>(size) + static_cast<std::size_t>(x % size);
    }
    [[nodiscard]] double overlap() const {
        return covered == 0 ? 0 : static_cast<double>(shared) / static_cast<double>(covered);
    }
};

/// Whether a triangle has finite coordinates that repeat at most 16 times, the most that an image can show.
[[nodiscard]] bool has_place(const TextureCorners& corners);

/// A texel shows the triangle that its centre lies in; centres on a shared edge belong to one of the two (the top-left
/// rule of GPUs, on a grid of 1/256 texel). Texels without a centre in any triangle show the nearest one of those that
/// reach into them. `faces`: indices of `corners`, which the result has, too; others paint nothing, as do triangles
/// without area in the image and without a place.
[[nodiscard]] Texels texels_of(std::span<const TextureCorners> corners, std::span<const int> faces, int size);

/// Of the point of a triangle that is nearest to a texel's centre: weights of the corners, whose sum is 1. They stay a
/// tenth of a texel within the triangle, since at an edge the next wall begins.
[[nodiscard]] Eigen::Vector3d weights_at(const TextureCorners& corners, int x, int y, int size);

/// Of a triangle, in texels of an image.
[[nodiscard]] double area_in_texels(const TextureCorners& corners, int size);

} // namespace scanshade
