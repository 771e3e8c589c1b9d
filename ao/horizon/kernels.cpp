#include "ao/horizon/kernels.h"

#include <cmath>
#include <limits>
#include <numbers>

namespace scanshade::horizon {

namespace {

#define INLINE [[gnu::always_inline]] inline

constexpr float infinite = std::numeric_limits<float>::infinity();
constexpr float unknown = std::numeric_limits<float>::quiet_NaN();
constexpr float half_pi = std::numbers::pi_v<float> / 2, degrees = 180 / std::numbers::pi_v<float>;

/// Both comparisons are false for NaN, so that points without data change nothing.
INLINE float larger(float value, float than) { return value > than ? value : than; }
INLINE float smaller(float value, float than) { return value < than ? value : than; }

INLINE float slope(const float* z, const Sample& sample) {
    return (z[sample.a] - *z) * sample.weight_a + (z[sample.b] - *z) * sample.weight_b;
}

INLINE float slope(const float* z, const Offset& offset) { return (z[offset.at] - *z) * offset.scale; }

template <bool both>
INLINE void raise(float slope, float& high, float& low) {
    high = larger(slope, high);
    if constexpr (both)
        low = smaller(slope, low);
}

/// So many samples or offsets in one pass over the row.
template <int at_once, bool both, class Step>
INLINE void raise(const Cells& cells, const Step* steps, Horizons& __restrict found) {
    const float* __restrict z = cells.z;
    std::array<Step, at_once> taken;
    for (int i = 0; i < at_once; ++i)
        taken[static_cast<std::size_t>(i)] = steps[i];
    for (int x = 0, count = cells.count; x < count; ++x) {
        float high = found.high[x], low = found.low[x];
        for (const Step& step : taken)
            raise<both>(slope(z + x, step), high, low);
        found.high[x] = high;
        if constexpr (both)
            found.low[x] = low;
    }
}

/// The slopes of one sample; NaN where neither of its two squares is known.
INLINE void slopes_of(const Cells& cells, const Sample& at, Row& __restrict slopes) {
    const float* __restrict z = cells.z;
    const unsigned char* __restrict known = cells.known;
    const Sample sample = at; // in registers: what is written could be part of it otherwise
    for (int x = 0, count = cells.count; x < count; ++x)
        slopes[x] = slope(z + x, sample);
    for (int x = 0; known && x < cells.count; ++x)
        slopes[x] = (known[x + sample.before] | known[x + sample.behind]) != 0 ? slopes[x] : unknown;
}

INLINE float slope(const float* z, const InnerSample& inner, std::ptrdiff_t stride) {
    const float* corner = z + inner.corner;
    return ((corner[0] - *z) * inner.north_west + (corner[1] - *z) * inner.north_east) +
           ((corner[stride] - *z) * inner.south_west + (corner[stride + 1] - *z) * inner.south_east);
}

INLINE void slopes_of(const Cells& cells, const InnerSample& inner, std::ptrdiff_t stride, Row& __restrict slopes) {
    const float* __restrict z = cells.z;
    const InnerSample sample = inner; // in registers: what is written could be part of it otherwise
    for (int x = 0, count = cells.count; x < count; ++x)
        slopes[x] = slope(z + x, sample, stride);
}

template <bool both>
INLINE void raise(const Row& __restrict slopes, int count, Horizons& __restrict found) {
    for (int x = 0; x < count; ++x)
        raise<both>(slopes[x], found.high[x], found.low[x]);
}

INLINE void start(Horizons& found, int count) {
    for (int x = 0; x < count; ++x)
        found.high[x] = -infinite, found.low[x] = infinite;
}

template <bool both>
INLINE void raise_inner(const Cells& cells, const InnerSample& inner, std::ptrdiff_t stride,
                        Horizons& __restrict found) {
    const float* __restrict z = cells.z;
    const InnerSample sample = inner; // in registers: what is written could be part of it otherwise
    for (int x = 0, count = cells.count; x < count; ++x)
        raise<both>(slope(z + x, sample, stride), found.high[x], found.low[x]);
}

template <bool both>
INLINE void look(const Cells& cells, const Ray& ray, Horizons& found) {
    start(found, cells.count);
    Row slopes;
    const Sample* samples = ray.samples.data();
    const std::size_t count = ray.samples.size();
    std::size_t i = 0;
    for (; !cells.known && i + 4 <= count; i += 4)
        raise<4, both>(cells, samples + i, found);
    for (; i < count; ++i)
        if (!cells.known) {
            raise<1, both>(cells, samples + i, found);
        } else {
            slopes_of(cells, samples[i], slopes);
            raise<both>(slopes, cells.count, found);
        }
    for (const InnerSample& sample : ray.inner)
        raise_inner<both>(cells, sample, ray.stride, found);
}

INLINE void look(const Cells& cells, const Ray& ray, bool both, Horizons& found) {
    both ? look<true>(cells, ray, found) : look<false>(cells, ray, found);
}

/// Where the straight line from a point at distance t0 to one at t1, with these slopes, leaves the ball; as a slope.
INLINE float slope_at_exit(float t0, float s0, float t1, float s1, float radius2) {
    const float dt = t1 - t0, h0 = s0 * t0, dh = s1 * t1 - h0;
    const float a = dt * dt + dh * dh, b = t0 * dt + h0 * dh, c = t0 * t0 + h0 * h0 - radius2;
    const float share = (std::sqrt(b * b - a * c) - b) / a; // NaN where the line passes outside
    const float slope_there = (h0 + share * dh) / (t0 + share * dt);
    return share >= 0 && share <= 1 ? slope_there : -infinite;
}

/// From a point at t0 to one at t1: whether the ball holds the second, or where the surface leaves it.
class BallStep {
  public:
    BallStep(float t0, float t1, float radius)
        : t0_(t0), t1_(t1), limit0_(limit(t0, radius)), limit1_(limit(t1, radius)), radius2_(radius * radius) {}
    [[nodiscard]] INLINE bool inside(float s) const { return s * s <= limit1_; }
    [[nodiscard]] INLINE int leaves(float s0, float s1) const {
        const int from_below = static_cast<int>(s0 < 0) & static_cast<int>(s1 > 0);
        return static_cast<int>(s1 * s1 > limit1_) & (static_cast<int>(s0 * s0 <= limit0_) | from_below);
    }
    /// The slope at the exit; -infinity where there is none.
    [[nodiscard]] INLINE float exit(float s0, float s1) const {
        const float s = slope_at_exit(t0_, s0, t1_, s1, radius2_);
        return leaves(s0, s1) != 0 ? s : -infinite;
    }

  private:
    /// Of the square of a slope at distance t.
    static float limit(float t, float radius) { return t > 0 ? (radius / t) * (radius / t) - 1 : infinite; }

    float t0_, t1_, limit0_, limit1_, radius2_;
};

/// The next point outwards along all rays of a row. Leaving the ball is looked at only where it happens.
INLINE void step_in_ball(const Row& __restrict slopes, int count, const BallStep& step, Row& __restrict before,
                         Horizons& __restrict found) {
    int leaving = 0;
    for (int x = 0; x < count; ++x) {
        found.high[x] = larger(step.inside(slopes[x]) ? slopes[x] : -infinite, found.high[x]);
        leaving |= step.leaves(before[x], slopes[x]);
    }
    for (int x = 0; leaving != 0 && x < count; ++x)
        found.high[x] = larger(step.exit(before[x], slopes[x]), found.high[x]);
    for (int x = 0; x < count; ++x)
        before[x] = slopes[x];
}

INLINE void look_in_ball(const Cells& cells, const Ray& ray, float radius, Horizons& found) {
    start(found, cells.count);
    Row slopes, before;
    for (int x = 0; x < cells.count; ++x)
        before[x] = 0;
    float t0 = 0;
    for (const Step& step : ray.steps) {
        if (step.inner)
            slopes_of(cells, ray.inner[step.index], ray.stride, slopes);
        else
            slopes_of(cells, ray.samples[step.index], slopes);
        step_in_ball(slopes, cells.count, BallStep(t0, step.t, radius), before, found);
        t0 = step.t;
    }
}

INLINE void look_at(const Cells& cells, std::span<const Offset> offsets, Horizons& found) {
    start(found, cells.count);
    std::size_t i = 0;
    for (; i + 4 <= offsets.size(); i += 4)
        raise<4, true>(cells, &offsets[i], found);
    for (; i < offsets.size(); ++i)
        raise<1, true>(cells, &offsets[i], found);
}

/// Within 1e-7: interpolated at Chebyshev's nodes, after reduction to |tan| <= tan(pi / 8).
INLINE float arc_tangent(float slope) {
    constexpr float low = 0.41421356F, high = 2.41421356F; // tan(pi / 8), tan(3 pi / 8)
    const float a = std::abs(slope);
    const bool steep = a > high, middle = a > low;
    const float r = (steep ? -1 : middle ? a - 1 : a) / (steep ? a : middle ? a + 1 : 1);
    const float r2 = r * r;
    const float series =
        0.99999998F + r2 * (-0.33332786F + r2 * (0.19974082F + r2 * (-0.13848490F + r2 * 0.07976292F)));
    const float angle = (steep ? half_pi : middle ? half_pi / 2 : 0) + r * series;
    return slope < 0 ? -angle : angle;
}

/// The share of a direction's light that passes above the horizon, on the surface itself; without the factor n_z.
/// `plane` is the slope of the surface in this direction.
INLINE float light_on_surface(float high, float plane) {
    const float t = larger(high, plane), cos2 = 1 / (1 + t * t);
    return cos2 - plane * (half_pi - arc_tangent(t) - t * cos2);
}

INLINE float above_ground(float high) { return larger(high, 0); }
INLINE float open_solid_angle(float high) { return 1 - high / std::sqrt(1 + high * high); }
INLINE float light_on_level(float high) { return 1 / (1 + high * high); }

INLINE void add_sky(const Row& high, int count, const Part& part, const Sums& sums) {
    const float* __restrict plane = part.plane;
    float* __restrict svf = sums.svf;
    float* __restrict asvf = sums.asvf;
    if (svf && sums.definition == Definition::solid_angle)
        for (int x = 0; x < count; ++x)
            svf[x] += open_solid_angle(above_ground(high[x]));
    if (svf && sums.definition == Definition::horizontal)
        for (int x = 0; x < count; ++x)
            svf[x] += light_on_level(above_ground(high[x]));
    if (svf && sums.definition == Definition::surface)
        for (int x = 0; x < count; ++x)
            svf[x] += light_on_surface(high[x], plane[x]);
    if (asvf)
        for (int x = 0; x < count; ++x)
            asvf[x] += part.weight * open_solid_angle(above_ground(high[x]));
}

INLINE void add(const Horizons& found, int count, const Part& part, const Sums& sums) {
    const float* __restrict plane = part.plane;
    Row high;
    for (int x = 0; x < count; ++x)
        high[x] = found.high[x] == -infinite ? plane[x] : found.high[x];
    add_sky(high, count, part, sums);
    float* __restrict openness = sums.openness;
    float* __restrict openness_neg = sums.openness_neg;
    float* __restrict ao = sums.ao;
    if (openness)
        for (int x = 0; x < count; ++x)
            openness[x] += (half_pi - arc_tangent(high[x])) * degrees;
    if (openness_neg)
        for (int x = 0; x < count; ++x)
            openness_neg[x] += (half_pi + arc_tangent(found.low[x] == infinite ? plane[x] : found.low[x])) * degrees;
    if (ao)
        for (int x = 0; x < count; ++x)
            ao[x] += light_on_surface(high[x], plane[x]);
}

void look_any(const Cells& cells, const Ray& ray, bool both, Horizons& found) { look(cells, ray, both, found); }
void look_in_ball_any(const Cells& cells, const Ray& ray, float radius, Horizons& found) {
    look_in_ball(cells, ray, radius, found);
}
void look_at_any(const Cells& cells, std::span<const Offset> offsets, Horizons& found) {
    look_at(cells, offsets, found);
}
void add_any(const Horizons& found, int count, const Part& part, const Sums& sums) { add(found, count, part, sums); }

#if defined(__x86_64__)
// Without fused multiplications, so that all processors find the same values.
[[gnu::target("avx2")]] void look_avx2(const Cells& cells, const Ray& ray, bool both, Horizons& found) {
    look(cells, ray, both, found);
}
[[gnu::target("avx2")]] void look_in_ball_avx2(const Cells& cells, const Ray& ray, float radius, Horizons& found) {
    look_in_ball(cells, ray, radius, found);
}
[[gnu::target("avx2")]] void look_at_avx2(const Cells& cells, std::span<const Offset> offsets, Horizons& found) {
    look_at(cells, offsets, found);
}
[[gnu::target("avx2")]] void add_avx2(const Horizons& found, int count, const Part& part, const Sums& sums) {
    add(found, count, part, sums);
}
#endif

Kernels kernels_here() {
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx2"))
        return {&look_avx2, &look_in_ball_avx2, &look_at_avx2, &add_avx2};
#endif
    return {&look_any, &look_in_ball_any, &look_at_any, &add_any};
}

} // namespace

const Kernels& kernels() {
    static const Kernels here = kernels_here();
    return here;
}

} // namespace scanshade::horizon
