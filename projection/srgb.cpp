#include "projection/srgb.h"

namespace scanshade {
namespace {

SrgbTables made_tables() {
    SrgbTables tables;
    constexpr double last = SrgbTables::linear_steps - 1;
    for (std::size_t i = 0; i < tables.linear.size(); ++i)
        tables.linear[i] = static_cast<float>(last * linear_from_srgb(static_cast<double>(i) / 255));
    for (std::size_t i = 0; i < tables.stored.size(); ++i)
        tables.stored[i] =
            static_cast<unsigned char>(std::lround(255 * srgb_from_linear(static_cast<double>(i) / last)));
    return tables;
}

} // namespace

const SrgbTables& srgb_tables() {
    static const SrgbTables tables = made_tables();
    return tables;
}

} // namespace scanshade
