// ABAO: angle-based ambient occlusion, after Mittring (2012) and Yeung (2012).
//
// Profile `metric`, the default, takes the highest of several elevations on both sides of each line; `published` takes
// one pair of taps a line, at six radii. Angles are weighed alike and the fade with distance brightens, so a tone
// curve, fitted to scenes with truth, follows.
#pragma once

#include "ao/screen/screen.h"

namespace scanshade {

struct AbaoOptions {
    ScreenOptions screen{.curve = fitted_curve};
    Profile profile = Profile::metric;
    Quality quality = Quality::medium; ///< lowest 8 reads, low 16, medium 32, high 64, highest 128
    int lines = 0, steps = 0;          ///< above 0: instead of the quality's
    bool hard = false;                 ///< all elevations within the radius count alike

    [[nodiscard]] std::vector<Parameter> parameters();
};

class Abao final : public ScreenMethod {
  public:
    /// Throws Misuse naming a setting out of its range.
    Abao(gpu::Device& device, const AbaoOptions& options);

  private:
    void add_passes(ScreenTables& tables) const override;
    [[nodiscard]] std::vector<std::byte> constants(const shared::ScreenConstants& screen) const override;

    AbaoOptions options_;
};

} // namespace scanshade
