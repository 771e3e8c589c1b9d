// What a person sets of CACAO.
#include "ao/cacao/cacao.h"
#include "projection/error.h"

#include <algorithm>
#include <array>

namespace scanshade {

std::vector<Parameter> CacaoOptions::parameters() {
    return {
        {"profile",
         "reference reproduces AMD's shaders, scan corrects them for sensor depth",
         &profile,
         "",
         {},
         {},
         {"scan", "reference"}},
        {"quality",
         "lowest: 3 tap pairs on half the pixels, 0.4 of high's time; low: 3, 0.6; medium: 5, 0.75; high: 12 with "
         "depth mips, 1; "
         "highest: 6 to 31 where the picture asks for them, 1.6, and no closer to ray-traced truth than high on the "
         "generated office",
         &quality,
         "",
         {},
         {},
         {"lowest", "low", "medium", "high", "highest"}},
        {"downsampled", "compute on every second pixel of every second row, then upsample", &downsampled},
        {"radius", "surfaces farther than this do not occlude", &radius, "m", 1e-4, 1e5},
        {"look",
         "how obscurance becomes visibility: as AMD documents it, or nearer to truth (0.294 times the multiplier, 3.33 "
         "times the "
         "power); auto: calibrated in scan",
         &look,
         "",
         {},
         {},
         {"auto", "calibrated", "documented"}},
        {"shadow-multiplier", "strength of the effect, linear", &shadow_multiplier, "", 0, 5},
        {"shadow-power", "strength of the effect, exponent of visibility", &shadow_power, "", 0.5, 5},
        {"shadow-clamp", "darkest obscurance before the exponent", &shadow_clamp, "", 0, 1},
        {"horizon-angle", "samples lower above the surface than this do not occlude", &horizon_angle, "sine", 0, 0.2},
        {"fade-from",
         "depth at which AO starts to fade out; this and the next 0: never in scan, 50 to 300 m in the reference",
         &fade_from, "m", 0, 1e6},
        {"fade-to", "depth at which AO has faded out", &fade_to, "m", 0, 1e6},
        {"adaptive-limit", "highest: mean importance above which extra taps are rationed", &adaptive_limit, "", 0, 1},
        {"blur-passes", "edge-aware blur steps", &blur_passes, "", 0, 8},
        {"sharpness", "how little the blur crosses edges", &sharpness, "", 0, 1},
        {"detail-strength", "strength of the shadows cast by adjacent pixels", &detail_strength, "", 0, 5},
        {"sigma-squared", "upsampler: spatial sigma squared", &sigma_squared, "half-size pixels^2", 1e-3, 1e3},
        {"depth-sigma-squared", "upsampler: depth sigma squared", &depth_sigma_squared, "m^2", 1e-9, 1e6},
        {"depth-input", "what the depth image holds", &depth_input, "", {}, {}, {"metric", "normal_z", "reverse_z"}},
        {"near", "near plane of device depth", &near_m, "m", 1e-6, 1e6},
        {"far", "far plane of device depth", &far_m, "m", 1e-6, 1e9},
        {"normals-mul", "supplied normals are multiplied by this", &normals_mul, "", -1e3, 1e3},
        {"normals-add", "then this is added", &normals_add, "", -1e3, 1e3},
        {"storage",
         "where depth lies between the passes; auto: images on GPUs, buffers on CPUs and for the reference",
         &storage,
         "",
         {},
         {},
         {"auto", "buffers", "images"}},
    };
}

CacaoQuality CacaoOptions::level() const {
    constexpr std::array names{"lowest", "low", "medium", "high", "highest"};
    const auto* const found = std::find(names.begin(), names.end(), quality);
    if (found == names.end())
        throw Misuse("quality '" + quality + "': lowest, low, medium, high or highest expected");
    return static_cast<CacaoQuality>(found - names.begin());
}

} // namespace scanshade
