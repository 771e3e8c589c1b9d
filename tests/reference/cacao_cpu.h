// CACAO's formulas once more, for the CPU and from AMD's public documentation alone: what the shaders are held to.
// Straightforward and slow; nothing here is shared with the program except the table of tap positions.
#pragma once

#include "ao/cacao/cacao.h"
#include "shaders/cacao/pattern.glsl"
#include "shaders/shared/cacao.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <opencv2/core.hpp>

namespace scanshade::reference {

using Point = cv::Vec3f;

/// Values left, right, above, below.
struct Around {
    float left = 0, right = 0, top = 0, bottom = 0;
};

inline float saturated(float t) { return std::clamp(t, 0.0F, 1.0F); }

/// binary16 toward zero, for normal numbers.
inline float half_toward_zero(float v) { return std::bit_cast<float>(std::bit_cast<std::uint32_t>(v) & 0xffffe000U); }
/// binary16, nearest even, for normal numbers and zero.
inline float half_even(float v) {
    const auto bits = std::bit_cast<std::uint32_t>(v);
    return std::abs(v) < 6.103515625e-5F ? std::nearbyint(v * 16777216.0F) / 16777216.0F
                                         : std::bit_cast<float>((bits + 0xfffU + (bits >> 13 & 1U)) & 0xffffe000U);
}

/// 1 where the neighbour is the same surface, 0 where it is another.
inline Around edges(float zc, const Around& z) {
    const float l = z.left - zc, r = z.right - zc, t = z.top - zc, b = z.bottom - zc;
    const auto edge = [&](float d, float opposite) {
        return saturated(1.3F - std::min(std::abs(d), std::abs(d + opposite)) / (0.04F * zc));
    };
    return {edge(l, r), edge(r, l), edge(t, b), edge(b, t)};
}

/// The same of 1/z, which is linear across a plane; a hole (0) is cut and lends no slope.
inline Around edges_of_inverse(float zc, const Around& z) {
    const auto inverse = [](float depth) { return depth > 0 ? 1 / depth : 0; };
    const auto edge = [&](float toward, float away) {
        if (!(toward > 0))
            return 0.0F;
        const float d = inverse(toward) - 1 / zc, opposite = inverse(away) - 1 / zc;
        return saturated(1.3F - (away > 0 ? std::min(std::abs(d), std::abs(d + opposite)) : std::abs(d)) * 25 * zc);
    };
    return {edge(z.left, z.right), edge(z.right, z.left), edge(z.top, z.bottom), edge(z.bottom, z.top)};
}

inline int packed(const Around& e) {
    const auto level = [](float t) { return static_cast<int>(std::nearbyint(3.05F * saturated(t))); };
    return level(e.left) << 6 | level(e.right) << 4 | level(e.top) << 2 | level(e.bottom);
}

/// What the blur makes of the packed byte; iota is 1 - sharpness.
inline Around unpacked(int byte, float iota) {
    const auto level = [&](int shift) { return saturated(static_cast<float>(byte >> shift & 3) / 3.0F + iota); };
    return {level(6), level(4), level(2), level(0)};
}

/// Mean of what lies on the nearest of four depths.
inline float nearest_mean(const std::array<float, 4>& z, float phi) {
    const float nearest = *std::min_element(z.begin(), z.end());
    float sum = 0, total = 0;
    for (const float one : z) {
        const float w = saturated(1 + phi * (one - nearest) * (one - nearest));
        sum += w * one;
        total += w;
    }
    return sum / total;
}

inline float blurred(float centre, const Around& v, const Around& e) {
    return (0.5F * centre + e.left * v.left + e.right * v.right + e.top * v.top + e.bottom * v.bottom) /
           (0.5F + e.left + e.right + e.top + e.bottom);
}

inline float obscurance(const Point& normal, const Point& d, float falloff, float horizon) {
    const float d2 = d.dot(d);
    return std::max(0.0F, normal.dot(d) / std::sqrt(d2) - horizon) * std::max(0.0F, d2 * falloff + 1);
}

/// From mean obscurance to visibility.
inline float visibility(const shared::CacaoConstants& k, float mean, float fade) {
    return std::pow(saturated(1 - fade * std::min(k.shadow_strength * mean, k.shadow_clamp)), k.shadow_power);
}

/// The unit normal at `c` from its four neighbours' places and edges.
inline Point normal_of(const Around& e, const Point& c, const Point& left, const Point& right, const Point& top,
                       const Point& bottom) {
    const Point l = cv::normalize(left - c), r = cv::normalize(right - c), t = cv::normalize(top - c),
                b = cv::normalize(bottom - c);
    return Point(0, 0, -0.0005F) + e.left * e.top * l.cross(t) + e.top * e.right * t.cross(r) +
           e.right * e.bottom * r.cross(b) + e.bottom * e.left * b.cross(l);
}

/// Offset, weight and mip bias of each tap.
struct Tap {
    float x, y, weight, mip;
};
inline const std::array<Tap, 12>& taps_of_high() {
#define SCANSHADE_TAP(i, x, y, weight, mip) Tap{x##F, y##F, weight##F, mip##F},
    static const std::array<Tap, 12> table{
        {CACAO_PATTERN_0_3(SCANSHADE_TAP) CACAO_PATTERN_3_5(SCANSHADE_TAP) CACAO_PATTERN_5_12(SCANSHADE_TAP)}};
#undef SCANSHADE_TAP
    return table;
}

/// AMD's kernel of quality HIGH over one slice, from what the passes before it left.
class High {
  public:
    const shared::CacaoConstants& k;
    int slice;
    const std::array<cv::Mat1f, 4>& depth; ///< by mip
    const cv::Mat3f& normals;              ///< z forward, y up

    [[nodiscard]] Point place(float u, float v, float z) const {
        return {(k.view_mul.x * u + k.view_add.x) * z, (k.view_mul.y * v + k.view_add.y) * z, z};
    }

    /// What the kernel knows of one texel before its taps.
    struct Texel {
        float u, v;
        Point point; ///< not yet moved towards the camera
        float radius, step_x, step_y, disc, falloff;
    };
    [[nodiscard]] Texel texel(int x, int y) const {
        Texel t{};
        const float zc = depth[0](y, x);
        t.u = (static_cast<float>(x) + 0.5F) * k.slice_inv.x;
        t.v = (static_cast<float>(y) + 0.5F) * k.slice_inv.y;
        t.point = place(t.u, t.v, zc);
        t.step_x = zc * k.view_mul.x * k.slice_inv.x;
        t.step_y = zc * k.view_mul.y * k.slice_inv.y;
        const float length = std::sqrt(t.point.dot(t.point));
        t.radius = k.radius * (saturated(length * k.near_limit_rec) * 0.8F + 0.2F);
        t.disc = 0.85F * t.radius / t.step_x;
        t.falloff = -1 / (t.radius * t.radius);
        return t;
    }

    /// Where tap `tap` of texel (x, y) lands, in slice texels, before rounding.
    [[nodiscard]] cv::Vec2f offset(const Tap& tap, const Texel& t, int x, int y) const {
        const shared::vec2 m = cacao_rotation(slice, (x + 2 * y) % 5);
        return {t.disc * m.x * tap.x + t.disc * m.y * tap.y, t.disc * m.y * tap.x - t.disc * m.x * tap.y};
    }
    [[nodiscard]] static int mip(const Tap& tap, const Texel& t) {
        return static_cast<int>(std::clamp(std::nearbyint(tap.mip + std::log2(t.disc) - 4.3F), 0.0F, 3.0F));
    }

    [[nodiscard]] float operator()(int x, int y) const {
        const Texel t = texel(x, y);
        const cv::Mat1f& z = depth[0];
        const float zc = z(y, x);
        const Point n = normals(y, x), p = k.depth_offset * t.point;
        const Around around{z(y, std::max(x - 1, 0)), z(y, std::min(x + 1, z.cols - 1)), z(std::max(y - 1, 0), x),
                            z(std::min(y + 1, z.rows - 1), x)};
        Around e = edges(zc, around);

        const Point ray(p[0] / p[2], p[1] / p[2], 1);
        const auto adjacent = [&](float dx, float dy, float depth_there, float edge) {
            const Point d = Point(dx, dy, 0) + ray * (depth_there - p[2]);
            return edge * obscurance(n, d, 4 * t.falloff, k.horizon);
        };
        float sum = k.detail_strength *
                    (adjacent(-t.step_x, 0, around.left, e.left) + adjacent(t.step_x, 0, around.right, e.right) +
                     adjacent(0, -t.step_y, around.top, e.top) + adjacent(0, t.step_y, around.bottom, e.bottom));
        const auto turned = [&](int u, int v) {
            const bool there = u >= 0 && v >= 0 && u < z.cols && v < z.rows;
            return saturated(0.5F + (there ? n.dot(normals(v, u)) : 0));
        };
        e.left *= turned(x - 1, y);
        e.right *= turned(x + 1, y);
        e.top *= turned(x, y - 1);
        e.bottom *= turned(x, y + 1);

        float total = 0;
        for (const Tap& tap : taps_of_high()) {
            const cv::Vec2f raw = offset(tap, t, x, y), o(std::nearbyint(raw[0]), std::nearbyint(raw[1]));
            const int m = mip(tap, t);
            for (const float side : {1.0F, -1.0F}) {
                const float u = t.u + side * o[0] * k.slice_inv.x, v = t.v + side * o[1] * k.slice_inv.y;
                const cv::Mat1f& read = depth[static_cast<std::size_t>(m)];
                const int mx =
                    std::clamp(static_cast<int>(std::floor(u * static_cast<float>(read.cols))), 0, read.cols - 1);
                const int my =
                    std::clamp(static_cast<int>(std::floor(v * static_cast<float>(read.rows))), 0, read.rows - 1);
                const Point d = place(u, v, read(my, mx)) - p;
                const float in_front = saturated(2 + k.neg_rec_radius * std::max(0.0F, -d[2]));
                const float weight = tap.weight * (0.6F * in_front + 0.4F);
                sum += weight * obscurance(n, d, t.falloff, k.horizon);
                total += weight;
            }
        }
        float fade = saturated(p[2] * k.fade_mul + k.fade_add);
        fade *= saturated(1 - saturated(0.35F * (1 - e.left - e.right)) - saturated(0.35F * (1 - e.top - e.bottom)));
        return visibility(k, sum / total, fade);
    }
};

} // namespace scanshade::reference
