#include "ao/fit_plane/fit_plane.h"

#include "projection/error.h"
#include "shaders/shared/fit_plane.h"

#include <cstring>

namespace scanshade {
namespace {

enum Buffers : int { depth_in, depth_out, normals_out };

std::unique_ptr<gpu::Program> program_for(gpu::Device& device, cv::Size size) {
    using Host = gpu::BufferRow::Host;
    constexpr auto floats = gpu::BufferRow::Texels::r32f;
    const auto pixels = static_cast<std::size_t>(size.area());
    const auto groups = [](int n) { return static_cast<std::uint32_t>((n + 7) / 8); };
    return std::make_unique<gpu::Program>(
        device,
        std::vector<gpu::BufferRow>{{"depth in", pixels * 4, Host::upload, floats},
                                    {"depth out", pixels * 4, Host::download, floats},
                                    {"normals out", pixels * 12, Host::download, floats}},
        std::vector<gpu::PassRow>{{"fit plane", "fit_plane", {depth_in}, {depth_out, normals_out},
                                   {groups(size.width), groups(size.height), 1}, {}}},
        sizeof(shared::FitPlaneConstants));
}

} // namespace

FitPlane::FitPlane(gpu::Device& device, const DepthNoise& noise, double largest_radius_px)
    : device_(device), noise_(noise), largest_radius_px_(largest_radius_px) {
    if (!noise.any()) throw Error("a plane fit needs a noise above zero");
}

FittedDepth FitPlane::compute(const DepthImage& depth) {
    const cv::Size size = depth.z_m.size();
    if (!program_ || size != size_) program_ = program_for(device_, size);
    size_ = size;
    const shared::Pinhole camera = depth.camera.on_gpu();
    const shared::FitPlaneConstants constants{{size.width, size.height}, camera.fx, camera.fy, camera.cx, camera.cy,
                                              static_cast<float>(noise_.floor_m), static_cast<float>(noise_.per_z2),
                                              static_cast<float>(largest_radius_px_)};
    const cv::Mat1f z = depth.z_m.isContinuous() ? depth.z_m : depth.z_m.clone();
    std::memcpy(program_->host(depth_in).data(), z.data, z.total() * 4);
    program_->run(std::as_bytes(std::span(&constants, 1)));
    timings_ = program_->timings();
    FittedDepth fitted{{depth.camera, cv::Mat1f(size), depth.source}, {cv::Mat3f(size)}};
    std::memcpy(fitted.depth.z_m.data, program_->host(depth_out).data(), z.total() * 4);
    std::memcpy(fitted.normals.normals.data, program_->host(normals_out).data(), z.total() * 12);
    return fitted;
}

AoMap OnFittedDepth::compute(const View& view) {
    const FittedDepth fitted = fit_.compute(view.depth);
    AoMap ao = method_.compute({fitted.depth, view.normals ? view.normals : &fitted.normals, noise_, true});
    timings_ = fit_.timings();
    timings_.insert(timings_.end(), method_.timings().begin(), method_.timings().end());
    return ao;
}

} // namespace scanshade
