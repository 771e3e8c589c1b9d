// Visibility bitmask: GTAO's slices with 32 sectors in place of two horizons. Surfaces have a thickness, and light
// passes behind them. After Therrien, Levesque and Gilet (2023).
//
// Departures: sectors are of equal cosine-weighted measure, so the share of open ones is the visibility itself; the
// published ones are of equal angle. Samples count up to the radius; the published ones count at any distance.
#pragma once

#include "ao/gtao/slices.h"

namespace scanshade {

struct BitmaskOptions {
    ScreenOptions screen;
    SliceOptions slices;
    float thickness = 0.3F; ///< of surfaces, in radii

    [[nodiscard]] std::vector<Parameter> parameters();
};

class Bitmask final : public ScreenMethod {
  public:
    /// Throws Misuse naming a setting out of its range.
    Bitmask(gpu::Device& device, const BitmaskOptions& options);

  private:
    void add_passes(ScreenTables& tables) const override;
    [[nodiscard]] std::vector<std::byte> constants(const shared::ScreenConstants& screen) const override;

    BitmaskOptions options_;
};

} // namespace scanshade
