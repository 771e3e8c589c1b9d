// HBAO: horizons above the tangent plane along directions in the image, after Bavoil, Sainz and Dimitrov (2008).
//
// Profile `metric`, the default, counts all within the radius alike and has no angle bias. It needs none, since samples
// on the tangent plane are left out. `published` has the paper's attenuation, bias and contrast. `plus` is HBAO+
// (Bavoil 2014): it sums taps without a horizon, and a tone curve, fitted to scenes with truth, follows.
#pragma once

#include "ao/screen/screen.h"

namespace scanshade {

enum class HbaoProfile { metric, published, plus };

struct HbaoOptions {
    ScreenOptions screen{.curve = fitted_curve};
    Quality quality = Quality::medium; ///< lowest 8 reads, low 16, medium 32, high 64, highest 512
    int directions = 0, steps = 0;     ///< above 0: instead of the quality's
    HbaoProfile profile = HbaoProfile::metric;
    float bias_degrees = 0;
    bool attenuated = false;
    bool interleaved = false; ///< with `plus`: a pixel looks only at those that lie a multiple of four from it

    [[nodiscard]] std::vector<Parameter> parameters();
};

class Hbao final : public ScreenMethod {
  public:
    /// Throws Misuse naming a setting out of its range.
    Hbao(gpu::Device& device, const HbaoOptions& options);

  private:
    void add_passes(ScreenTables& tables) const override;
    [[nodiscard]] std::vector<std::byte> constants(const shared::ScreenConstants& screen) const override;

    HbaoOptions options_;
};

} // namespace scanshade
