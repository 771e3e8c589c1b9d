// CACAO: AMD's Combined Adaptive Compute Ambient Occlusion 1.3, after its public documentation, for recorded depth.
//
// Two profiles, each with its own shaders and table of passes. `reference` (reference.cpp, shaders/cacao/reference)
// reproduces AMD's output, quirks included, so that anyone can check us against the original. `scan` (scan.cpp,
// shaders/cacao/scan), the default, is the same algorithm for metric sensor depth; its departures are named in the
// README and each has a test that fails without it.
#pragma once

#include "ao/gpu/program.h"
#include "ao/method.h"
#include "shaders/shared/cacao.h"

#include <array>
#include <cstddef>
#include <optional>

namespace scanshade {

/// AMD's quality presets, cheapest first.
enum class CacaoQuality { lowest, low, medium, high, highest };

/// What a person sets. Names and defaults follow AMD's documentation; `radius` and the depths are metres.
struct CacaoOptions {
    std::string profile = "scan";
    std::string quality = "high";
    bool downsampled = false;
    float radius = 0.5F;
    std::string look =
        "auto"; ///< how obscurance becomes visibility; auto: calibrated in `scan`, documented in `reference`
    float shadow_multiplier = 1.0F;
    float shadow_power = 1.5F;
    float shadow_clamp = 0.98F;
    float horizon_angle = 0.06F;
    float fade_from = 0.0F, fade_to = 0.0F; ///< both 0: never in `scan`, 50 .. 300 m in `reference`
    float adaptive_limit = 0.45F;
    int blur_passes = 2;
    float sharpness = 0.98F;
    float detail_strength = 0.5F;
    float sigma_squared = 5.0F;
    float depth_sigma_squared = 0.01F;
    std::string depth_input = "metric";
    float near_m = 0.1F;
    float far_m = 1000.0F;
    float normals_mul = 1.0F;
    float normals_add = 0.0F;
    std::string storage = "auto";
    std::optional<float>
        outside_depth; ///< reference only: what loads outside the image read; default: device depth 0, linearised

    [[nodiscard]] std::vector<Parameter> parameters();
    /// Throws Misuse for a name that is no quality.
    [[nodiscard]] CacaoQuality level() const;
    [[nodiscard]] bool scan() const { return profile == "scan"; }
};

/// The constant block of one frame size and camera. Clamps as AMD's host code does.
[[nodiscard]] shared::CacaoConstants constants_from(const CacaoOptions& options, const Pinhole& camera);

/// Pattern rotation and scale of slice 0 .. 3, phase 0 .. 4 (PatternRotScaleMatrices); the matrix is (x, y; y, -x).
[[nodiscard]] shared::vec2 cacao_rotation(int slice, int phase);

/// The buffers of CACAO by name; the rows of CacaoTables::buffers are in this order.
enum CacaoBuffer : int {
    cacao_depth_in,
    cacao_normals_in,
    cacao_depths,
    cacao_normals,
    cacao_ping,
    cacao_pong,
    cacao_importance,
    cacao_importance_pong,
    cacao_counter,
    cacao_blur_a,
    cacao_blur_b,
    cacao_staged,
    cacao_pattern,
    cacao_out,
    cacao_buffer_count
};

/// Everything one configuration runs, as plain data.
struct CacaoTables {
    std::vector<gpu::BufferRow> buffers;
    std::vector<gpu::PassRow> passes;
    int blurred = cacao_ping; ///< which buffer holds AO after the blur
};
/// How the passes keep what they hand on: in buffers, or depth in images and the last blur steps and the resolve in one
/// pass. The same kernels and, but for rounding, the same maps; CPUs are faster with the first, GPUs with the second.
enum class CacaoStorage { buffers, images };
[[nodiscard]] CacaoStorage cacao_storage(const CacaoOptions& options, const gpu::Device& device);

[[nodiscard]] CacaoTables cacao_tables(const CacaoOptions& options, const shared::CacaoConstants& constants,
                                       bool normals_supplied, CacaoStorage storage = CacaoStorage::buffers);

class Cacao final : public Method {
  public:
    /// Throws Misuse naming a setting out of its range.
    Cacao(gpu::Device& device, CacaoOptions options);

    AoMap compute(const View& view) override;
    [[nodiscard]] const Timings& timings() const override { return timings_; }

    /// Buffers between the passes of the last compute(): depth slices by mip, normals, base pass, importance, AO before
    /// and after the blur, load counter. Empty before the first compute().
    [[nodiscard]] std::vector<Intermediate> intermediates() override;

  private:
    void prepare(const View& view);
    Intermediate depth_slices(int mip);
    Intermediate tap_pairs(const Intermediate& importance, const Intermediate& load_counter) const;

    gpu::Device& device_;
    CacaoOptions options_;
    Pinhole camera_; // that constants_ and program_ were made for
    bool normals_supplied_ = false;
    shared::CacaoConstants constants_{};
    CacaoTables tables_;
    std::unique_ptr<gpu::Program> program_;
    Timings timings_;
};

} // namespace scanshade
