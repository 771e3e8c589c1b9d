#include "projection/sensor/depth_jumps.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#include <vector>

namespace scanshade {
namespace {

/// Jumps from one even surface to another within 2 reach - 1 pixels, by how many of these lie between both.
struct JumpCount {
    double all = 0, sharp = 0, smeared = 0; // without such a pixel; with two and more
};
constexpr std::array<int, 3> reaches{2, 4, 8}; // pixels from the middle to the first one of either surface
using JumpCounts = std::array<JumpCount, reaches.size()>;

constexpr double enough_jumps = 50;

Jumps kind_of(const JumpCounts& counts) {
    // Depth resized or smoothed has 0.8 with two and more, and hardly any without: by the reach that spans its edges.
    // Rendered depth has 0.1 with two and more over the shortest reach. Over longer ones its slopes count, too, but
    // sharp jumps are as many. Time of flight mixes one pixel: 0.35 are sharp, and 0.8 and more of rendered depth.
    constexpr double least_smeared = 0.4, few_sharp = 0.05, least_sharp = 0.7;
    for (const JumpCount& count : counts)
        if (count.all > enough_jumps && count.smeared > least_smeared * count.all &&
            count.sharp < few_sharp * count.all)
            return Jumps::smeared;
    const JumpCount& near = counts.front();
    return near.all > enough_jumps && near.sharp < least_sharp * near.all ? Jumps::unknown : Jumps::sharp;
}

/// Along a row or a column: `next` is from one value to the next.
void count_jump(const float* at, std::ptrdiff_t next, int reach, JumpCount& count) {
    const float before = at[-reach * next], after = at[reach * next], jump = std::abs(after - before);
    const float even = 0.15F * jump / static_cast<float>(reach); // a third of the mean slope between
    const auto is_even = [&](float here, float beyond) {
        return here > 0 && beyond > 0 && std::abs(here - beyond) <= even;
    };
    if (!(jump >= 0.1F && jump >= 0.05F * std::min(before, after)) || !is_even(before, at[-(reach + 1) * next]) ||
        !is_even(after, at[(reach + 1) * next]))
        return;
    float share = 0; // of the way, which goes on in one direction
    int mixed = 0;
    for (int i = -reach + 1; i < reach; ++i) {
        const float here = at[i * next], then = (here - before) / (after - before);
        if (!(here > 0) || then < share - 0.05F || then > 1.05F)
            return;
        share = then;
        mixed += share > 0.15F && share < 0.85F ? 1 : 0;
    }
    const double once = 1.0 / (2 * reach - mixed); // it is met from as many middles
    count.all += once;
    count.sharp += mixed == 0 ? once : 0;
    count.smeared += mixed >= 2 ? once : 0;
}

void count_jumps(const cv::Mat1f& z, int reach, JumpCount& count) {
    constexpr int line_px = 6; // every sixth row and column is plenty
    const auto down = static_cast<std::ptrdiff_t>(z.step1());
    const int border = reach + 1;
    for (int y = border; y < z.rows - border; ++y) {
        if (y % line_px == 0)
            for (int x = border; x < z.cols - border; ++x)
                count_jump(z[y] + x, 1, reach, count);
        for (int x = line_px * (border / line_px + 1); x < z.cols - border; x += line_px)
            count_jump(z[y] + x, down, reach, count);
    }
}

} // namespace

JumpsSeen jumps_of(std::span<const DepthImage> images) {
    std::vector<JumpCount> each(images.size() * reaches.size());
    tbb::this_task_arena::isolate([&] {
        tbb::parallel_for(std::size_t(0), each.size(), [&](std::size_t i) {
            count_jumps(images[i / reaches.size()].z_m, reaches[i % reaches.size()], each[i]);
        });
    });
    JumpCounts sums;
    for (std::size_t i = 0; i < each.size(); ++i) {
        JumpCount& sum = sums[i % reaches.size()];
        sum.all += each[i].all;
        sum.sharp += each[i].sharp;
        sum.smeared += each[i].smeared;
    }
    const JumpCount& near = sums.front();
    return {kind_of(sums), near.all > enough_jumps ? near.sharp / near.all : 0};
}

} // namespace scanshade
