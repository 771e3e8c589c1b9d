// GTAO: the open arc between two horizons, slice by slice, after Jimenez et al. (2016) and XeGTAO (Strugar, McCalla
// 2021).
//
// Profile `metric`, the default, estimates visibility within the radius itself; `xegtao` takes XeGTAO's constants,
// which were tuned together for appearance. Surfaces have unlimited thickness; bitmask is the same with a limited one.
#pragma once

#include "ao/gtao/slices.h"

namespace scanshade {

enum class GtaoProfile { metric, xegtao };
/// How the weight of a sample falls with its distance.
enum class GtaoFalloff { hard, linear, quadratic };

struct GtaoOptions {
    ScreenOptions screen;
    SliceOptions slices;
    GtaoProfile profile = GtaoProfile::metric;
    GtaoFalloff falloff = GtaoFalloff::hard;

    [[nodiscard]] std::vector<Parameter> parameters();
};

class Gtao final : public ScreenMethod {
  public:
    /// Throws Misuse naming a setting out of its range.
    Gtao(gpu::Device& device, const GtaoOptions& options);

  private:
    void add_passes(ScreenTables& tables) const override;
    [[nodiscard]] std::vector<std::byte> constants(const shared::ScreenConstants& screen) const override;

    GtaoOptions options_;
};

} // namespace scanshade
