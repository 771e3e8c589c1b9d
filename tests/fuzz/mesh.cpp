// Fuzz target: meshes in OBJ and glTF, and their files with links to textures.
#include "tests/fuzz/cloud.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace scanshade::fuzz;
    const std::string_view bytes = text_of(data, size);
    take_cloud(bytes, bytes.starts_with("glTF") ? "a.glb" : bytes.starts_with("{") ? "a.gltf" : "a.obj");
    return 0;
}
