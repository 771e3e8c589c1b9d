// The flatness of real captures is judged where planes are open: on generated rooms, truth says whether they are.
#include "apps/measure/flat_surfaces.h"
#include "apps/scenes/scene.h"

#include <gtest/gtest.h>

namespace scanshade {
namespace {

constexpr double radius_m = 0.3;
const Pinhole camera{250, 250, 159.5, 119.5, {320, 240}};

TrialFrame view_of(const scene::World& world, double second) {
    const Eigen::Isometry3d pose = scene::world_from_camera(world.scene().walk, second);
    const scene::Geometry exact = render_geometry(world, camera, pose);
    TrialFrame view;
    view.frame.world_from_camera = pose;
    view.depth = {camera, exact.z_m, {}};
    view.exact_z_m = exact.z_m;
    view.truth = true_visibility(world, camera, pose, {.radius_m = radius_m, .rays = 64}).visibility[0];
    return view;
}

TEST(flat_surfaces, are_open_where_they_say_so) {
    for (const char* name : {"office", "staircase"})
        for (const bool posed : {true, false}) {
            const scene::World world(scene::scene_named(name));
            std::vector<TrialFrame> views{view_of(world, 2), view_of(world, 8.7)};
            for (TrialFrame& view : views)
                if (!posed)
                    view.frame.world_from_camera.reset();
            const FlatSurfaces flat = flat_surfaces(views, radius_m);
            EXPECT_GE(flat.planes, 2);
            double open = 0, closed = 0, all = 0;
            for (std::size_t i = 0; i < views.size(); ++i)
                for (int v = 0; v < camera.size.height; ++v)
                    for (int u = 0; u < camera.size.width; ++u)
                        if (const float truth = views[i].truth(v, u); truth == truth) {
                            all += 1;
                            const bool marked = flat.of_planes[i](v, u) == 255;
                            open += marked;
                            closed += marked && truth < 0.9F;
                        }
            EXPECT_GT(open, 0.05 * all) << name;
            EXPECT_LT(closed, 0.02 * open) << name << (posed ? ", fused" : ", each by itself");
        }
}

} // namespace
} // namespace scanshade
