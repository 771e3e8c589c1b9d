// HDAO: pairs of taps that stand out from the surface, after AMD's sample of the Radeon SDK (2009-2010).
//
// Three tests of a pair. `plane`, the default, asks each tap whether it stands above the tangent plane; `angle` and `z`
// are the sample's, which see occluders only where there are some on both sides. None asks how high a tap stands, so
// low things are too dark and high walls too bright; a tone curve, fitted to scenes with truth, follows.
#pragma once

#include "ao/screen/screen.h"

namespace scanshade {

enum class HdaoTest { plane, angle, z };

struct HdaoOptions {
    ScreenOptions screen{.curve = fitted_curve};
    Quality quality = Quality::medium; ///< lowest 8 reads, low 16, medium 48, high 96, highest 256
    int pairs = 0;                     ///< above 0: instead of the quality's
    HdaoTest test = HdaoTest::plane;
    bool normal_rejection = false; ///< of test `z`: where the normals around agree, nothing occludes

    [[nodiscard]] std::vector<Parameter> parameters();
};

class Hdao final : public ScreenMethod {
  public:
    /// Throws Misuse naming a setting out of its range.
    Hdao(gpu::Device& device, const HdaoOptions& options);

  private:
    void add_passes(ScreenTables& tables) const override;
    [[nodiscard]] std::vector<std::byte> constants(const shared::ScreenConstants& screen) const override;

    HdaoOptions options_;
};

} // namespace scanshade
