// The settings of clouds: their rows, and how their words are read.
#include "ao/cloud/cloud_ao.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <fmt/format.h>

namespace scanshade {
namespace {

using Eigen::Vector3d;

/// "1,0,-2.5" as three numbers; none where it is anything else.
std::optional<Vector3d> triple(const std::string& text) {
    Vector3d values;
    const char *at = text.data(), *end = at + text.size();
    for (int axis = 0; axis < 3; ++axis) {
        if (axis > 0 && (at == end || *at++ != ','))
            return std::nullopt;
        const auto [stop, trouble] = std::from_chars(at, end, values[axis]);
        if (trouble != std::errc() || !std::isfinite(values[axis]))
            return std::nullopt;
        at = stop;
    }
    return at == end ? std::optional(values) : std::nullopt;
}

constexpr std::array normals_words{Named{"auto", CloudNormals::automatic}, Named{"recorded", CloudNormals::recorded},
                                   Named{"estimated", CloudNormals::estimated}};

} // namespace

std::vector<Parameter> CloudAoOptions::parameters() {
    return {
        {.name = "radius",
         .help = "surfaces farther away than this do not occlude, in the cloud's unit; 0 = from the cloud's extent and "
                 "spacing",
         .value = &radius,
         .low = 0,
         .high = 1e9},
        {.name = "rays",
         .help = "rays per point; 0 = 64 on a GPU, else 16, or fewer where the radius spans many spacings",
         .value = &rays,
         .low = 0,
         .high = 16384},
        {.name = "smooth",
         .help = "how often a value becomes the mean of its neighbours on the same surface; -1 = twice, or more where "
                 "the radius spans many spacings",
         .value = &smooth,
         .low = -1,
         .high = 16},
        {.name = "sky",
         .help = "computes the share of the sky that a point sees at any distance, instead of what is open within the "
                 "radius",
         .value = &sky},
        {.name = "up", .help = "the direction of the sky, x,y,z", .value = &up},
        {.name = "outside",
         .help =
             "where normals point: auto, up, outward, inward, or to the scanner at x,y,z; all but auto turn recorded "
             "ones, too",
         .value = &outside},
        {.name = "normals",
         .help = "which normals are used; auto = recorded ones where they agree with the planes of the points",
         .value = OneOf(&normals, normals_words)},
        {.name = "memory",
         .help = "memory for the points; larger clouds are computed in tiles",
         .value = &memory_mib,
         .unit = "MiB",
         .low = 64,
         .high = 1 << 20},
        {.name = "seed", .help = "scrambles the rays", .value = &seed, .low = 0, .high = 2147483647},
    };
}

CloudAo::CloudAo(CloudAoOptions options, gpu::Device* device) : options_(std::move(options)), device_(device) {
    for (const Parameter& row : options_.parameters())
        check(row);
    const auto up = triple(options_.up);
    if (!up || !(up->norm() > 0))
        throw Misuse(fmt::format("up: '{}' given, expected a direction x,y,z such as 0,0,1", options_.up));
    up_ = up->normalized();
    viewpoint_ = triple(options_.outside);
    constexpr std::array words{"auto", "up", "outward", "inward"};
    if (!viewpoint_ && std::find(words.begin(), words.end(), options_.outside) == words.end())
        throw Misuse(fmt::format("outside: '{}' given, expected auto, up, outward, inward, or a position x,y,z",
                                 options_.outside));
}

} // namespace scanshade
