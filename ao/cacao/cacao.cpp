#include "ao/cacao/cacao.h"

#include "ao/gpu/transfer.h"
#include "projection/base/error.h"

#include <chrono>
#include <fmt/format.h>

namespace scanshade {

Cacao::Cacao(gpu::Device& device, CacaoOptions options) : device_(device), options_(std::move(options)) {
    for (const Parameter& row : options_.parameters())
        check(row);
    if (options_.fade_to <= options_.fade_from && options_.fade_to > 0)
        throw Misuse("fade-to must lie beyond fade-from");
    if (options_.near_m == options_.far_m)
        throw Misuse("near and far must differ");
}

void Cacao::prepare(const View& view) {
    const Pinhole& camera = view.surfaces.camera;
    const bool supplied = view.surfaces.has_normals();
    if (program_ && supplied == normals_supplied_ && camera.size == camera_.size) {
        if (camera == camera_)
            return;
    } else {
        program_.reset();
    }
    constants_ = constants_from(options_, camera);
    camera_ = camera;
    normals_supplied_ = supplied;
    if (program_)
        return;
    tables_ = cacao_tables(options_, constants_, supplied, cacao_storage(options_, device_));
    program_ = std::make_unique<gpu::Program>(device_, tables_.buffers, tables_.passes, sizeof constants_);
}

AoMap Cacao::compute(const View& view) {
    const Surfaces& surfaces = view.surfaces;
    check_sizes(surfaces);
    prepare(view);
    const auto start = std::chrono::steady_clock::now();
    if (surfaces.on_device()) {
        program_->take(cacao_depth_in, 0, surfaces.z_there);
        program_->take(cacao_normals_in, 0, surfaces.normals_there);
    } else {
        if (options_.scan() && options_.depth_input == CacaoDepthInput::metric)
            gpu::upload_depth(surfaces.z_m, program_->host_as<float>(cacao_depth_in));
        else
            gpu::upload(surfaces.z_m, program_->host(cacao_depth_in));
        if (surfaces.has_normals())
            gpu::upload(surfaces.normals, program_->host(cacao_normals_in));
    }
    const auto uploaded = std::chrono::steady_clock::now();
    program_->run(std::as_bytes(std::span(&constants_, 1)));
    const auto ran = std::chrono::steady_clock::now();
    AoMap ao{gpu::downloaded(program_->host_as<float>(cacao_out), surfaces.camera.size)};
    const auto done = std::chrono::steady_clock::now();
    const auto ms = [](auto from, auto to) { return std::chrono::duration<double, std::milli>(to - from).count(); };
    timings_.assign({{"host upload", ms(start, uploaded)}});
    timings_.insert(timings_.end(), program_->timings().begin(), program_->timings().end());
    timings_.emplace_back("host download", ms(ran, done));
    return ao;
}

} // namespace scanshade
