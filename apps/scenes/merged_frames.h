// Clouds as depth cameras' users make them: frames of a recording, merged in world coordinates.
#pragma once

#include "apps/scenes/scene_cloud.h"

#include <string>

namespace scanshade::scene {

/// Which frames are merged, and how.
struct MergedFrames {
    int frames = 12;
    int first = 0, step = 10;      ///< frames first, first + step, ... of the scene's walk, ten per second
    std::string sensor = "kinect"; ///< a name of sensors() (apps/scenes/sensor.h)
    double misaligned_m = 0;       ///< sigma of each frame's shift along each axis
    bool shuffled = false;         ///< whether the order is lost: else frame after frame, row by row
};

/// About `count` points: of images of 640x480 pixels, every n-th of every n-th row, holes left out. Normals face the
/// camera. The truth (`surface`) is where the pixel's ray meets the scene. The same seed gives the same points.
[[nodiscard]] SceneCloud merged_frames(const World& world, std::size_t count, const MergedFrames& options,
                                       int seed = 1);

} // namespace scanshade::scene
