#include "ao/sequence/gather.h"

#include "ao/gpu/transfer.h"
#include "ao/screen/screen.h"
#include "projection/base/error.h"
#include "shaders/shared/gather.h"

#include <algorithm>
#include <fmt/format.h>
#include <iterator>

namespace scanshade {
namespace {

enum GatherBuffers : int { own_surfaces, own_visibility, surfaces, visibilities, mean, spread };

std::unique_ptr<gpu::Program> gathering(gpu::Device& device, cv::Size size, std::size_t most) {
    using Host = gpu::BufferRow::Host;
    using Texels = gpu::BufferRow::Texels;
    const auto pixels = static_cast<std::size_t>(size.area());
    ScreenTables all{{{}, size}, size, 0, {}, {}};
    all.buffers = {{"own surfaces", pixels * 8, Host::taken, Texels::rg32ui},
                   {"own visibility", pixels * 4, Host::taken, Texels::r32f},
                   {"surfaces", most * pixels * 8, Host::taken, Texels::rg32ui},
                   {"visibilities", most * pixels * 4, Host::taken, Texels::r32f},
                   {"mean", pixels * 4, Host::download, Texels::r32f},
                   {"spread", pixels * 8, Host::none, Texels::rg32f}};
    const int rows = (size.height + shared::gathered_rows - 1) / shared::gathered_rows;
    all.add_pass_over({size.width, rows}, "gather", "sequence/gather",
                      {own_surfaces, own_visibility, surfaces, visibilities}, {mean, spread});
    return all.program(device, sizeof(shared::GatherConstants));
}

} // namespace

AoMap Gather::compute(const Seen& own, std::span<const Seen> others, const GatherOptions& how) {
    const cv::Size size = own.surfaces->camera.size;
    if (others.size() > shared::most_gathered)
        throw Error(fmt::format("{} frames to average, {} are the most", others.size(), shared::most_gathered));
    for (const Seen& other : others) // before any is taken: a run that fails must leave nothing to the next
        if (other.surfaces->camera.size != size)
            throw Error("a frame of another image size");
    if (!program_ || size != size_ || others.size() > most_) {
        most_ = std::max(others.size(), std::size_t{1});
        program_ = gathering(device_, size, most_);
    }
    size_ = size;
    const DepthImage camera_only{own.surfaces->camera, {}, {}};
    ScreenOptions options;
    options.radius = static_cast<float>(how.radius_m);
    shared::GatherConstants constants{constants_from(options, {.surfaces = camera_only, .noise = how.noise}),
                                      static_cast<int>(others.size()),
                                      0.002F,
                                      0.005F,
                                      {}};
    const std::size_t pixels = static_cast<std::size_t>(size.area());
    program_->take(own_surfaces, 0, own.surfaces->words);
    program_->take(own_visibility, 0, own.visibility);
    for (std::size_t i = 0; i < others.size(); ++i) {
        const Seen& other = others[i];
        constants.places[i] = gpu::place_of(other.surfaces->camera, other.here_from_there);
        program_->take(surfaces, i * pixels * 8, other.surfaces->words);
        program_->take(visibilities, i * pixels * 4, other.visibility);
    }
    program_->run(std::as_bytes(std::span(&constants, 1)));
    timings_ = program_->timings();
    return {gpu::image_on<float>(program_->host(mean), size).clone()};
}

std::vector<Intermediate> Gather::intermediates() {
    const std::vector<std::byte> read = program_->read_back(spread);
    const std::span each(reinterpret_cast<const cv::Vec2f*>(read.data()), read.size() / sizeof(cv::Vec2f));
    const auto map = [&](int channel, const char* name, const char* meaning) {
        std::vector<float> values;
        std::ranges::transform(each, std::back_inserter(values), [&](const cv::Vec2f& both) { return both[channel]; });
        const auto bytes = std::as_bytes(std::span(values));
        return Intermediate{name, "f4", {size_.height, size_.width}, {bytes.begin(), bytes.end()}, meaning};
    };
    return {map(0, "averaged_frames", "frames averaged, counted in views as good as this one"),
            map(1, "averaged_deviation", "standard deviation of visibility between them")};
}

} // namespace scanshade
