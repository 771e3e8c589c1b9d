#include "ao/screen/screen.h"

#include "ao/gpu/transfer.h"
#include "ao/screen/noise.h"
#include "projection/base/stopwatch.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace scanshade {
namespace {

void check_view(const View& view) {
    check_sizes(view.surfaces);
    if (view.surfaces.on_device() && !view.neighbours.empty())
        throw Error("surfaces on the device have no room for a guard band");
}

std::vector<gpu::BufferRow> shared_buffers(std::size_t pixels, bool supplied, int seed) {
    using Host = gpu::BufferRow::Host;
    constexpr auto floats = gpu::BufferRow::Texels::r32f, pairs = gpu::BufferRow::Texels::rg32f;
    const std::vector<float> noise = noise_table(seed);
    return {
        {"depth", pixels * 4, Host::upload, floats},
        {"given normals", supplied ? pixels * 12 : 4, supplied ? Host::upload : Host::none, floats},
        {"surfaces", pixels * 16, Host::none, gpu::BufferRow::Texels::rgba32f},
        {"noise", noise.size() * 4, Host::none, pairs, noise},
        {"raw", pixels * 4, Host::none, floats},
        {"visibility", pixels * 4, Host::download, floats},
    };
}

/// Those looked at; throws Error where one is of another size, or there are too many.
std::span<const Neighbour> checked_neighbours(const View& view) {
    if (view.neighbours.size() > shared::most_neighbours)
        throw Error(fmt::format("{} neighbours, {} are the most", view.neighbours.size(), shared::most_neighbours));
    for (const Neighbour& neighbour : view.neighbours)
        if (neighbour.surfaces->camera.size != view.surfaces.camera.size)
            throw Error("a neighbour of another image size");
    return view.neighbours;
}

} // namespace

std::vector<Parameter> ScreenOptions::parameters() {
    return {
        {.name = "radius",
         .help = "surfaces farther away than this do not occlude",
         .value = &radius,
         .unit = "m",
         .low = 1e-6,
         .high = 1e6},
        {.name = "strength",
         .help = "the share of the occlusion that is shown, before the power",
         .value = &strength,
         .low = 0,
         .high = 2},
        {.name = "power", .help = "exponent of the visibility", .value = &power, .low = 0.25, .high = 8},
        {.name = "denoise",
         .help = "takes the mean over those of the 5x5 pixels around that lie on the same plane",
         .value = &denoise},
        {.name = "seed", .help = "another number gives another noise pattern", .value = &seed, .low = 0, .high = 1e6},
    };
}

Parameter ScreenOptions::curve_row() {
    return {.name = "curve",
            .help = "k of the tone curve exp(-k (1 - V)), before strength and power: -1 the one fitted to scenes with "
                    "truth, 0 none",
            .value = &curve,
            .low = -1,
            .high = 20};
}

int ScreenTables::add_buffer(gpu::BufferRow row) {
    buffers.push_back(std::move(row));
    return static_cast<int>(buffers.size()) - 1;
}

void ScreenTables::add_pass_over(cv::Size over, std::string name, std::string_view shader, std::vector<int> reads,
                                 std::vector<int> writes, std::vector<std::pair<int, int>> constants,
                                 int pixels_a_side) {
    const int tile = shared::screen_tile * pixels_a_side;
    const auto groups = [&](int n) { return static_cast<std::uint32_t>((n + tile - 1) / tile); };
    passes.push_back({std::move(name),
                      shader,
                      std::move(reads),
                      std::move(writes),
                      {groups(over.width), groups(over.height), 1},
                      std::move(constants)});
}

std::unique_ptr<gpu::Program> ScreenTables::program(gpu::Device& device, std::size_t constants_bytes) const {
    std::vector<gpu::BufferRow> rows = buffers;
    for (gpu::BufferRow& row : rows)
        row.plain_writes = true;
    return std::make_unique<gpu::Program>(device, std::move(rows), passes, constants_bytes);
}

void ScreenTables::add_blurs(int iterations, const std::vector<float>& weights) {
    if (iterations == 0)
        return;
    constexpr auto floats = gpu::BufferRow::Texels::r32f;
    const int between = add_buffer({"between blurs", pixels() * 4, gpu::BufferRow::Host::none, floats});
    const int table = add_buffer({"blur weights", weights.size() * 4, gpu::BufferRow::Host::none, floats, weights});
    const int radius = static_cast<int>(weights.size()) - 1;
    for (int i = 0; i < iterations; ++i)
        for (const bool down : {false, true})
            add_pass(fmt::format("blur {} {}", i + 1, down ? "down" : "across"), "blur",
                     {screen_surfaces, down ? between : screen_raw, table}, {down ? screen_raw : between},
                     {{shared::spec_blur_radius, radius}, {shared::spec_blur_down, down}});
}

std::vector<Parameter> joined(std::vector<Parameter> rows, const std::vector<Parameter>& more) {
    rows.insert(rows.end(), more.begin(), more.end());
    return rows;
}

int guard_px(cv::Size size) { return (std::max(size.width, size.height) / 5 + 3) / 4 * 4; }

shared::ScreenConstants constants_from(const ScreenOptions& options, const View& view, int guard) {
    Pinhole camera = view.surfaces.camera;
    camera.cx += guard;
    camera.cy += guard;
    shared::ScreenConstants k{};
    k.camera = camera.on_gpu();
    k.size = {camera.size.width + 2 * guard, camera.size.height + 2 * guard};
    k.origin = {guard, guard};
    k.window = {camera.size.width, camera.size.height};
    // Each by itself evenly spread over any few instants: the golden ratio and the square root of two.
    const auto turned = [&](double by) { return static_cast<float>(std::fmod(view.instant * by, 1.0)); };
    k.turn = {turned(0.6180339887498949), turned(0.4142135623730951)};
    k.ray_step = {static_cast<float>(1 / camera.fx), static_cast<float>(1 / camera.fy)};
    k.ray_base = {static_cast<float>(-camera.cx / camera.fx), static_cast<float>(-camera.cy / camera.fy)};
    k.radius = options.radius;
    k.noise_floor = static_cast<float>(view.noise.floor_m);
    k.noise_per_z2 = static_cast<float>(view.noise.per_z2);
    k.tangent_sine = options.tangent_sine;
    k.tangent_sigmas = view.smoothed ? 0.0F : options.tangent_sigmas;
    k.curve = options.curve;
    k.strength = options.strength;
    k.power = options.power;
    return k;
}

void ScreenMethod::add_denoise(ScreenTables& tables) const {
    tables.add_pass("denoise", "denoise", {screen_surfaces, screen_raw}, {screen_visibility},
                    {{shared::spec_denoise, options_.denoise}}, 2);
}

ScreenTables ScreenMethod::tables(const Shape& shape) const {
    const auto [width, height, supplied, neighbours, noisy] = shape;
    const cv::Size size(width, height);
    const int guard = neighbours > 0 ? guard_px(size) : 0;
    const cv::Size image(size.width + 2 * guard, size.height + 2 * guard);
    ScreenTables all{{{guard, guard}, size},
                     image,
                     neighbours,
                     shared_buffers(static_cast<std::size_t>(image.area()), supplied, options_.seed),
                     {},
                     noisy};
    if (neighbours > 0) {
        const auto each = static_cast<std::size_t>(neighbours);
        all.add_buffer({"neighbours", each * static_cast<std::size_t>(size.area()) * 8, gpu::BufferRow::Host::taken,
                        gpu::BufferRow::Texels::rg32ui});
    }
    // Without normals of the view, depth fills their slot; nothing reads it.
    all.add_pass_over(size, "normals", "normals", {screen_depth, supplied ? screen_given : screen_depth},
                      {screen_surfaces}, {{shared::spec_supplied, supplied}});
    add_passes(all);
    add_denoise(all);
    return all;
}

/// Programs are kept for one image size: with neighbours and without.
gpu::Program& ScreenMethod::program_for(const Shape& shape, std::size_t constants_bytes) {
    const auto [width, height, supplied, neighbours, noisy] = shape;
    if (!programs_.empty()) {
        const auto [other_width, other_height, s, n, y] = programs_.begin()->first;
        if (width != other_width || height != other_height)
            programs_.clear();
    }
    std::unique_ptr<gpu::Program>& program = programs_[shape];
    if (!program)
        program = tables(shape).program(device_, constants_bytes);
    return *program;
}

AoMap ScreenMethod::compute(const View& view) {
    check_view(view);
    const Surfaces& surfaces = view.surfaces;
    const cv::Size size = surfaces.camera.size;
    const bool supplied = surfaces.has_normals();
    const auto neighbours = looks_at_neighbours() ? checked_neighbours(view) : std::span<const Neighbour>{};
    const int most = neighbours.empty() ? 0 : (static_cast<int>(neighbours.size()) + 3) / 4 * 4;
    const int guard = most > 0 ? guard_px(size) : 0;
    shared::ScreenConstants screen = constants_from(options_, view, guard);
    screen.neighbours = static_cast<int>(neighbours.size());
    const bool noisy = screen.noise_floor > 0 || screen.noise_per_z2 > 0;
    for (const Neighbour& other : neighbours)
        screen.alignment_error = std::max(screen.alignment_error, static_cast<float>(2 * other.alignment_error_m));
    std::ranges::transform(neighbours, screen.places, [](const Neighbour& other) {
        return gpu::place_of(other.surfaces->camera, other.here_from_there);
    });
    const auto block = constants(screen);
    gpu::Program& program = program_for({size.width, size.height, supplied, most, noisy}, block.size());
    Stopwatch stopwatch;
    const cv::Rect window({guard, guard}, size);
    const cv::Size image(screen.size.x, screen.size.y);
    if (surfaces.on_device()) {
        program.take(screen_depth, 0, surfaces.z_there);
        program.take(screen_given, 0, surfaces.normals_there);
    } else {
        gpu::upload_depth(surfaces.z_m, gpu::image_on<float>(program.host(screen_depth), image)(window));
        if (supplied)
            surfaces.normals.copyTo(gpu::image_on<cv::Vec3f>(program.host(screen_given), image)(window));
    }
    for (std::size_t i = 0; const Neighbour& other : neighbours)
        program.take(screen_neighbours, i++ * other.surfaces->words->size(), other.surfaces->words);
    const double upload_ms = stopwatch.lap_ms();
    program.run(block);
    (void)stopwatch.lap_ms(); // the program times its own passes
    look_at(program, most > 0 ? screen_neighbours + 1 : screen_own);
    AoMap ao{gpu::image_on<float>(program.host(screen_visibility), image)(window).clone()};
    const double download_ms = stopwatch.ms();
    timings_.assign({{"host upload", upload_ms}});
    timings_.insert(timings_.end(), program.timings().begin(), program.timings().end());
    timings_.emplace_back("host download", download_ms);
    return ao;
}

} // namespace scanshade
