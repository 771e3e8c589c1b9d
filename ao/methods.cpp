// The table of methods.
#include "ao/cacao/cacao.h"
#include "ao/method.h"
#include "ao/raycast/raycast.h"
#include "projection/error.h"

namespace scanshade {
namespace {

/// A method whose setup is its Options struct and whose maker is its constructor.
template <class Options, class Made>
class SetupOf final : public MethodSetup {
  public:
    std::vector<Parameter> parameters() override { return options_.parameters(); }
    std::unique_ptr<Method> make(gpu::Device& device) const override { return std::make_unique<Made>(device, options_); }
    static std::unique_ptr<MethodSetup> start() { return std::make_unique<SetupOf>(); }

  private:
    Options options_;
};

} // namespace

const std::vector<MethodRow>& methods() {
    static const std::vector<MethodRow> table{
        {"cacao", "tap pairs on de-interleaved depth, edge-aware blur; five qualities, native or half resolution",
         "FidelityFX CACAO 1.3 (AMD's public documentation)", SetupOf<CacaoOptions, Cacao>::start},
        {"raycast", "rays against the depth surface, the cloud's discs or the mesh itself; on the CPU, with standard errors",
         "cosine-weighted ambient occlusion by its definition; Embree 3", SetupOf<RaycastOptions, Raycast>::start},
    };
    return table;
}

const MethodRow& method_named(std::string_view name) {
    std::string known;
    for (const MethodRow& row : methods()) {
        if (row.name == name) return row;
        known += (known.empty() ? "" : ", ") + std::string(row.name);
    }
    throw Misuse("no method '" + std::string(name) + "'; there are: " + known);
}

} // namespace scanshade
