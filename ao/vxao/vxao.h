// VXAO: voxel-accelerated ambient occlusion, after Crassin et al. (2011), as NVIDIA's VXAO made it known.
//
// The surfaces of this view, and of the other views of a recording, become opacities of voxels; cones through them tell
// how much light arrives. What one view does not see another may have seen.
#pragma once

#include "ao/screen/screen.h"

namespace scanshade {

struct VxaoOptions {
    ScreenOptions screen{.curve = fitted_curve};
    Quality quality = Quality::medium; ///< cones and voxels a radius: lowest 6 of 8, low 6 of 16, medium 16 of 16, high
                                       ///< 16 of 32, highest 32 of 32
    int cones = 0;                     ///< above 0: instead of the quality's
    double voxel_m = 0;                ///< above 0: instead of the quality's
    int memory_mib = 128;              ///< for voxels; where they need more, coarser ones are taken

    [[nodiscard]] std::vector<Parameter> parameters();
};

class Vxao final : public ScreenMethod {
  public:
    /// Throws Misuse naming a setting out of its range.
    Vxao(gpu::Device& device, const VxaoOptions& options);
    [[nodiscard]] bool looks_at_neighbours() const override { return true; }
    /// Says where voxels are larger than asked for, since the memory holds no more.
    [[nodiscard]] const MethodRemarks& remarks() const override { return remarks_; }

  private:
    void add_passes(ScreenTables& tables) const override;
    [[nodiscard]] std::vector<std::byte> constants(const shared::ScreenConstants& screen) const override;

    void look_at(gpu::Program& program, int first_own) override;

    VxaoOptions options_;
    int bricks_; ///< there is room for
    MethodRemarks remarks_;
};

} // namespace scanshade
