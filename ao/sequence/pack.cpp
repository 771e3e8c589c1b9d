#include "ao/sequence/pack.h"

#include "ao/gpu/transfer.h"
#include "ao/screen/screen.h"

namespace scanshade {
namespace {

enum PackBuffers : int { depth_in, given_normals, with_normals, packed_words };

std::unique_ptr<gpu::Program> packing(gpu::Device& device, cv::Size size, bool supplied) {
    using Host = gpu::BufferRow::Host;
    using Texels = gpu::BufferRow::Texels;
    const auto pixels = static_cast<std::size_t>(size.area());
    ScreenTables all{{{}, size}, size, 0, {}, {}};
    all.buffers = {{"depth", pixels * 4, Host::upload, Texels::r32f},
                   {"given normals", supplied ? pixels * 12 : 4, supplied ? Host::upload : Host::none, Texels::r32f},
                   {"surfaces", pixels * 16, Host::none, Texels::rgba32f},
                   {"words", pixels * 8, Host::none, Texels::rg32ui}};
    all.add_pass("normals", "normals", {depth_in, supplied ? given_normals : depth_in}, {with_normals},
                 {{shared::spec_supplied, supplied}});
    all.add_pass("pack", "sequence/pack", {with_normals}, {packed_words});
    return all.program(device, sizeof(shared::ScreenConstants));
}

} // namespace

PackedSurfaces PackSurfaces::compute(const View& view) {
    const Surfaces& surfaces = view.surfaces;
    const cv::Size size = surfaces.camera.size;
    const bool supplied = surfaces.has_normals();
    if (!program_ || size != size_ || supplied != supplied_)
        program_ = packing(device_, size, supplied);
    size_ = size;
    supplied_ = supplied;
    gpu::upload_depth(surfaces.z_m, program_->host_as<float>(depth_in));
    if (supplied)
        gpu::upload(surfaces.normals, program_->host(given_normals));
    const shared::ScreenConstants constants = constants_from({}, view);
    const std::shared_ptr<gpu::DeviceBytes> packed = pool_.get(surfaces.z_m.total() * 8);
    program_->give(packed_words, packed);
    program_->run(std::as_bytes(std::span(&constants, 1)));
    timings_ = program_->timings();
    return {surfaces.camera, packed};
}

} // namespace scanshade
