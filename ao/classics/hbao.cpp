#include "ao/classics/hbao.h"

#include "ao/screen/fitted_curves.h"
#include "shaders/shared/hbao.h"

#include <array>
#include <cmath>
#include <numbers>

namespace scanshade {
namespace {

struct Count {
    Quality quality;
    int directions, steps;
};
/// More than four steps find ever higher horizons of a surface without a thickness: clean depth had an error of 0.132
/// with 8x4, 0.145 with 8x8 and 0.162 with 32x16. High qualities have more directions in place of them.
constexpr std::array counts{Count{Quality::lowest, 4, 2}, Count{Quality::low, 4, 4}, Count{Quality::medium, 8, 4},
                            Count{Quality::high, 16, 4}, Count{Quality::highest, 64, 4}};
/// HBAO+ sums what each step sees, so steps do it no harm.
constexpr std::array counts_of_plus{Count{Quality::lowest, 4, 2}, Count{Quality::low, 4, 4},
                                    Count{Quality::medium, 8, 4}, Count{Quality::high, 8, 8},
                                    Count{Quality::highest, 32, 16}};

/// The quality's values, except those given.
Count count_of(const HbaoOptions& options) {
    Count count = level_of(options.profile == HbaoProfile::plus ? counts_of_plus : counts, options.quality);
    if (options.directions > 0)
        count.directions = options.directions;
    if (options.steps > 0)
        count.steps = options.steps;
    return count;
}

constexpr float bias_of_plus = 5.739F; // degrees: a sine of 0.1, as published

constexpr std::array hbao_profile_words{Named{"metric", HbaoProfile::metric},
                                        Named{"published", HbaoProfile::published}, Named{"plus", HbaoProfile::plus}};

HbaoOptions resolved(HbaoOptions options) {
    options = checked(std::move(options));
    const bool plus = options.profile == HbaoProfile::plus;
    if (options.interleaved && !plus)
        throw Misuse("interleaved is of profile plus only");
    if (options.screen.curve == fitted_curve)
        options.screen.curve = plus ? fitted_curve_of("hbao plus", options.quality) : 0.0F; // horizons do without
    if (options.profile == HbaoProfile::metric)
        return options;
    options.bias_degrees = plus ? bias_of_plus : 30;
    options.attenuated = true;
    return options;
}

/// The pass of HBAO+, before it that of its layers where there are any.
void add_plus(ScreenTables& tables, bool interleaved) {
    int depth = screen_depth;
    const shared::ivec2 plane = shared::layer_size({tables.size.width, tables.size.height});
    const cv::Size over = interleaved ? cv::Size(plane.x, plane.y) : tables.size;
    if (interleaved) {
        depth = tables.add_buffer({"layers", 16 * static_cast<std::size_t>(over.area()) * 4, gpu::BufferRow::Host::none,
                                   gpu::BufferRow::Texels::r32f});
        tables.add_pass_over(over, "layers", "hbao/layers", {screen_depth}, {depth});
        tables.passes.back().groups[2] = 16;
    }
    tables.add_pass_over(over, "generate", "hbao/plus", {depth, screen_surfaces, screen_noise}, {screen_raw},
                         {{shared::spec_interleaved, interleaved}});
    tables.passes.back().groups[2] = interleaved ? 16 : 1;
}

float contrast_of(HbaoProfile profile) {
    if (profile == HbaoProfile::published)
        return 1.25F;
    return profile == HbaoProfile::plus ? 2.0F : 1.0F;
}

} // namespace

std::vector<Parameter> HbaoOptions::parameters() {
    return joined(joined(screen.parameters(), {screen.curve_row()}),
                  {
                      {.name = "profile",
                       .help = "metric weighs all samples within the radius alike; published uses bias 30, attenuated, "
                               "contrast 1.25; plus is HBAO+, a sum of attenuated samples without a horizon",
                       .value = OneOf(&profile, hbao_profile_words)},
                      {.name = "quality",
                       .help = "directions x steps: lowest 4x2, low 4x4, medium 8x4, high 16x4, highest 64x4; of "
                               "profile plus 8x8 and 32x16",
                       .value = OneOf(&quality, quality_words)},
                      {.name = "directions",
                       .help = "directions in the image; 0 = as the quality says",
                       .value = &directions,
                       .low = 0,
                       .high = 128},
                      {.name = "steps",
                       .help = "steps along each direction; 0 = as the quality says",
                       .value = &steps,
                       .low = 0,
                       .high = 256},
                      {.name = "bias",
                       .help = "horizons lower above the tangent plane than this do not occlude",
                       .value = &bias_degrees,
                       .unit = "degrees",
                       .low = 0,
                       .high = 89},
                      {.name = "attenuated",
                       .help = "samples count less with the square of their distance; otherwise all within the radius "
                               "count alike",
                       .value = &attenuated},
                      {.name = "interleaved",
                       .help = "of profile plus: a pixel looks only at pixels a multiple of four away, which suits "
                               "devices with small caches",
                       .value = &interleaved},
                  });
}

Hbao::Hbao(gpu::Device& device, const HbaoOptions& options)
    : ScreenMethod(device, resolved(options).screen), options_(resolved(options)) {}

void Hbao::add_passes(ScreenTables& tables) const {
    if (options_.profile == HbaoProfile::plus)
        add_plus(tables, options_.interleaved);
    else
        tables.add_pass("generate", "hbao/generate", {screen_depth, screen_surfaces, screen_noise}, {screen_raw});
}

std::vector<std::byte> Hbao::constants(const shared::ScreenConstants& screen) const {
    const Count count = count_of(options_);
    const double turn = 2 * std::numbers::pi / count.directions, bias = options_.bias_degrees * std::numbers::pi / 180;
    return bytes_of(shared::HbaoConstants{screen, count.directions, count.steps, static_cast<float>(std::cos(turn)),
                                          static_cast<float>(std::sin(turn)), static_cast<float>(std::cos(bias)),
                                          static_cast<float>(std::sin(bias)), options_.attenuated ? 1.0F : 0.0F,
                                          contrast_of(options_.profile)});
}

} // namespace scanshade
