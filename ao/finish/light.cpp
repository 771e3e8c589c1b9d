#include "ao/finish/light.h"

#include "projection/base/error.h"

#include <cstdio>
#include <fmt/format.h>

namespace scanshade {

shared::LightConstants Light::on_gpu(const Eigen::Matrix3d& world_from_camera) const {
    const Eigen::Vector3d in_camera = in_world ? Eigen::Vector3d(world_from_camera.transpose() * direct) : direct;
    return {{static_cast<float>(in_camera.x()), static_cast<float>(in_camera.y()), static_cast<float>(in_camera.z())}};
}

std::string Light::sentence() const {
    if (!has_direct())
        return "light: all of it is ambient";
    const Eigen::Vector3d from = direct.normalized();
    return fmt::format("light: ambient, and {:.2f} times as much direct light from ({:.2f}, {:.2f}, {:.2f}) in {}",
                       direct.norm(), from.x(), from.y(), from.z(),
                       in_world ? "the recording's world" : "camera space");
}

Light light_from_text(const std::string& text) {
    if (text == "auto" || text == "none")
        return {};
    Light light;
    Eigen::Vector3d& l = light.direct;
    int used = 0;
    if (std::sscanf(text.c_str(), "%lf,%lf,%lf%n", &l.x(), &l.y(), &l.z(), &used) != 3 ||
        used != static_cast<int>(text.size()) || !l.allFinite() || !(l.norm() > 1e-9))
        throw Misuse("light: '" + text + "' given, expected auto, none, or X,Y,Z towards the light, such as 0,0,1");
    return light;
}

} // namespace scanshade
