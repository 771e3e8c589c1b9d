// The settings of CACAO: one row each.
#include "ao/cacao/cacao.h"

namespace scanshade {
namespace {

using MaybeCurve = std::optional<CacaoToneCurve>;
constexpr std::array tone_curve_words{Named{"auto", MaybeCurve()},
                                      Named{"calibrated", MaybeCurve(CacaoToneCurve::calibrated)},
                                      Named{"documented", MaybeCurve(CacaoToneCurve::documented)}};

using MaybeStorage = std::optional<CacaoStorage>;
constexpr std::array storage_words{Named{"auto", MaybeStorage()}, Named{"buffers", MaybeStorage(CacaoStorage::buffers)},
                                   Named{"images", MaybeStorage(CacaoStorage::images)}};

} // namespace

std::vector<Parameter> CacaoOptions::parameters() { // NOLINT(readability-function-size): a table
    return {
        {.name = "profile",
         .help = "reference reproduces AMD's shaders; scan corrects them for sensor depth",
         .value = OneOf(&profile, cacao_profile_words)},
        {.name = "quality",
         .help = "tap pairs: lowest 3 on half the pixels, low 3, medium 5, high 12 with depth mips, highest 6 to 31 by "
                 "need. Times relative to high: 0.4, 0.6, 0.75, 1, 1.6. On the generated office, highest is no more "
                 "accurate than high",
         .value = OneOf(&quality, quality_words)},
        {.name = "downsampled",
         .help = "compute every second pixel of every second row, then upsample",
         .value = &downsampled},
        {.name = "radius",
         .help = "surfaces farther than this do not occlude",
         .value = &radius,
         .unit = "m",
         .low = 1e-4,
         .high = 1e5},
        {.name = "look",
         .help = "the tone curve from obscurance to visibility. documented: AMD's; calibrated: nearer to ray-traced "
                 "truth, with 0.294 times the multiplier and 3.33 times the power. auto: calibrated in scan, "
                 "documented in reference",
         .value = OneOf(&tone_curve, tone_curve_words)},
        {.name = "shadow-multiplier",
         .help = "linear strength of the effect",
         .value = &shadow_multiplier,
         .low = 0,
         .high = 5},
        {.name = "shadow-power",
         .help = "strength of the effect as an exponent of visibility",
         .value = &shadow_power,
         .low = 0,
         .high = 10},
        {.name = "shadow-clamp",
         .help = "highest obscurance allowed before the exponent",
         .value = &shadow_clamp,
         .low = 0,
         .high = 1},
        {.name = "horizon-angle",
         .help = "samples lower above the surface than this do not occlude",
         .value = &horizon_angle,
         .unit = "sine",
         .low = 0,
         .high = 1},
        {.name = "fade-from",
         .help = "depth at which AO starts to fade out. If this and fade-to are 0, scan never fades, and reference "
                 "fades from 50 to 300 m",
         .value = &fade_from,
         .unit = "m",
         .low = 0,
         .high = 1e30},
        {.name = "fade-to",
         .help = "depth at which AO has faded out",
         .value = &fade_to,
         .unit = "m",
         .low = 0,
         .high = 1e30},
        {.name = "adaptive-limit",
         .help = "quality highest: extra taps are rationed where the mean importance exceeds this",
         .value = &adaptive_limit,
         .low = 0,
         .high = 1},
        {.name = "blur-passes", .help = "edge-aware blur steps", .value = &blur_passes, .low = 0, .high = 8},
        {.name = "sharpness", .help = "how strongly edges stop the blur", .value = &sharpness, .low = 0, .high = 1},
        {.name = "detail-strength",
         .help = "strength of the shadows cast by adjacent pixels",
         .value = &detail_strength,
         .low = 0,
         .high = 100},
        {.name = "sigma-squared",
         .help = "upsampler: spatial sigma squared",
         .value = &sigma_squared,
         .unit = "half-size pixels^2",
         .low = 1e-3,
         .high = 1e6},
        {.name = "depth-sigma-squared",
         .help = "upsampler: depth sigma squared",
         .value = &depth_sigma_squared,
         .unit = "m^2",
         .low = 1e-9,
         .high = 1e6},
        {.name = "depth-input",
         .help = "what the depth image holds: metres, or device depth with the near plane at 0 (normal_z) or at 1 "
                 "(reverse_z)",
         .value = OneOf(&depth_input, cacao_depth_input_words)},
        {.name = "near", .help = "near plane of device depth", .value = &near_m, .unit = "m", .low = 1e-6, .high = 1e6},
        {.name = "far", .help = "far plane of device depth", .value = &far_m, .unit = "m", .low = 1e-6, .high = 1e9},
        {.name = "normals-mul",
         .help = "supplied normals are multiplied by this",
         .value = &normals_mul,
         .low = -1e3,
         .high = 1e3},
        {.name = "normals-add",
         .help = "this is added to the multiplied normals",
         .value = &normals_add,
         .low = -1e3,
         .high = 1e3},
        {.name = "storage",
         .help = "where the passes keep depth. auto: images on GPUs, buffers on CPUs; reference always uses buffers",
         .value = OneOf(&storage, storage_words)},
    };
}

} // namespace scanshade
