// Lavapipe compiles each shader once, however many frames and captures follow. Each compilation makes one LLVM module.
// This program defines that function itself, the driver finds the definition before LLVM's own, and it counts.
#include "ao/base/method.h"
#include "ao/sequence/sequence_ao.h"
#include "tests/support/scenes.h"
#include "tests/support/watched.h"

#include <atomic>
#include <cstring>
#include <dlfcn.h>
#include <gtest/gtest.h>
#include <link.h>
#include <string>

namespace {

std::atomic<int> modules = 0;

/// The path of LLVM among the loaded libraries; the driver loads it for itself alone.
std::string llvm_library() {
    std::string path;
    dl_iterate_phdr(
        [](dl_phdr_info* info, std::size_t, void* found) {
            if (std::strstr(info->dlpi_name, "libLLVM"))
                *static_cast<std::string*>(found) = info->dlpi_name;
            return 0;
        },
        &path);
    return path;
}

} // namespace

// NOLINTNEXTLINE(readability-identifier-naming): the name is LLVM's
extern "C" __attribute__((visibility("default"))) void* LLVMModuleCreateWithNameInContext(const char* name,
                                                                                          void* context) {
    using Make = void* (*)(const char*, void*);
    static const Make make = [] {
        void* const llvm = dlopen(llvm_library().c_str(), RTLD_NOW | RTLD_NOLOAD);
        return reinterpret_cast<Make>(dlsym(llvm, "LLVMModuleCreateWithNameInContext"));
    }();
    ++modules;
    return make(name, context);
}

namespace scanshade {
namespace {

using namespace tests;

constexpr double radius_m = 0.5;
const DepthNoise kinect{0.001, 0.002, 2, 0};

/// A recording's frames, each with others to be looked at with.
void compute_recording(gpu::Device& device, Method& method, int frames) {
    FitPlaneOptions fit;
    SequenceAoOptions options;
    options.reach = 4;
    SequenceAo sequence(device, method, radius_m, kinect, fit, options);
    for (int i = 0; i < frames; ++i) {
        Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
        pose.translation().x() = 0.01 * i;
        sequence.add(static_cast<std::size_t>(i), wall_corner(test_camera()), pose);
    }
    std::size_t together = 0;
    for (int i = 0; i < frames; ++i) {
        const SequenceAoResult result = sequence.compute(static_cast<std::size_t>(i));
        together += result.fused.size() + result.averaged.size();
    }
    EXPECT_GT(together, 0U); // otherwise nothing of what is tested ran
}

class CompiledOnce : public testing::TestWithParam<std::string> {
  protected:
    gpu::Device& device = watched_device();
    static void skip_where_not_counted() {
        if (modules == 0)
            GTEST_SKIP() << "the driver compiles with something else than LLVM";
    }
};

TEST_P(CompiledOnce, frames_after_the_first_compile_nothing) {
    const std::unique_ptr<Method> method = method_named(GetParam()).setup()->make(device);
    const DepthImage depth = wall_corner(test_camera());
    (void)method->compute({depth});
    const int once = modules;
    for (int i = 0; i < 3; ++i)
        (void)method->compute({depth});
    EXPECT_EQ(modules - once, 0);
    skip_where_not_counted();
}

TEST_P(CompiledOnce, captures_after_the_first_compile_nothing) {
    // A uniform that alone ended a loop was compiled in on every run: 90 KB and more a capture, never freed.
    const std::unique_ptr<Method> method = method_named(GetParam()).setup()->make(device);
    constexpr int frames = 9;
    compute_recording(device, *method, frames);
    const int once = modules;
    for (int capture = 0; capture < 2; ++capture)
        compute_recording(device, *method, frames);
    EXPECT_EQ(modules - once, 0);
    skip_where_not_counted();
}

std::vector<std::string> on_the_device() {
    std::vector<std::string> names;
    for (const MethodRow& method : methods())
        if (method.name != "raycast")
            names.emplace_back(method.name);
    return names;
}

INSTANTIATE_TEST_SUITE_P(EveryMethod, CompiledOnce, testing::ValuesIn(on_the_device()),
                         [](const auto& each) { return each.param; });

} // namespace
} // namespace scanshade
