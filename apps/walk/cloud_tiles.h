// A cloud's points as 3D Tiles, on the Earth where its coordinate system is known.
#pragma once

#include "apps/frame/outputs.h"
#include "apps/frame/work.h"

namespace scanshade {

/// Writes tiles/NAME/. The row gets its files and notes. Throws Error where the frame is no cloud, or none of its
/// points has coordinates, if nothing else was asked for.
void write_cloud_tiles(Work& work, const Outputs& outputs);

} // namespace scanshade
