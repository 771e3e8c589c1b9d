// Alchemy ambient obscurance (McGuire et al. 2011), and Scalable Ambient Obscurance (McGuire, Mara, Luebke 2012).
//
// Profile `metric`, the default, is the paper's sum with its intensity in radii, so that the result has no unit; `sao`
// is the successor: a smooth falloff, taps denser close by, and depths from a pyramid where the radius is wide. Both
// read too bright beside open surfaces and too dark in narrow corners; a tone curve, fitted to scenes with truth,
// follows.
#pragma once

#include "ao/screen/screen.h"

namespace scanshade {

enum class AlchemyProfile { metric, sao };
/// Whether far taps read a pyramid of depths; automatic: with `sao`.
enum class DepthPyramid { automatic, on, off };

struct AlchemyOptions {
    ScreenOptions screen{.curve = fitted_curve};
    AlchemyProfile profile = AlchemyProfile::metric;
    Quality quality = Quality::medium;
    int taps = 0; ///< above 0: instead of the quality's
    DepthPyramid pyramid = DepthPyramid::automatic;
    bool renormalise = false;

    [[nodiscard]] std::vector<Parameter> parameters();
};

/// Turns of the spiral of so many taps: coprime to it, so that no two taps have the same angle.
[[nodiscard]] int spiral_turns(int taps);

class Alchemy final : public ScreenMethod {
  public:
    /// Throws Misuse naming a setting out of its range.
    Alchemy(gpu::Device& device, const AlchemyOptions& options);

  private:
    void add_passes(ScreenTables& tables) const override;
    [[nodiscard]] std::vector<std::byte> constants(const shared::ScreenConstants& screen) const override;

    AlchemyOptions options_;
};

} // namespace scanshade
