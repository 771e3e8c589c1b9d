#include "ao/screen/fitted_curves.h"

#include "projection/base/error.h"

#include <algorithm>
#include <array>
#include <fmt/format.h>

namespace scanshade {
namespace {

struct FittedCurve {
    std::string_view name;
    std::array<float, 5> k; ///< lowest, low, medium, high, highest
};

/// Printed by `tests/measure curves`: least squares over two views (--first 50 --step 25) of each of the six generated
/// scenes, ideal sensor, all scenes weighing the same.
constexpr std::array curves{
    FittedCurve{"alchemy", {1.4F, 1.4F, 1.4F, 1.4F, 1.4F}},     //
    FittedCurve{"alchemy sao", {1.2F, 1.2F, 1.2F, 1.2F, 1.2F}}, //
    FittedCurve{"hbao plus", {3.5F, 3.5F, 3.5F, 3.5F, 3.5F}},   //
    FittedCurve{"abao", {3.6F, 3.6F, 3.6F, 3.6F, 3.6F}},        //
    FittedCurve{"abao hard", {2.4F, 2.4F, 2.4F, 2.4F, 2.4F}},   //
    FittedCurve{"hdao", {2.1F, 2.1F, 2.1F, 2.1F, 2.1F}},        //
    FittedCurve{"ssdo", {3.6F, 3.6F, 3.6F, 3.6F, 3.6F}},        //
};

} // namespace

float fitted_curve_of(std::string_view name, Quality quality) {
    const auto row = std::ranges::find(curves, name, &FittedCurve::name);
    if (row == curves.end())
        throw Misuse(fmt::format("no tone curve was fitted to {}", name));
    return row->k.at(static_cast<std::size_t>(quality));
}

} // namespace scanshade
