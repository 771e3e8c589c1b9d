// All cameras of a COLMAP reconstruction: cameras.txt, cameras.bin.
#pragma once

#include "projection/camera.h"

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace scanshade {

struct ColmapCamera {
    Camera camera;       ///< pixel centres at whole numbers, as everywhere here
    std::string problem; ///< why it cannot be used; names file and place
};

/// By their ids. The name's extension says whether the file is binary. A camera that cannot be used keeps its id, with
/// a problem. What follows damage is left out, with a warning naming the place.
[[nodiscard]] std::map<std::uint64_t, ColmapCamera> read_colmap_cameras(const std::filesystem::path& file,
                                                                        std::vector<std::string>& warnings);

} // namespace scanshade
