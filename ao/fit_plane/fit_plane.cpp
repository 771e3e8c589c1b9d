#include "ao/fit_plane/fit_plane.h"

#include "ao/gpu/transfer.h"
#include "projection/base/error.h"
#include "projection/sensor/sensor_class.h"
#include "shaders/shared/fit_plane.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <limits>

namespace scanshade {
namespace {

// The order of buffers; all but the first two only where planes are fitted, the last ones only where frames are fused
// or holes are filled.
enum Buffers : int {
    recorded,
    kept,
    averages,
    depth_out,
    normals_out,
    others_in,
    fused,
    relief,
    ends,
    filled = others_in,
    marks
};

/// Of the window's radius, squared, in units of correlation^2 sigma fx / z (pixels). Below it noise tilts normals,
/// above it a plane no longer is what surfaces are. A somewhat lower value leaves less error in AO on simulated
/// Kinects. But a real one's noise correlates over more pixels than the correlation length says, and its walls would
/// stay mottled.
constexpr double window_scale = 1.8;
/// The same where each pixel errs by itself, after means of 3x3: a compromise between a time-of-flight camera's noise,
/// which asks for less, and four times as much, which asks for more.
constexpr double independent_window_scale = 5;
/// Of fused frames, as their values tell smaller shapes.
constexpr double fused_window = 0.5;

/// The widest hole that is filled: an angle, 20 pixels of a Kinect. The shadow of structured light is wider close to
/// the sensor, but filling up to 60 pixels gained nothing.
constexpr double fill_radians = 0.038;
int fill_px_for(const Pinhole& camera) {
    return std::clamp(static_cast<int>(std::lround(fill_radians * camera.fx)), 4, 64);
}

std::uint32_t marks_of(cv::Size size) {
    return (static_cast<std::uint32_t>(size.area()) + shared::marks_a_word - 1) / shared::marks_a_word;
}

std::unique_ptr<gpu::Program> program_for(gpu::Device& device, const FitPlaneVariant& variant) {
    const cv::Size size = variant.size;
    const bool planes = variant.planes, fuse = variant.fused;
    using Host = gpu::BufferRow::Host;
    constexpr auto floats = gpu::BufferRow::Texels::r32f;
    const auto pixels = static_cast<std::size_t>(size.area());
    const auto groups_of = [&](int columns, int rows) { // of 8x8 threads, each of that many pixels
        const auto tiles = [](int n, int of) { return static_cast<std::uint32_t>((n + of - 1) / of); };
        return std::array<std::uint32_t, 3>{tiles(size.width, 8 * columns), tiles(size.height, 8 * rows), 1};
    };
    const std::array<std::uint32_t, 3> groups = groups_of(1, 1);
    std::vector<gpu::BufferRow> buffers{{"recorded", pixels * 4, Host::upload, floats},
                                        {"kept", pixels * 4, planes ? Host::none : Host::download, floats}};
    std::vector<gpu::PassRow> passes{{"flying pixels", "fit_plane/flying", {recorded}, {kept}, groups, {}}};
    if (planes) {
        buffers.insert(buffers.end(), {{"averages", pixels * 4, Host::none, floats},
                                       {"depth out", pixels * 4, Host::download, floats},
                                       {"normals out", pixels * 12, Host::download, floats}});
        if (fuse) {
            buffers.insert(buffers.end(), {{"others", shared::most_neighbours * pixels * 4, Host::taken, floats},
                                           {"fused", pixels * 4, Host::none, floats},
                                           {"relief", pixels * 4, Host::none, floats},
                                           {"ends", 2 * pixels * 4, Host::none, gpu::BufferRow::Texels::r32ui}});
            passes.push_back({"clear ends", "", {}, {ends}, {1, 1, 1}, {}});
            passes.push_back({"splat", "fit_plane/splat", {kept, others_in}, {ends}, groups_of(2, 2), {}});
            passes.push_back({"fuse",
                              "fit_plane/fuse",
                              {kept, others_in, ends},
                              {fused, relief},
                              groups_of(1, shared::fused_rows),
                              {}});
        }
        const std::vector<std::pair<int, int>> averages_of{{shared::spec_fused, fuse},
                                                           {shared::spec_small, fuse || variant.independent}};
        const std::vector<std::pair<int, int>> fits{{shared::spec_fused, fuse}, {shared::spec_waves, variant.waves}};
        const int samples = fuse ? fused : kept, errs = fuse ? relief : kept; // unread without
        passes.push_back({"average",
                          "fit_plane/average",
                          {samples, errs},
                          {averages},
                          groups_of(1, shared::average_rows),
                          averages_of});
        passes.push_back({"fit plane", "fit_plane/fit", {averages, errs}, {depth_out, normals_out}, groups, fits});
        if (variant.filled) {
            const std::uint32_t words = marks_of(size);
            buffers.insert(buffers.end(),
                           {{"filled", pixels * 4, Host::none, floats},
                            {"marks", std::size_t{words} * 4, Host::download, gpu::BufferRow::Texels::none}});
            buffers.back().always_downloaded = true;
            passes.push_back({"fill", "fit_plane/fill", {depth_out, normals_out}, {filled, normals_out}, groups, {}});
            passes.push_back({"mark filled",
                              "fit_plane/mark",
                              {depth_out, filled},
                              {marks},
                              {(words + shared::mark_group - 1) / shared::mark_group, 1, 1},
                              {}});
        }
    }
    for (gpu::BufferRow& buffer : buffers)
        buffer.plain_writes = true;
    return std::make_unique<gpu::Program>(device, buffers, passes, sizeof(shared::FitPlaneConstants));
}

} // namespace

FitPlane::FitPlane(gpu::Device& device, const DepthNoise& noise, const FitPlaneOptions& options)
    : device_(device), pool_(device), options_(options) {
    set_noise(noise);
}

void FitPlane::set_noise(const DepthNoise& noise) {
    if (!noise.needs_preparation())
        throw Error("depth without noise and flying pixels needs no preparation");
    noise_ = noise;
}

void FitPlane::prepare(const DepthImage& depth, std::span<const OtherDepth> others, bool fill) {
    const cv::Size size = depth.z_m.size();
    const bool fuse = planes() && !others.empty();
    if (others.size() > shared::most_neighbours)
        throw Error(fmt::format("{} other frames, {} are the most", others.size(), shared::most_neighbours));
    for (const OtherDepth& other : others) // before any is taken: a run that fails must leave nothing to the next
        if (other.camera.size != size)
            throw Error("another frame of another image size");
    const bool waves = class_of(noise_) == SensorClass::structured_light;
    const FitPlaneVariant variant{.size = size,
                                  .planes = planes(),
                                  .fused = fuse,
                                  .waves = waves,
                                  .independent = !waves && noise_.correlation_px < independent_px,
                                  .filled = !fuse && options_.fill_holes};
    if (!program_ || variant != variant_)
        program_ = program_for(device_, variant);
    variant_ = variant;
    const double scale = (variant.independent ? independent_window_scale : window_scale) * (fuse ? fused_window : 1),
                 pixels = noise_.correlation_px * options_.smoothing;
    constants_ = {{size.width, size.height},
                  depth.camera.on_gpu(),
                  static_cast<float>(noise_.floor_m),
                  static_cast<float>(noise_.per_z2),
                  static_cast<float>(scale * pixels * pixels),
                  static_cast<float>(options_.largest_radius_px),
                  static_cast<float>(3 * options_.smoothing),
                  options_.drop_flying && noise_.flies() ? 1 : 0,
                  fill ? fill_px_for(depth.camera) : 0,
                  fuse ? static_cast<int>(others.size()) : 0,
                  {}};
    for (std::size_t i = 0; fuse && i < others.size(); ++i) {
        constants_.places[i] = gpu::place_of(others[i].camera, others[i].here_from_there);
        program_->take(others_in, i * others[i].z_m->size(), others[i].z_m);
    }
    gpu::upload_depth(depth.z_m, program_->host_as<float>(recorded));
}

FittedOnDevice FitPlane::compute_on_device(const DepthImage& depth) {
    const bool fill = options_.fill_holes;
    prepare(depth, {}, fill);
    const std::size_t pixels = depth.z_m.total();
    const std::shared_ptr<gpu::DeviceBytes> z_m = pool_.get(pixels * 4), normals = pool_.get(pixels * 12),
                                            without_holes = fill ? pool_.get(pixels * 4) : z_m;
    program_->give(depth_out, z_m);
    program_->give(normals_out, normals);
    if (fill)
        program_->give(filled, without_holes);
    program_->run(std::as_bytes(std::span(&constants_, 1)), gpu::Program::Results::on_device);
    timings_ = program_->timings();
    FittedOnDevice fitted{{depth.camera, without_holes, normals}, z_m, {}};
    if (fill) {
        const auto bits = program_->host_as<std::uint32_t>(marks);
        fitted.filled.assign(bits.begin(), bits.end());
    }
    return fitted;
}

void take_out_filled(const FittedOnDevice& fitted, cv::Mat1f& visibility) {
    const auto pixels = static_cast<std::size_t>(visibility.total());
    assert(visibility.isContinuous());
    auto* const of_pixel = visibility.ptr<float>();
    for (std::size_t word = 0; word < fitted.filled.size(); ++word)
        for (std::uint32_t left = fitted.filled[word]; left != 0; left &= left - 1) {
            const std::size_t at = word * static_cast<std::size_t>(shared::marks_a_word) +
                                   static_cast<std::size_t>(std::countr_zero(left));
            if (at < pixels)
                of_pixel[at] = std::numeric_limits<float>::quiet_NaN();
        }
}

FittedDepth FitPlane::compute(const DepthImage& depth, std::span<const OtherDepth> others) {
    prepare(depth, others, false);
    program_->run(std::as_bytes(std::span(&constants_, 1)));
    timings_ = program_->timings();
    const cv::Mat1f& z = depth.z_m;
    const cv::Size size = z.size();
    FittedDepth fitted{{depth.camera, {}, depth.source}, {}};
    if (!planes()) {
        fitted.depth.z_m.create(size);
        const auto inverse = program_->host_as<float>(kept);
        std::transform(z.begin(), z.end(), inverse.begin(), fitted.depth.z_m.begin(),
                       [](float z_m, float w) { return w > 0 ? z_m : 0; });
        return fitted;
    }
    fitted.normals.normals.create(size);
    fitted.depth.z_m = gpu::downloaded(program_->host_as<float>(depth_out), size);
    std::memcpy(fitted.normals.normals.data, program_->host(normals_out).data(), z.total() * 12);
    return fitted;
}

} // namespace scanshade
