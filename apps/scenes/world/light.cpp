#include "apps/scenes/world/light.h"

#include "projection/base/hash.h"
#include "projection/srgb.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <set>
#include <tbb/parallel_for.h>

namespace scanshade::scene {
namespace {

using Eigen::Vector3d;

const Vector3d ambient_colour(0.97, 1.0, 1.06), direct_colour(1.04, 1.0, 0.9);
constexpr double brightest = 1.1; // albedos reach 0.72

Eigen::AlignedBox3d box_of(const Solid& solid) {
    Eigen::AlignedBox3d box;
    if (const auto* b = std::get_if<Box>(&solid)) {
        for (int corner = 0; corner < 8; ++corner)
            box.extend(b->centre + b->axes * b->half.cwiseProduct(Vector3d(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1,
                                                                           corner & 4 ? 1 : -1)));
    } else if (const auto* s = std::get_if<Sphere>(&solid)) {
        box.extend(s->centre - Vector3d::Constant(s->radius));
        box.extend(s->centre + Vector3d::Constant(s->radius));
    } else if (const auto* c = std::get_if<Cylinder>(&solid)) {
        for (const double end : {0.0, c->height}) {
            box.extend(c->base + end * c->axis - Vector3d::Constant(c->radius));
            box.extend(c->base + end * c->axis + Vector3d::Constant(c->radius));
        }
    } else if (const auto* t = std::get_if<Triangle>(&solid)) {
        box.extend(t->a);
        box.extend(t->b);
        box.extend(t->c);
    } else {
        box.extend(Vector3d::Constant(-1e4));
        box.extend(Vector3d::Constant(1e4));
    }
    return box;
}

/// What reaches the bounds of the whole scene.
std::set<const Body*> shell_of(const Scene& scene) {
    Eigen::AlignedBox3d all;
    for (const Body& body : scene.bodies)
        all.extend(box_of(body.solid));
    std::set<const Body*> shell;
    for (const Body& body : scene.bodies) {
        const Eigen::AlignedBox3d own = box_of(body.solid);
        constexpr double near_m = 0.01;
        const bool outermost =
            ((own.min() - all.min()).array() < near_m).any() || ((all.max() - own.max()).array() < near_m).any();
        if (outermost)
            shell.insert(&body);
    }
    return shell;
}

bool in_shadow(const World& world, const std::set<const Body*>& shell, Vector3d from, const Vector3d& towards) {
    constexpr int most_walls = 64; // rounding could hold a ray on one
    for (int i = 0; i < most_walls; ++i) {
        const Hit hit = world.cast({from, towards});
        if (!hit.body)
            return false;
        if (!shell.contains(hit.body))
            return true;
        from += (hit.t + 1e-4) * towards;
    }
    return false;
}

cv::Vec3f as_pixel(const Vector3d& v) {
    return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())};
}

constexpr double lift_m = 1e-4; // of rays above the surface that they start from

Ray sight_of(const Optics& camera, const Eigen::Isometry3d& world_from_camera, int u, int v) {
    return {world_from_camera.translation(), world_from_camera.linear() * camera.direction(u, v).homogeneous()};
}

/// What leaves a surface, linear red, green, blue.
struct Sent {
    Vector3d albedo, ambient, direct;
};

class Sender {
  public:
    Sender(const World& world, const SceneLight& light)
        : world_(world), light_(light), shell_(shell_of(world.scene())), sun_(light.towards.normalized()),
          direct_(light.has_sun() ? light.ratio : 0), unit_(brightest / (1 + direct_)) {}

    [[nodiscard]] Sent from(const Hit& hit, const Vector3d& at) const {
        const Vector3d albedo = albedo_at(hit, at);
        const double facing = direct_ > 0 ? std::max(0.0, hit.normal.dot(sun_)) : 0;
        const bool lights = facing > 0 && !in_shadow(world_, shell_, at + lift_m * hit.normal, sun_);
        return {albedo, unit_ * (1 + light_.gradient().dot(hit.normal)) * albedo.cwiseProduct(ambient_colour),
                lights ? Vector3d(unit_ * direct_ * facing * albedo.cwiseProduct(direct_colour)) : Vector3d(0, 0, 0)};
    }

  private:
    const World& world_;
    SceneLight light_;
    std::set<const Body*> shell_;
    Vector3d sun_;
    double direct_, unit_;
};

} // namespace

Vector3d SceneLight::gradient() const { return kind == LightKind::overcast ? Vector3d(0, 0, 0.5) : Vector3d(0, 0, 0); }

LitImages render_lit(const World& world, const Optics& camera, const Eigen::Isometry3d& world_from_camera,
                     const SceneLight& light) {
    const Sender sender(world, light);
    const cv::Size size = camera.pinhole.size;
    LitImages lit{cv::Mat3f(size, cv::Vec3f()), cv::Mat3f(size, cv::Vec3f()), cv::Mat3f(size, cv::Vec3f())};
    tbb::parallel_for(0, size.height, [&](int v) {
        for (int u = 0; u < size.width; ++u) {
            const Ray sight = sight_of(camera, world_from_camera, u, v);
            const Hit hit = world.cast(sight);
            if (!hit.body)
                continue;
            const Sent sent = sender.from(hit, sight.origin + hit.t * sight.direction);
            lit.albedo(v, u) = as_pixel(sent.albedo);
            lit.ambient(v, u) = as_pixel(sent.ambient);
            lit.direct(v, u) = as_pixel(sent.direct);
        }
    });
    return lit;
}

Bounce true_bounce(const World& world, const Optics& camera, const Eigen::Isometry3d& world_from_camera,
                   const SceneLight& light, const TruthOptions& options) {
    const Sender sender(world, light);
    const CosineDirections directions(options.rays, options.seed);
    const cv::Size size = camera.pinhole.size;
    Bounce bounce{cv::Mat3f(size, cv::Vec3f()), cv::Mat1f(size, std::numeric_limits<float>::quiet_NaN())};
    tbb::parallel_for(0, size.height, [&](int v) {
        for (int u = 0; u < size.width; ++u) {
            const Ray sight = sight_of(camera, world_from_camera, u, v);
            const Hit hit = world.cast(sight);
            if (!hit.body)
                continue;
            const Vector3d from = sight.origin + hit.t * sight.direction + lift_m * hit.normal;
            const std::uint32_t key = hash(static_cast<std::uint32_t>(u), static_cast<std::uint32_t>(v));
            const Eigen::Matrix3d frame =
                Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitZ(), hit.normal).toRotationMatrix() *
                Eigen::AngleAxisd(2 * std::numbers::pi * hash(key) * 0x1p-32, Vector3d::UnitZ());
            Vector3d sum = Vector3d::Zero();
            int open = 0;
            for (const CosineDirections::Direction& d : directions.set_for(key)) {
                const Ray ray{from, frame * Vector3d(static_cast<double>(d.x), static_cast<double>(d.y),
                                                     static_cast<double>(d.z))};
                const Hit met = world.cast(ray);
                if (!met.body || met.t > options.radius_m) {
                    ++open;
                    continue;
                }
                const Sent sent = sender.from(met, ray.origin + met.t * ray.direction);
                sum += sent.ambient + sent.direct;
            }
            bounce.indirect(v, u) = as_pixel(sum / directions.rays());
            bounce.visibility(v, u) = static_cast<float>(open) / static_cast<float>(directions.rays());
        }
    });
    return bounce;
}

cv::Mat3b photograph(const LitImages& lit, const cv::Mat1f& visibility) {
    cv::Mat3f sum = lit.direct.clone();
    for (int v = 0; v < sum.rows; ++v)
        for (int u = 0; u < sum.cols; ++u) {
            const float open = visibility.empty() || std::isnan(visibility(v, u)) ? 1 : visibility(v, u);
            sum(v, u) += open * lit.ambient(v, u);
        }
    return stored_light(sum);
}

cv::Mat3b stored_light(const cv::Mat3f& linear) {
    cv::Mat3b stored(linear.size());
    std::transform(linear.begin(), linear.end(), stored.begin(), [](const cv::Vec3f& c) {
        const auto byte = [](float value) {
            const double open = std::clamp(static_cast<double>(value), 0.0, 1.0);
            return static_cast<unsigned char>(std::lround(255 * srgb_from_linear(open)));
        };
        return cv::Vec3b(byte(c[2]), byte(c[1]), byte(c[0]));
    });
    return stored;
}

} // namespace scanshade::scene
