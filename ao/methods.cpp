// The table of methods.
#include "ao/base/method.h"
#include "ao/cacao/cacao.h"
#include "ao/classics/abao.h"
#include "ao/classics/alchemy.h"
#include "ao/classics/hbao.h"
#include "ao/classics/hdao.h"
#include "ao/classics/hemisphere.h"
#include "ao/classics/luna.h"
#include "ao/classics/ssdo.h"
#include "ao/gtao/bitmask.h"
#include "ao/gtao/gtao.h"
#include "ao/raycast/raycast.h"
#include "ao/surfel/surfel.h"
#include "ao/vxao/vxao.h"
#include "projection/base/named.h"

#include <type_traits>

namespace scanshade {
namespace {

/// A method whose setup is its Options struct and whose maker is its constructor.
template <class Options, class Made>
class SetupOf final : public MethodSetup {
  public:
    std::vector<Parameter> parameters() override { return options_.parameters(); }
    std::unique_ptr<Method> make(gpu::Device& device) const override {
        return std::make_unique<Made>(device, options_);
    }
    std::unique_ptr<PointMethod> make_for_points() const override {
        if constexpr (std::is_base_of_v<PointMethod, Made>)
            return std::make_unique<Made>(options_);
        else
            return nullptr;
    }
    static std::unique_ptr<MethodSetup> start() { return std::make_unique<SetupOf>(); }

  private:
    Options options_;
};

} // namespace

const std::vector<MethodRow>& methods() {
    static const std::vector<MethodRow> table{
        {"cacao", "tap pairs on de-interleaved depth, edge-aware blur; five qualities, native or half resolution",
         "FidelityFX CACAO 1.3 (AMD's public documentation)", SetupOf<CacaoOptions, Cacao>::start, 1.6},
        {"luna", "fourteen vectors around the point, occluded by what stands in front of it",
         "Luna, Introduction to 3D Game Programming with DirectX 12 (2016), ch. 21", SetupOf<LunaOptions, Luna>::start,
         1.6},
        {"hemisphere", "points in the half ball above the surface, tested against what is seen",
         "tutorials on SSAO with a hemisphere kernel", SetupOf<HemisphereOptions, Hemisphere>::start, 1.6},
        {"hbao", "horizons above the tangent plane, attenuated by distance; HBAO+ as a profile",
         "Bavoil, Sainz, Dimitrov 2008; Bavoil 2014", SetupOf<HbaoOptions, Hbao>::start},
        {"alchemy", "taps in a disc of the image, each weighed by its height above the surface and its distance",
         "McGuire et al. 2011; Scalable Ambient Obscurance (McGuire, Mara, Luebke 2012)",
         SetupOf<AlchemyOptions, Alchemy>::start, 1, false},
        {"abao", "the angle left open between the highest elevations on both sides of lines",
         "Mittring 2012; Yeung 2012", SetupOf<AbaoOptions, Abao>::start},
        {"hdao", "pairs of opposite taps, counted where they stand above the surface",
         "AMD's HDAO sample, Radeon SDK 2009-2010", SetupOf<HdaoOptions, Hdao>::start, 1, false},
        {"ssdo", "one point at a random distance along each direction, blocked by what lies in front of it",
         "Ritschel, Grosch, Seidel 2009", SetupOf<SsdoOptions, Ssdo>::start},
        {"gtao", "open arc between two horizons, slice by slice", "Jimenez et al. 2016; XeGTAO (Strugar, McCalla 2021)",
         SetupOf<GtaoOptions, Gtao>::start, 1, false},
        {"bitmask", "gtao's slices with 32 sectors, so that what is seen has a thickness",
         "Therrien, Levesque, Gilet 2023", SetupOf<BitmaskOptions, Bitmask>::start},
        {"surfel", "bitmask over pixels that have a direction and a thickness: the most accurate",
         "own, after Therrien et al. 2023 and Jimenez et al. 2016", SetupOf<SurfelOptions, Surfel>::start, 1, false},
        {"vxao", "cones through voxels of all that is seen, also by other views of a recording",
         "Crassin et al. 2011; VXAO (NVIDIA 2016)", SetupOf<VxaoOptions, Vxao>::start},
        {"raycast",
         "rays against the depth surface, the cloud's discs or the mesh itself; on the CPU, with standard errors",
         "cosine-weighted ambient occlusion by its definition; Embree", SetupOf<RaycastOptions, Raycast>::start},
    };
    return table;
}

const MethodRow& method_named(std::string_view name) { return one_named(methods(), name, "method"); }

} // namespace scanshade
