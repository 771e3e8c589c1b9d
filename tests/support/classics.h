// The classic methods run by name, and scenes by formula.
#pragma once

#include "ao/base/method.h"
#include "ao/gpu/device.h"
#include "projection/maps.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <gtest/gtest.h>
#include <map>
#include <memory>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

namespace scanshade::tests {

inline constexpr double pi = std::numbers::pi;

inline gpu::Device& device() {
    static gpu::Device opened;
    return opened;
}

using Settings = std::vector<std::pair<std::string, std::string>>;

/// A method with settings, made once, since pipelines take long to compile.
inline Method& method_with(const std::string& method, const Settings& settings) {
    static gpu::Device& opened = device(); // opened before the methods, destroyed after them
    static std::map<std::pair<std::string, Settings>, std::unique_ptr<Method>> made;
    auto& one = made[{method, settings}];
    if (!one) {
        const auto setup = method_named(method).setup();
        for (Parameter& row : setup->parameters())
            for (const auto& [name, value] : settings)
                if (row.name == name)
                    set(row, value);
        one = setup->make(opened);
    }
    return *one;
}

inline AoMap ao_of(const std::string& method, const DepthImage& depth, const Settings& settings = {},
                   DepthNoise noise = {}, const NormalImage* normals = nullptr) {
    return method_with(method, settings).compute({normals ? Surfaces(depth, *normals) : Surfaces(depth), noise});
}

class Classics : public testing::Test {
  protected:
    void TearDown() override {
        for (const std::string& message : device().validation_messages())
            ADD_FAILURE() << message;
    }
};

inline const std::vector<std::string> classics{"luna", "hemisphere", "hbao", "gtao", "bitmask"};

/// z of the surface along the ray (x, y, 1), 0 for none.
using Surface = std::function<double(double x, double y)>;

/// A camera whose disc of 0.5 m at 2 m (131 pixels) lies in the image.
inline Pinhole room_camera(cv::Size size = {360, 300}, double f = 525) {
    return {f, f, (size.width - 1) / 2.0, (size.height - 1) / 2.0, size};
}

inline DepthImage seen(const Pinhole& camera, const Surface& surface) {
    DepthImage depth{camera, cv::Mat1f(camera.size), {}};
    for (int v = 0; v < camera.size.height; ++v)
        for (int u = 0; u < camera.size.width; ++u)
            depth.z_m(v, u) = static_cast<float>(surface(camera.ray(u, v).x(), camera.ray(u, v).y()));
    return depth;
}

/// A plane through (0, 0, z), turned about the vertical axis by `tilt` degrees; nothing beyond 100 z.
inline Surface plane(double tilt, double z = 2) {
    return [=](double x, double) {
        const double s = std::sin(tilt * pi / 180), c = std::cos(tilt * pi / 180);
        const double along = c - s * x;
        return along > 0.01 * c ? z * c / along : 0.0;
    };
}

/// Back wall 2 m away, side wall 0.4 m to the left, coming towards the camera.
inline double back_and_side(double x, double) { return x < 0 ? std::min(2.0, 0.4 / -x) : 2.0; }

/// A sphere's nearer side (outside) or farther side (inside), 0 where it is missed.
inline Surface sphere(const cv::Vec3d& centre, double radius, bool inside) {
    return [=](double x, double y) {
        const cv::Vec3d ray(x, y, 1);
        const double a = ray.dot(ray), b = ray.dot(centre), c = centre.dot(centre) - radius * radius,
                     root = b * b - a * c;
        return root < 0 ? 0.0 : (b + (inside ? 1 : -1) * std::sqrt(root)) / a;
    };
}

} // namespace scanshade::tests
