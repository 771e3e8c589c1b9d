// Visibility bitmask: GTAO's slices with 32 sectors in place of two horizons. Surfaces have a thickness, and light
// passes behind them. After Therrien, Levesque and Gilet (2023).
//
// Departures: sectors are of equal cosine-weighted measure (`--sectors angle` for the published ones of equal angle),
// which makes the share of open ones the visibility itself, and samples count up to the radius (`--unbounded` for the
// published way).
#pragma once

#include "ao/gtao/slices.h"

namespace scanshade {

/// The measure of which all 32 sectors have equal shares: cosine-weighted, or angle.
enum class Sectors { cosine, angle };

struct BitmaskOptions {
    ScreenOptions screen;
    SliceOptions slices;
    float thickness = 0.3F;    ///< of surfaces, in radii
    float thickness_per_z = 0; ///< additional metres per metre of depth
    Sectors sectors = Sectors::cosine;
    bool unbounded = false;

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
