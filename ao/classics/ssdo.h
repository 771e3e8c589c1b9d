// SSDO: screen-space directional occlusion, after Ritschel, Grosch and Seidel (2009); its visibility.
//
// A direction has one sample, at a random distance. It sees an occluder only where that comes to lie in front of it, so
// the estimate is too bright; a tone curve, fitted to scenes with truth, follows.
#pragma once

#include "ao/screen/screen.h"

namespace scanshade {

struct SsdoOptions {
    ScreenOptions screen{.curve = fitted_curve};
    Quality quality = Quality::medium; ///< lowest 4 reads, low 8, medium 16, high 32, highest 128
    int directions = 0;                ///< above 0: instead of the quality's
    bool renormalise = false;

    [[nodiscard]] std::vector<Parameter> parameters();
};

class Ssdo final : public ScreenMethod {
  public:
    /// Throws Misuse naming a setting out of its range.
    Ssdo(gpu::Device& device, const SsdoOptions& options);

  private:
    void add_passes(ScreenTables& tables) const override;
    [[nodiscard]] std::vector<std::byte> constants(const shared::ScreenConstants& screen) const override;

    SsdoOptions options_;
};

} // namespace scanshade
