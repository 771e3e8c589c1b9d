// The light of photographs: ambient light, and one direction. Pictures darken the ambient part alone.
#pragma once

#include "shaders/shared/light.h"

#include <Eigen/Core>
#include <string>

namespace scanshade {

/// I = gain albedo (visibility + shadow max(0, direct . n)), in linear light. Ambient light is 1, since only products
/// of albedo and light can be known.
struct Light {
    Eigen::Vector3d direct = {0, 0, 0}; ///< towards the light; its length is direct / ambient light; 0 = none
    bool in_world = false;              ///< the direction is in the recording's world, else in camera space

    [[nodiscard]] bool has_direct() const { return direct.norm() > 0; }
    /// For the shaders, in the space of a camera.
    [[nodiscard]] shared::LightConstants on_gpu(const Eigen::Matrix3d& world_from_camera) const;
    /// "light: all of it is ambient"
    [[nodiscard]] std::string sentence() const;
};

/// "auto" or "none": all light is ambient; or "X,Y,Z", a direct light, in camera space. Throws Misuse for anything
/// else.
[[nodiscard]] Light light_from_text(const std::string& text);

} // namespace scanshade
