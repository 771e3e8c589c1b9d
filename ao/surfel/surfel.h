// Surfel bitmask, the accurate method. Every pixel is a surfel: a piece of surface with a direction and a thickness.
// The surfels in a slice of the hemisphere close the sectors they cover. An open plane is open to the last bit.
//
// Outside the image surfaces continue as at its border. In narrow holes (a sensor's shadows) they continue as on the
// hole's farther side. Both only occlude; they are no pixels.
//
// At quality `lowest` all surfaces are taken to be equally thick, which saves the passes that find widths (edges, runs,
// surfels) for 0.008 of error.
//
// Visibility bitmask after Therrien, Levesque and Gilet (2023), slices and cosine measure after Jimenez et al. (2016);
// surfel segments, thickness from silhouette width and the self-normalised estimate are our own.
#pragma once

#include "ao/screen/screen.h"

#include <string>
#include <vector>

namespace scanshade {

/// What a person sets. Reads per pixel = 2 x slices x steps.
struct SurfelOptions {
    ScreenOptions screen{.tangent_sine = 0.01F, .tangent_sigmas = 0};
    Quality quality = Quality::high; ///< low 8 reads, medium 16, high 32, highest 64; lowest 8, equal thickness
    bool downsampled = false;        ///< a quarter of the pixels are sampled
    int slices = 0, steps = 0;       ///< above 0: instead of the quality's

    [[nodiscard]] std::vector<Parameter> parameters();
};

class Surfel final : public ScreenMethod {
  public:
    /// Throws Misuse naming a setting out of its range.
    Surfel(gpu::Device& device, const SurfelOptions& options);
    [[nodiscard]] bool looks_at_neighbours() const override { return true; }

  protected:
    void add_passes(ScreenTables& tables) const override;
    void add_denoise(ScreenTables& tables) const override { (void)tables; } // its own, in add_passes
    [[nodiscard]] std::vector<std::byte> constants(const shared::ScreenConstants& screen) const override;

  private:
    SurfelOptions options_;
};

} // namespace scanshade
