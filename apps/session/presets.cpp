#include "apps/session/presets.h"

namespace scanshade {

const Configuration& configuration_of(Preset preset) {
    static const Configuration fast{"cacao", "high", {{"quality", "high"}}};
    static const Configuration balanced{"surfel", "high downsampled", {{"quality", "high"}, {"downsampled", "true"}}};
    static const Configuration best{"surfel", "high", {{"quality", "high"}}};
    switch (preset) {
    case Preset::balanced:
        return balanced;
    case Preset::best:
        return best;
    case Preset::fast:
        break;
    }
    return fast;
}

} // namespace scanshade
