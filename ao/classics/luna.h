// Luna's SSAO: fourteen vectors around the surface point, after "Introduction to 3D Game Programming with DirectX 12"
// (2016).
//
// Profile `metric`, the default, respects the radius; `published` takes the book's companion code, faults included.
#pragma once

#include "ao/screen/screen.h"

namespace scanshade {

struct LunaOptions {
    ScreenOptions screen;
    Profile profile = Profile::metric;
    Quality quality = Quality::low; ///< lowest 8 vectors, low the published 14, medium 28, high 56, highest 224
    bool renormalise = false;
    int blurs = 0; ///< iterations of the published blur, before denoise

    [[nodiscard]] std::vector<Parameter> parameters();
};

/// `sets` times the first `count` of the fourteen vectors, four floats each: cube corners and face centres, opposite
/// pairs together, as long as a quarter to all of the radius.
[[nodiscard]] std::vector<float> luna_vectors(int sets, int count);

class Luna final : public ScreenMethod {
  public:
    /// Throws Misuse naming a setting out of its range.
    Luna(gpu::Device& device, const LunaOptions& options);

  private:
    void add_passes(ScreenTables& tables) const override;
    [[nodiscard]] std::vector<std::byte> constants(const shared::ScreenConstants& screen) const override;

    LunaOptions options_;
};

} // namespace scanshade
