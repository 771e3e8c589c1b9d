// Hemisphere kernel: points in the half ball above the surface, tested against the depth image; the SSAO of many
// tutorials.
//
// Profile `metric`, the default, keeps planes open at any tilt; `published` is the tutorial, faults included.
#pragma once

#include "ao/screen/screen.h"

namespace scanshade {

struct HemisphereOptions {
    ScreenOptions screen;
    Profile profile = Profile::metric;
    Quality quality = Quality::medium; ///< lowest 8 points, low 16, medium 32, high 64, highest 256
    int points = 0;                    ///< above 0: instead of the quality's
    bool renormalise = false;
    int blurs = 0; ///< iterations of the published blur, before denoise

    [[nodiscard]] std::vector<Parameter> parameters();
};

/// The kernel: x and y along the surface, z along its normal, four floats a point, within the unit half ball.
/// Directions by the golden ratio, cosine-distributed; distances with the square, denser close by.
[[nodiscard]] std::vector<float> hemisphere_kernel(int points);
/// As published: uniform in a cube and normalised. The same numbers every time.
[[nodiscard]] std::vector<float> published_kernel(int points);

class Hemisphere final : public ScreenMethod {
  public:
    /// Throws Misuse naming a setting out of its range.
    Hemisphere(gpu::Device& device, const HemisphereOptions& options);

  private:
    void add_passes(ScreenTables& tables) const override;
    [[nodiscard]] std::vector<std::byte> constants(const shared::ScreenConstants& screen) const override;

    HemisphereOptions options_;
};

} // namespace scanshade
