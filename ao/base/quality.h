// The quality levels that methods share; what a level costs and brings is each method's own.
#pragma once

#include "projection/base/parameters.h"

namespace scanshade {

enum class Quality { lowest, low, medium, high, highest };

inline constexpr std::array quality_words{Named{"lowest", Quality::lowest}, Named{"low", Quality::low},
                                          Named{"medium", Quality::medium}, Named{"high", Quality::high},
                                          Named{"highest", Quality::highest}};

} // namespace scanshade
