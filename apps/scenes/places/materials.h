// Colours and patterns of the scenes' surfaces.
#pragma once

#include "apps/scenes/world/scene.h"

namespace scanshade::scene {

inline const Material oak{{0.36, 0.21, 0.10}, {0.22, 0.12, 0.055}, Pattern::boards, 0.12};
inline const Material boards{{0.42, 0.29, 0.17}, {0.27, 0.17, 0.09}, Pattern::boards, 0.16};
inline const Material plaster{{0.62, 0.60, 0.55}, {0.55, 0.53, 0.48}, Pattern::plaster, 0.25};
inline const Material whitewash{{0.72, 0.72, 0.70}, {0.68, 0.68, 0.66}, Pattern::plaster, 0.4};
inline const Material white{{0.66, 0.66, 0.64}, {}, Pattern::plain, 1};
inline const Material steel{{0.22, 0.23, 0.25}, {}, Pattern::plain, 1};
inline const Material cloth{{0.10, 0.16, 0.30}, {0.08, 0.12, 0.23}, Pattern::plaster, 0.02};
inline const Material card{{0.45, 0.31, 0.17}, {0.40, 0.27, 0.14}, Pattern::plaster, 0.06};
inline const Material books{{0.45, 0.08, 0.06}, {0.08, 0.22, 0.30}, Pattern::books, 0.035};
inline const Material woven_rug{{0.38, 0.10, 0.09}, {0.50, 0.43, 0.32}, Pattern::checks, 0.14};
inline const Material red{{0.55, 0.07, 0.05}, {}, Pattern::plain, 1};
inline const Material green{{0.10, 0.28, 0.12}, {}, Pattern::plain, 1};
inline const Material yellow{{0.58, 0.42, 0.06}, {}, Pattern::plain, 1};
inline const Material clay{{0.48, 0.21, 0.12}, {0.40, 0.17, 0.10}, Pattern::plaster, 0.05};
inline const Material stone{{0.50, 0.47, 0.41}, {0.40, 0.38, 0.34}, Pattern::plaster, 0.15};
inline const Material tiles{{0.52, 0.50, 0.46}, {0.24, 0.25, 0.26}, Pattern::checks, 0.4};
inline const Material leaves{{0.11, 0.24, 0.07}, {0.17, 0.30, 0.09}, Pattern::plaster, 0.12};
inline const Material grass{{0.16, 0.27, 0.08}, {0.22, 0.24, 0.11}, Pattern::plaster, 0.7};
inline const Material bark{{0.20, 0.14, 0.09}, {0.14, 0.10, 0.07}, Pattern::plaster, 0.08};
inline const Material brick{{0.43, 0.18, 0.12}, {0.36, 0.15, 0.10}, Pattern::plaster, 0.12};
inline const Material slate{{0.17, 0.17, 0.19}, {0.13, 0.13, 0.15}, Pattern::boards, 0.25};

} // namespace scanshade::scene
