// `developers_bench sides`: clouds without normals of generated and of random scenes, and what tells their sides.
#include "ao/cloud/sides/sides.h"

#include "apps/lists.h"
#include "apps/scenes/merged_frames.h"
#include "apps/scenes/places/scenes.h"
#include "apps/scenes/scanner.h"
#include "tests/bench/part.h"
#include "tests/bench/random_scenes.h"

#include <algorithm>
#include <fmt/format.h>
#include <fmt/ranges.h>

namespace scanshade::bench {
namespace {

using Eigen::Vector3d, Eigen::Vector3f;

class SidesJudged final : public Part {
  public:
    Words words() override { return {"SCENE", "generated scenes, or kinds of random ones", &scenes_, 1, 1 << 20}; }

  private:
    std::vector<Parameter> rows() override {
        return {{"first", "first seed of random scenes", &first_, "", 0, 1 << 20},
                {"seeds", "random scenes of each kind", &seeds_, "", 1, 1 << 20},
                {"points", "how many points, with commas", &points_},
                {"stations", "scanned from so many places, with commas; 0 = even density", &stations_},
                {"frames", "also depth images of so many places on the walk, merged, with commas", &frames_},
                {"noises", "sigmas of the points along their normals, in spacings, with commas", &noises_}};
    }

    int measure(const std::string&) override {
        const auto kinds = random_kinds();
        for (const std::string& name : scenes_)
            if (std::ranges::find(kinds, name) == kinds.end())
                judge(name, 0, scene::scene_named(name));
            else
                for (int seed = first_; seed < first_ + seeds_; ++seed)
                    judge(name, seed, random_scene(name, seed));
        return all_well;
    }

    void judge(const std::string& name, int seed, const scene::Scene& scene) {
        const scene::World world(scene);
        for (const int points : whole_numbers("points", points_, 200))
            for (const int stations : whole_numbers("stations", stations_, 0))
                for (const double noise : numbers("noises", noises_, 0)) {
                    const scene::ScannerOptions options{.stations = stations};
                    auto cloud = scene::scanned_cloud(world, static_cast<std::size_t>(points), options, seed + 1);
                    if (cloud.points.size() < 200)
                        continue;
                    if (noise > 0) {
                        const double spacing = static_cast<double>(spacing_of(LocalCloud(cloud.points)));
                        cloud = scene::scanned_cloud(world, static_cast<std::size_t>(points),
                                                     {.stations = stations, .noise_m = noise * spacing}, seed + 1);
                    }
                    judge(fmt::format("{}-{}-{}-{}-{}", name, seed, points, stations, noise), cloud, {false, true});
                }
        judge_frames(name, seed, world);
    }

    /// As a depth camera's frames: part of the scene, in the camera's axes or the world's.
    void judge_frames(const std::string& name, int seed, const scene::World& world) {
        for (const int points : whole_numbers("points", points_, 200))
            for (const int frames : whole_numbers("frames", frames_, 1)) {
                const scene::Walk& walk = world.scene().walk;
                const int step = static_cast<int>(2 * walk.period_s / frames); // a fifth of the walk
                auto cloud = scene::merged_frames(world, static_cast<std::size_t>(points),
                                                  {frames, 7 * seed, std::max(step, 1), "ideal"}, seed + 1);
                if (cloud.points.size() < 200)
                    continue;
                if (seed % 2)
                    for (auto* vectors : {&cloud.points, &cloud.normals})
                        for (Vector3d& vector : *vectors)
                            vector = scene::world_from_camera(walk, 0).linear().transpose() * vector;
                judge(fmt::format("{}-{}-{}-frames{}-0", name, seed, points, frames), cloud, {false});
            }
    }

    static void judge(const std::string& name, const scene::SceneCloud& cloud, std::initializer_list<bool> ups) {
        const CloudSurface surface = cloud_surface(LocalCloud(cloud.points), {});
        const Patches patches = patches_of(surface);
        const DiscRays rays(surface);
        for (const bool up : ups)
            tell(name, surface, cloud,
                 scanshade::sides_of(surface, patches, &rays,
                                     up ? std::optional<Vector3f>(Vector3f::UnitZ()) : std::nullopt),
                 up);
    }

    static void tell(const std::string& name, const CloudSurface& surface, const scene::SceneCloud& cloud,
                     const scanshade::Sides& sides, bool up) {
        double right = 0, all = 0;
        for (std::size_t i = 0; i < surface.size(); ++i) {
            const double cosine =
                surface.normals[i].cast<double>().dot(cloud.normals[surface.tree.original(i)]) * sides.sign[i];
            all += std::abs(cosine) > 0.5;
            right += cosine > 0.5;
        }
        const SideSigns s = sides.signs.value_or(SideSigns());
        fmt::print(R"({{"name": "{}", "up": {}, "right": {:.4f}, "doubt": {}, "inner": {}, "points": {}, )"
                   R"("features": [{:.5g}]}})"
                   "\n",
                   name, up, right / std::max(all, 1.0), sides.doubted() ? 1 : 0, sides.inner, surface.size(),
                   fmt::join(side_features(s), ", "));
        std::fflush(stdout);
    }

    std::vector<std::string> scenes_;
    int first_ = 1, seeds_ = 10;
    std::string points_ = "20000", stations_ = "0,1,4", noises_ = "0,0.3", frames_ = "1,3,8";
};

} // namespace

std::unique_ptr<Command> sides_part() { return std::make_unique<SidesJudged>(); }

} // namespace scanshade::bench
