// CACAO: AMD's Combined Adaptive Compute Ambient Occlusion 1.3, after its public documentation, for recorded depth.
//
// Two profiles, each with its own shaders and table of passes. `reference` (reference.cpp, shaders/cacao/reference)
// reproduces AMD's output, quirks included, so that anyone can check us against the original. `scan` (scan.cpp,
// shaders/cacao/scan), the default, is the same algorithm for metric sensor depth; its departures are named in the
// README, and each has a test that fails without it.
#pragma once

#include "ao/base/method.h"
#include "ao/base/quality.h"
#include "ao/gpu/program.h"
#include "shaders/shared/cacao.h"

#include <array>
#include <cstddef>
#include <optional>

namespace scanshade {

enum class CacaoProfile { scan, reference };
inline constexpr std::array cacao_profile_words{Named{"scan", CacaoProfile::scan},
                                                Named{"reference", CacaoProfile::reference}};

/// How obscurance becomes visibility: as AMD documents it, or fitted to ray-traced truth.
enum class CacaoToneCurve { calibrated, documented };

/// What the depth image holds: metres, or device depth with the near plane at 0 (normal_z) or at 1 (reverse_z).
enum class CacaoDepthInput { metric, normal_z, reverse_z };
inline constexpr std::array cacao_depth_input_words{Named{"metric", CacaoDepthInput::metric},
                                                    Named{"normal_z", CacaoDepthInput::normal_z},
                                                    Named{"reverse_z", CacaoDepthInput::reverse_z}};

/// Where the passes keep depth. `images` also joins the last blur steps and the resolve in one pass. Both use the same
/// kernels, and their maps differ by rounding only. Buffers are faster on CPUs, images on GPUs.
enum class CacaoStorage { buffers, images };

/// What a person sets. Names and defaults follow AMD's documentation; `radius` and the depths are metres.
struct CacaoOptions {
    CacaoProfile profile = CacaoProfile::scan;
    Quality quality = Quality::high;
    bool downsampled = false;
    float radius = 0.5F;
    std::optional<CacaoToneCurve> tone_curve; ///< none: calibrated in `scan`, documented in `reference`
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
    CacaoDepthInput depth_input = CacaoDepthInput::metric;
    float near_m = 0.1F;
    float far_m = 1000.0F;
    float normals_mul = 1.0F;
    float normals_add = 0.0F;
    std::optional<CacaoStorage> storage; ///< none: images on GPUs; buffers on CPUs and in `reference`
    /// `reference` only: the depth read outside the image. Default: device depth 0, linearised.
    std::optional<float> outside_depth;

    [[nodiscard]] std::vector<Parameter> parameters();
    [[nodiscard]] bool scan() const { return profile == CacaoProfile::scan; }
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

/// The buffers and passes of one configuration.
struct CacaoTables {
    std::vector<gpu::BufferRow> buffers;
    std::vector<gpu::PassRow> passes;
    int blurred = cacao_ping; ///< the buffer that holds AO after the blur
};

/// The storage that the options name, else the faster one for the device.
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
    Pinhole camera_; // constants_ and program_ were made for it
    bool normals_supplied_ = false;
    shared::CacaoConstants constants_{};
    CacaoTables tables_;
    std::unique_ptr<gpu::Program> program_;
    Timings timings_;
};

} // namespace scanshade
