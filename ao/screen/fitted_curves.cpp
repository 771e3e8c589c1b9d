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
/// scenes, ideal sensor, all scenes weighing the same. Behind each row is the RMSE it leaves at every quality, on
/// those views and on two others (--first 33 --step 80).
constexpr std::array<FittedCurve, 7> curves{{
    {"alchemy", {1.4F, 1.4F, 1.4F, 1.4F, 1.4F}},     // 0.138/0.137 0.136/0.134 0.133/0.131 0.132/0.130 0.132/0.130
    {"alchemy sao", {1.4F, 1.2F, 1.1F, 1.1F, 1.0F}}, // 0.145/0.145 0.145/0.145 0.145/0.145 0.146/0.146 0.147/0.147
    {"hbao plus", {3.0F, 3.4F, 3.4F, 3.7F, 3.9F}},   // 0.132/0.132 0.129/0.129 0.129/0.129 0.128/0.128 0.128/0.128
    {"abao", {5.2F, 5.2F, 3.4F, 3.4F, 3.4F}},        // 0.130/0.129 0.129/0.128 0.129/0.127 0.128/0.127 0.128/0.127
    {"abao hard", {3.3F, 3.3F, 2.2F, 2.2F, 2.2F}},   // 0.128/0.125 0.127/0.124 0.129/0.126 0.129/0.126 0.129/0.126
    {"hdao", {2.1F, 2.1F, 2.1F, 2.1F, 2.1F}},        // 0.139/0.136 0.138/0.135 0.137/0.134 0.137/0.134 0.137/0.133
    {"ssdo", {3.4F, 3.5F, 3.5F, 3.5F, 3.5F}},        // 0.141/0.138 0.137/0.134 0.135/0.132 0.134/0.131 0.134/0.130
}};

} // namespace

float fitted_curve_of(std::string_view name, Quality quality) {
    const auto row = std::ranges::find(curves, name, &FittedCurve::name);
    if (row == curves.end())
        throw Misuse(fmt::format("no tone curve was fitted to {}", name));
    return row->k.at(static_cast<std::size_t>(quality));
}

} // namespace scanshade
