// Textures of occlusion: rays from the point of every texel, means on the surface, and the margin.
#include "ao/texture/texture_ao.h"

#include "ao/base/watch.h"
#include "ao/texture/surface_means.h"
#include "projection/base/error.h"
#include "projection/base/hash.h"
#include "projection/base/memory.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <numbers>
#include <tbb/parallel_for.h>

namespace scanshade {
namespace {

using Eigen::Vector3d;

constexpr float nothing = std::numeric_limits<float>::quiet_NaN();
/// Means reach no farther than this share of the radius, over which visibility changes by less than its noise.
constexpr double means_share = 0.1;

/// Of `faces`, the median distance between neighbouring texels.
float median_step(const TexelSurface& surface, std::span<const int> faces) {
    std::vector<float> steps;
    for (const int face : faces)
        if (surface.is_shown(face))
            steps.push_back(surface.step(face));
    if (steps.empty())
        return 0;
    const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
    std::ranges::nth_element(steps, middle);
    return *middle;
}

/// Powers of two, so that a mean has about 256 rays: it has those of 29 texels where it reaches `steps` texels and no
/// farther than means_reach.
int rays_for(float steps) {
    const float reach = std::min(steps, means_reach + 0.5F), texels = 0.75F * std::numbers::pi_v<float> * reach * reach;
    return texels > 24 ? 8 : texels > 12 ? 16 : texels > 6 ? 32 : 64; // also where nothing is shown
}

/// Casts the rays of texels. Those of four by four neighbours are parts of one low-discrepancy sequence.
class TexelRays {
  public:
    TexelRays(const RaySurface& mesh, const TexelSurface& surface, const TextureAoOptions& options, int rays, bool half)
        : surface_(surface), half_(half), directions_(rays * CosineDirections::blocks, options.seed, true),
          hemisphere_(mesh, directions_, options.radius, false) {}

    [[nodiscard]] float at(int face, int x, int y) const {
        if (!surface_.is_shown(face))
            return nothing;
        static_assert(CosineDirections::blocks == 16);
        const auto key = hash(static_cast<std::uint32_t>(x / 4), static_cast<std::uint32_t>(y / 4));
        return hemisphere_
            .at({.point = surface_.point(face, x, y),
                 .normal = surface_.normal(face).cast<double>(),
                 .key = key,
                 .block = half_ ? x % 4 / 2 + y % 4 * 2 : x % 4 + y % 4 * 4})
            .visibility[0];
    }

  private:
    const TexelSurface& surface_;
    bool half_; ///< every second texel casts: they share the first half of the sequence, which is even by itself
    CosineDirections directions_;
    RayHemisphere hemisphere_;
};

/// Values of all texels that one triangle has for itself.
class Alone {
  public:
    /// `half`: every second texel, as on a chess board, takes the mean of its neighbours, unless it has none.
    Alone(const Texels& texels, const TexelSurface& surface, const TexelRays& rays, bool half)
        : texels_(texels), surface_(surface), rays_(rays), half_(half), values_(texels.size, texels.size, nothing) {}

    cv::Mat1f values() {
        for_each_texel([&](int face, int x, int y) {
            if (!half_ || (x + y) % 2 == 0)
                values_(y, x) = rays_.at(face, x, y);
        });
        if (half_)
            for_each_texel([&](int face, int x, int y) {
                if ((x + y) % 2 != 0)
                    values_(y, x) = between(face, x, y);
            });
        return values_;
    }

  private:
    /// Neighbours in a block follow each other, since their rays go through the same parts of the tree.
    template <class Visit>
    void for_each_texel(const Visit& visit) const {
        constexpr int block = 8;
        const int across = (texels_.size + block - 1) / block;
        tbb::parallel_for(0, across * across, [&](int i) {
            const int left = i % across * block, top = i / across * block;
            for (int y = top; y < std::min(top + block, texels_.size); ++y)
                for (int x = left; x < std::min(left + block, texels_.size); ++x)
                    if (const std::int32_t face = texels_.face[texels_.index(x, y)]; face >= 0)
                        visit(face, x, y);
        });
    }

    [[nodiscard]] float between(int face, int x, int y) const {
        constexpr float like_normals = 0.99F, steps = 2; // 8 degrees; neighbours on the surface are a step away
        const Eigen::Vector3f here = surface_.local(face, x, y);
        float sum = 0, count = 0;
        for (const auto& [i, j] : {std::pair(x - 1, y), {x + 1, y}, {x, y - 1}, {x, y + 1}}) {
            if (std::min(i, j) < 0 || std::max(i, j) >= texels_.size)
                continue;
            const std::int32_t other = texels_.face[texels_.index(i, j)];
            if (other < 0 || std::isnan(values_(j, i)) ||
                surface_.normal(face).dot(surface_.normal(other)) < like_normals ||
                (surface_.local(other, i, j) - here).norm() > steps * surface_.step(face))
                continue;
            sum += values_(j, i);
            ++count;
        }
        return count > 1 ? sum / count : rays_.at(face, x, y);
    }

    const Texels& texels_;
    const TexelSurface& surface_;
    const TexelRays& rays_;
    bool half_;
    cv::Mat1f values_;
};

/// Puts the mean over all that claim a texel into it.
void add_shared(const Texels& texels, const TexelRays& rays, cv::Mat1f& values) {
    std::vector<float> each(texels.claims.size());
    tbb::parallel_for(std::size_t(0), each.size(), [&](std::size_t i) {
        const Texels::Claim& claim = texels.claims[i];
        each[i] = rays.at(claim.face, claim.x, claim.y);
    });
    for (std::size_t i = 0; i < each.size();) {
        const std::size_t texel = texels.index(texels.claims[i].x, texels.claims[i].y);
        float sum = 0, count = 0;
        for (; i < each.size() && texels.index(texels.claims[i].x, texels.claims[i].y) == texel; ++i)
            if (!std::isnan(each[i]))
                sum += each[i], ++count;
        if (count > 0)
            values(static_cast<int>(texel) / texels.size, static_cast<int>(texel) % texels.size) = sum / count;
    }
}

} // namespace

TextureAo::TextureAo(std::span<const Vector3d> points, std::span<const std::array<int, 3>> triangles,
                     const std::vector<bool>& reversed, TextureAoOptions options)
    : points_(points), triangles_(triangles), reversed_(reversed), options_(options),
      surface_({{points.begin(), points.end()}, {triangles.begin(), triangles.end()}}) {}

OcclusionTexture TextureAo::image(std::span<const TextureCorners> corners, std::span<const int> faces, int size,
                                  int margin) const {
    const auto pixels = static_cast<std::uint64_t>(size) * static_cast<std::uint64_t>(size);
    constexpr std::uint64_t per_texel = 12, per_triangle = 16; // triangle, value and mean; normal and step
    require_memory(per_texel * pixels + per_triangle * triangles_.size(),
                   fmt::format("a texture of {0} x {0} texels", size));
    OcclusionTexture made;
    Watch watch(made.timings);
    const TexelSurface surface(points_, triangles_, reversed_, corners, faces, size);
    std::vector<int> shown(faces.begin(), faces.end());
    std::erase_if(shown, [&](int face) { return !surface.is_shown(face); });
    const Texels texels = texels_of(corners, shown, size);
    if (texels.too_many)
        throw Error("its coordinates lie over each other more than four times, so that no image can show its surface: "
                    "give it coordinates without overlap");
    made.covered = texels.covered;
    made.overlap = texels.overlap();
    watch.lap("texels");
    const float most = static_cast<float>(means_share * options_.radius);
    const float steps = most / median_step(surface, shown);
    made.rays = options_.rays > 0 ? options_.rays : rays_for(steps);
    made.half =
        options_.rays == 0 && steps >= 2 * (means_reach + 0.5F); // a mean reaches farther than visibility changes
    const TexelRays rays(surface_, surface, options_, made.rays, made.half);
    cv::Mat1f values = Alone(texels, surface, rays, made.half).values();
    watch.lap("rays");
    const auto noise = static_cast<float>(0.5 * std::pow(made.rays, -0.75)); // of a low-discrepancy set
    made.visibility = means_on_surface(texels, surface, values, most, noise);
    watch.lap("means");
    values.release();
    add_shared(texels, rays, made.visibility);
    fill_margin(made.visibility, margin);
    cv::patchNaNs(made.visibility, 1);
    watch.lap("margin");
    return made;
}

} // namespace scanshade
