// Frames computed at once on one device: the same bytes as one after the other, and nothing for Vulkan's
// validation layer to say.
#include "apps/session/workers.h"

#include "apps/results/report.h"
#include "apps/walk/batch.h"
#include "tests/support/small_capture.h"

#include <algorithm>
#include <cstdlib>
#include <gtest/gtest.h>
#include <numeric>

namespace scanshade {
namespace {

using tests::read_bytes;
using tests::TemporaryFolder;
namespace fs = std::filesystem;

class WorkersTest : public testing::TestWithParam<const char*> {
  protected:
    void SetUp() override {
        setenv("SCANSHADE_VALIDATE", "1", 1); // read when a device is opened
        tests::write_capture(folder / "capture", 6);
    }
    /// The capture's maps by a method at its lowest quality, as many frames at once.
    std::vector<FrameRow> run(int in_flight, const DepthNoise& noise, const fs::path& out) {
        Workers workers("", in_flight);
        const auto setup = method_named(GetParam()).setup();
        const auto pool = workers.pool_of(GetParam(), *setup, {});
        EXPECT_EQ(pool->size(), static_cast<std::size_t>(in_flight));
        const Capture capture = open_capture(folder / "capture");
        BatchOptions options;
        options.frames.resize(capture.entries.size());
        std::iota(options.frames.begin(), options.frames.end(), 0);
        options.outputs.folder = out;
        options.outputs.format = AoFormat::tiff; // every bit of every float
        options.radius_m = 0.5;
        options.noise = noise;
        auto rows = run_batch(capture, *pool, options);
        for (const std::string& message : workers.device().validation_messages())
            ADD_FAILURE() << message;
        return rows;
    }
    TemporaryFolder folder;
};

TEST_P(WorkersTest, bytes_do_not_depend_on_how_many_frames_are_computed_at_once) {
    const DepthNoise kinect = noise_from_text("kinect"), none;
    for (const DepthNoise& noise : {kinect, none}) {
        const auto alone = run(1, noise, folder / "alone"), together = run(3, noise, folder / "together");
        ASSERT_EQ(count(alone, FrameStatus::ok), alone.size());
        ASSERT_EQ(count(together, FrameStatus::ok), alone.size());
        for (std::size_t i = 0; i < alone.size(); ++i) {
            EXPECT_EQ(together[i].index, i);
            ASSERT_EQ(alone[i].files, together[i].files);
            for (const fs::path& file : alone[i].files)
                EXPECT_EQ(read_bytes(folder / "alone" / file), read_bytes(folder / "together" / file)) << file;
        }
    }
}

INSTANTIATE_TEST_SUITE_P(Methods, WorkersTest, testing::Values("cacao", "surfel"),
                         [](const auto& tested) { return std::string(tested.param); });

TEST(DevicesTest, all_are_the_gpus_of_one_kind_or_else_one_software_device) {
    const auto devices = gpu::open_devices("all");
    const auto listed = gpu::list_devices();
    const auto is_gpu = [](const gpu::DeviceInfo& info) { return info.unusable.empty() && !gpu::is_cpu(info); };
    if (std::ranges::none_of(listed, is_gpu)) {
        ASSERT_EQ(devices.size(), 1u);
        EXPECT_TRUE(gpu::is_cpu(devices[0]->info()));
        return;
    }
    const gpu::DeviceInfo& first = devices[0]->info();
    EXPECT_EQ(static_cast<std::ptrdiff_t>(devices.size()), std::ranges::count_if(listed, [&](const auto& info) {
                  return is_gpu(info) && info.name == first.name && info.driver == first.driver;
              }));
    for (const auto& device : devices)
        EXPECT_EQ(std::ranges::count(devices, device->info().index, [](const auto& d) { return d->info().index; }), 1);
}

TEST(DevicesTest, a_processor_computes_one_frame_at_a_time_unless_asked) {
    Workers workers("all", 0);
    const auto setup = method_named("cacao").setup();
    const auto pool = workers.pool_of("cacao", *setup, {});
    const std::size_t each = gpu::is_cpu(workers.device().info()) ? 1 : 3;
    EXPECT_EQ(pool->size(), each * workers.devices());
    EXPECT_NE(workers.description(*pool).find(workers.device().info().name), std::string::npos);
}

TEST(DevicesTest, equal_settings_share_methods_and_captures_keep_theirs) {
    Workers workers("", 0);
    const auto with_radius = [](double radius) {
        auto setup = method_named("cacao").setup();
        const std::vector<Parameter> rows = setup->parameters();
        set(*row_named(rows, "radius"), radius);
        return setup;
    };
    const auto half = workers.pool_of("cacao", *with_radius(0.5), {});
    const auto tenth = workers.pool_of("cacao", *with_radius(0.1), {});
    EXPECT_NE(half, tenth);
    EXPECT_EQ(workers.pool_of("cacao", *with_radius(0.5), {}), half);
    for (const double radius : {0.2, 0.05, 0.02})
        (void)workers.pool_of("cacao", *with_radius(radius), {});
    EXPECT_GT(tenth->size(), 0U);
    EXPECT_FALSE(
        half->lease()->compute({tests::small_camera().pinhole, tests::corner_depth(0), {}}, {}).visibility.empty());
}

} // namespace
} // namespace scanshade
