// The textures of a mesh: which images its materials need, and the files in meshes/.
#pragma once

#include "apps/frame/outputs.h"
#include "apps/frame/work.h"

namespace scanshade {

/// Computes and writes one image after the other, then the mesh's file with links to them. The row gets files, notes
/// and doubts. Throws Error where the frame is no mesh or has no texture coordinates, if nothing else was asked for.
void write_mesh_textures(Work& work, const Outputs& outputs);

} // namespace scanshade
