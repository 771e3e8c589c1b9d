// Options and camera -> the constant block that the shaders read; and the rotations of the sampling pattern.
#include "ao/cacao/cacao.h"
#include "ao/cacao/plan.h"

#include <algorithm>
#include <cmath>

namespace scanshade {
namespace {

using shared::CacaoConstants;
using shared::vec2;

constexpr float pi = 3.14159265358979323846F;

int halved(int n) { return (n + 1) / 2; }

/// Device depth d -> z = mu / (alpha - d), with z positive for both orders of near and far.
vec2 depth_unpack(const CacaoOptions& options) {
    const float n = options.near_m, f = options.far_m;
    const bool reverse = options.depth_input == CacaoDepthInput::reverse_z;
    const float p22 = reverse ? n / (n - f) : f / (f - n); // z' = p22 + p23 / z, left-handed
    const float p23 = reverse ? -f * n / (n - f) : -n * f / (f - n);
    const float mu = -p23;
    return {mu, mu * p22 < 0 ? -p22 : p22};
}

void set_sizes(CacaoConstants& k, const CacaoOptions& options, cv::Size image) {
    k.image = {image.width, image.height};
    k.slice = {halved(image.width), halved(image.height)};
    if (options.downsampled)
        k.slice = {halved(k.slice.x), halved(k.slice.y)};
    k.importance = {halved(k.slice.x), halved(k.slice.y)};
    k.grid = {halved(image.width) + 4, halved(image.height) + 4};
    k.slice_inv = {1.0F / static_cast<float>(k.slice.x), 1.0F / static_cast<float>(k.slice.y)};
    k.image_inv = {1.0F / static_cast<float>(image.width), 1.0F / static_cast<float>(image.height)};
    // Shifts alone find where a mip starts: strides are multiples of 24 and rows of 8, so 4/3 of mip 0 is divisible by
    // 64. Each mip ends with at least one column and one row that nothing writes. They serve as the left and upper rim,
    // too. The first slice has a row before it.
    k.depth_stride = 24 * groups_of(8 * groups_of(k.slice.x, 8) + 8, 24);
    const int padded = k.depth_stride * 8 * (groups_of(k.slice.y, 8) + 1), lead = k.depth_stride + 8;
    k.depth_mips = padded / 3 * 4;
    k.depth_end = lead + k.depth_mips;
    k.depth_pitch = k.depth_end - (k.depth_mips >> 8);
}

void set_camera(CacaoConstants& k, const Pinhole& camera) {
    const float width = static_cast<float>(camera.size.width), height = static_cast<float>(camera.size.height);
    const auto c = camera.on_gpu();
    k.view_mul = {width / c.fx, -height / c.fy};
    k.view_add = {-(c.cx + 0.5F) / c.fx, (c.cy + 0.5F) / c.fy};
    k.ray_step = {1.0F / c.fx, -1.0F / c.fy};
    k.ray_base = {static_cast<float>(-camera.cx / camera.fx), static_cast<float>(camera.cy / camera.fy)};
}

} // namespace

shared::vec2 cacao_rotation(int a, int phase) {
    constexpr std::array<int, 5> order{0, 1, 4, 3, 2};
    const float b = static_cast<float>(order[static_cast<std::size_t>(phase)]);
    const float slice = static_cast<float>(a);
    const float angle = (slice + b / 5.0F) * (pi * 0.5F);
    const float scale = 1.0F + (slice - 1.5F + (b - 2.0F) / 5.0F) * 0.07F;
    return {scale * std::cos(angle), -scale * std::sin(angle)};
}

CacaoConstants constants_from(const CacaoOptions& options, const Pinhole& camera) {
    CacaoConstants k{};
    set_sizes(k, options, camera.size);
    set_camera(k, camera);
    k.depth_unpack = depth_unpack(options);
    const float at_zero = k.depth_unpack.y == 0 ? 0.0F : k.depth_unpack.x / k.depth_unpack.y;
    k.outside_depth = options.outside_depth.value_or(options.depth_input == CacaoDepthInput::metric ? 0.0F : at_zero);

    const float wide = options.quality <= Quality::low ? 1.5F : 1.0F;
    const float tan_half_height = static_cast<float>(camera.size.height) / (2.0F * static_cast<float>(camera.fy));
    k.radius = std::clamp(options.radius, 0.0F, 100000.0F) * (options.quality == Quality::lowest ? 0.8F : 1.0F);
    k.neg_rec_radius = -1.0F / k.radius;
    k.near_limit_rec = 1.0F / ((options.radius * 1.2F * wide) / tan_half_height);
    k.mip_weight =
        options.scan() ? -1.0F / (k.radius * k.radius) : k.neg_rec_radius * k.radius; // AMD's slip: always -1
    // The factors were fitted to ray-traced truth (developers_bench calibrate): AMD's curve leaves corners far too
    // dark.
    const CacaoToneCurve own = options.scan() ? CacaoToneCurve::calibrated : CacaoToneCurve::documented;
    const bool calibrated = options.tone_curve.value_or(own) == CacaoToneCurve::calibrated;
    k.shadow_strength = std::clamp(4.3F * options.shadow_multiplier * (calibrated ? 0.294F : 1.0F), 0.0F, 10.0F);
    // Not quite 0: the power 0 of visibility 0 is undefined in shaders.
    k.shadow_power =
        std::clamp(options.shadow_power * (calibrated ? 5.0F / 1.5F : 1.0F), 1e-6F, calibrated ? 100.0F : 10.0F);
    k.shadow_clamp = std::clamp(options.shadow_clamp, 0.0F, 1.0F);
    k.horizon = std::clamp(options.horizon_angle, 0.0F, 1.0F);
    const bool documented = options.fade_to == 0 && options.fade_from == 0 && !options.scan();
    const float from = documented ? 50.0F : options.fade_from, to = documented ? 300.0F : options.fade_to;
    k.fade_mul = to > from ? -1.0F / (to - from) : 0.0F;
    k.fade_add = to > from ? from / (to - from) + 1.0F : 1.0F;
    k.all_ones = ~0U;
    k.depth_offset = 0.9992F;
    k.load_counter_div = static_cast<float>(9.0 / (static_cast<double>(texels_of(k.importance)) * 255.0));
    k.adaptive_limit = options.adaptive_limit;
    k.inv_sharpness = std::clamp(1.0F - options.sharpness, 0.0F, 1.0F);
    k.sigma_spatial = options.sigma_squared;
    k.sigma_depth = options.depth_sigma_squared;
    k.detail_strength = options.detail_strength;
    k.normals_mul = options.normals_mul;
    k.normals_add = options.normals_add;
    for (int odd = 0; odd < 2; ++odd)
        for (int tap = -2; tap <= 2; ++tap) {
            const float d = static_cast<float>(tap) - 0.5F * static_cast<float>(odd);
            k.spatial[5 * odd + tap + 2] = std::exp(-d * d / options.sigma_squared);
        }
    return k;
}

} // namespace scanshade
