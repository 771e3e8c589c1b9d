#include "ao/cacao/cacao.h"

#include "ao/gpu/transfer.h"
#include "projection/error.h"
#include "shaders/lib/cacao_pattern.glsl"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <fmt/format.h>

namespace scanshade {
namespace {

using shared::CacaoConstants;
using shared::ivec2;
using shared::vec2;

constexpr float pi = 3.14159265358979323846F;
constexpr int most_fused = 4; // blur steps in one pass: each widens the rim that work groups compute twice

int halved(int n) { return (n + 1) / 2; }
int groups(int threads, int tile) { return (threads + tile - 1) / tile; }
std::size_t texels(ivec2 size) { return static_cast<std::size_t>(size.x) * static_cast<std::size_t>(size.y); }

/// The sampling pattern as the adaptive taps of HIGHEST read it.
#define ROW(i, x, y, weight, mip_bias) x##F, y##F, weight##F, mip_bias##F,
const std::vector<float> taps{CACAO_PATTERN_0_3(ROW) CACAO_PATTERN_3_5(ROW) CACAO_PATTERN_5_12(ROW)
                                  CACAO_PATTERN_12_31(ROW)};
#undef ROW

/// What the buffer `pattern` holds: the taps, then the rotations of each slice.
std::vector<float> pattern() {
    std::vector<float> rows = taps;
    for (int a = 0; a < 4; ++a)
        for (int phase = 0; phase < 5; ++phase) {
            const vec2 r = cacao_rotation(a, phase);
            rows.insert(rows.end(), {r.x, r.y, 0.0F, 0.0F});
        }
    return rows;
}

/// Device depth d -> z = mu / (alpha - d), with z positive for both orders of near and far.
vec2 depth_unpack(const CacaoOptions& options) {
    const float n = options.near_m, f = options.far_m;
    const bool reverse = options.depth_input == "reverse_z";
    const float p22 = reverse ? n / (n - f) : f / (f - n); // z' = p22 + p23 / z, left-handed
    const float p23 = reverse ? -f * n / (n - f) : -n * f / (f - n);
    const float mu = -p23;
    return {mu, mu * p22 < 0 ? -p22 : p22};
}

void set_sizes(CacaoConstants& k, const CacaoOptions& options, cv::Size image) {
    k.image = {image.width, image.height};
    k.slice = {halved(image.width), halved(image.height)};
    if (options.downsampled)
        k.slice = {halved(k.slice.x), halved(k.slice.y)};
    k.importance = {halved(k.slice.x), halved(k.slice.y)};
    k.grid = {halved(image.width) + 4, halved(image.height) + 4};
    k.slice_inv = {1.0F / static_cast<float>(k.slice.x), 1.0F / static_cast<float>(k.slice.y)};
    k.image_inv = {1.0F / static_cast<float>(image.width), 1.0F / static_cast<float>(image.height)};
    // Mip starts by shifts alone: with a stride of 24s and rows of 8s, 4/3 of mip 0 is divisible by 64. Each mip ends
    // with at least one column and row that nothing writes; they serve as the rim of its left and upper side, too, and
    // the first slice has a row before it.
    k.depth_stride = 24 * groups(8 * groups(k.slice.x, 8) + 8, 24);
    const int padded = k.depth_stride * 8 * (groups(k.slice.y, 8) + 1), lead = k.depth_stride + 8;
    k.depth_mips = padded / 3 * 4;
    k.depth_end = lead + k.depth_mips;
    k.depth_pitch = k.depth_end - (k.depth_mips >> 8);
}

void set_camera(CacaoConstants& k, const Pinhole& camera) {
    const float width = static_cast<float>(camera.size.width), height = static_cast<float>(camera.size.height);
    const auto c = camera.on_gpu();
    k.view_mul = {width / c.fx, -height / c.fy};
    k.view_add = {-(c.cx + 0.5F) / c.fx, (c.cy + 0.5F) / c.fy};
    k.ray_step = {1.0F / c.fx, -1.0F / c.fy};
    k.ray_base = {static_cast<float>(-camera.cx / camera.fx), static_cast<float>(camera.cy / camera.fy)};
}

} // namespace

shared::vec2 cacao_rotation(int a, int phase) {
    constexpr std::array<int, 5> order{0, 1, 4, 3, 2};
    const float b = static_cast<float>(order[static_cast<std::size_t>(phase)]);
    const float slice = static_cast<float>(a);
    const float angle = (slice + b / 5.0F) * (pi * 0.5F);
    const float scale = 1.0F + (slice - 1.5F + (b - 2.0F) / 5.0F) * 0.07F;
    return {scale * std::cos(angle), -scale * std::sin(angle)};
}

std::vector<Parameter> CacaoOptions::parameters() {
    return {
        {"profile",
         "reference reproduces AMD's shaders, scan corrects them for sensor depth",
         &profile,
         "",
         {},
         {},
         {"scan", "reference"}},
        {"quality",
         "lowest: 3 tap pairs on half the pixels, 0.4 of high's time; low: 3, 0.6; medium: 5, 0.75; high: 12 with "
         "depth mips, 1; "
         "highest: 6 to 31 where the picture asks for them, 1.6, and no closer to ray-traced truth than high on the "
         "generated office",
         &quality,
         "",
         {},
         {},
         {"lowest", "low", "medium", "high", "highest"}},
        {"downsampled", "compute on every second pixel of every second row, then upsample", &downsampled},
        {"radius", "surfaces farther than this do not occlude", &radius, "m", 1e-4, 1e5},
        {"look",
         "how obscurance becomes visibility: as AMD documents it, or nearer to truth (0.294 times the multiplier, 3.33 "
         "times the "
         "power); auto: calibrated in scan",
         &look,
         "",
         {},
         {},
         {"auto", "calibrated", "documented"}},
        {"shadow-multiplier", "strength of the effect, linear", &shadow_multiplier, "", 0, 5},
        {"shadow-power", "strength of the effect, exponent of visibility", &shadow_power, "", 0.5, 5},
        {"shadow-clamp", "darkest obscurance before the exponent", &shadow_clamp, "", 0, 1},
        {"horizon-angle", "samples lower above the surface than this do not occlude", &horizon_angle, "sine", 0, 0.2},
        {"fade-from",
         "depth at which AO starts to fade out; this and the next 0: never in scan, 50 to 300 m in the reference",
         &fade_from, "m", 0, 1e6},
        {"fade-to", "depth at which AO has faded out", &fade_to, "m", 0, 1e6},
        {"adaptive-limit", "highest: mean importance above which extra taps are rationed", &adaptive_limit, "", 0, 1},
        {"blur-passes", "edge-aware blur steps", &blur_passes, "", 0, 8},
        {"sharpness", "how little the blur crosses edges", &sharpness, "", 0, 1},
        {"detail-strength", "strength of the shadows cast by adjacent pixels", &detail_strength, "", 0, 5},
        {"sigma-squared", "upsampler: spatial sigma squared", &sigma_squared, "half-size pixels^2", 1e-3, 1e3},
        {"depth-sigma-squared", "upsampler: depth sigma squared", &depth_sigma_squared, "m^2", 1e-9, 1e6},
        {"depth-input", "what the depth image holds", &depth_input, "", {}, {}, {"metric", "normal_z", "reverse_z"}},
        {"near", "near plane of device depth", &near_m, "m", 1e-6, 1e6},
        {"far", "far plane of device depth", &far_m, "m", 1e-6, 1e9},
        {"normals-mul", "supplied normals are multiplied by this", &normals_mul, "", -1e3, 1e3},
        {"normals-add", "then this is added", &normals_add, "", -1e3, 1e3},
        {"storage",
         "where depth lies between the passes; auto: images on GPUs, buffers on CPUs and for the reference",
         &storage,
         "",
         {},
         {},
         {"auto", "buffers", "images"}},
    };
}

CacaoQuality CacaoOptions::level() const {
    constexpr std::array names{"lowest", "low", "medium", "high", "highest"};
    const auto* const found = std::find(names.begin(), names.end(), quality);
    if (found == names.end())
        throw Misuse("quality '" + quality + "': lowest, low, medium, high or highest expected");
    return static_cast<CacaoQuality>(found - names.begin());
}

CacaoConstants constants_from(const CacaoOptions& options, const Pinhole& camera) {
    CacaoConstants k{};
    const CacaoQuality level = options.level();
    set_sizes(k, options, camera.size);
    set_camera(k, camera);
    k.depth_unpack = depth_unpack(options);
    const float at_zero = k.depth_unpack.y == 0 ? 0.0F : k.depth_unpack.x / k.depth_unpack.y;
    k.outside_depth = options.outside_depth.value_or(options.depth_input == "metric" ? 0.0F : at_zero);

    const float wide = level <= CacaoQuality::low ? 1.5F : 1.0F;
    const float tan_half_height = static_cast<float>(camera.size.height) / (2.0F * static_cast<float>(camera.fy));
    k.radius = std::clamp(options.radius, 0.0F, 100000.0F) * (level == CacaoQuality::lowest ? 0.8F : 1.0F);
    k.neg_rec_radius = -1.0F / k.radius;
    k.near_limit_rec = 1.0F / ((options.radius * 1.2F * wide) / tan_half_height);
    k.mip_weight =
        options.scan() ? -1.0F / (k.radius * k.radius) : k.neg_rec_radius * k.radius; // AMD's slip: always -1
    // Fitted to ray-traced truth (calibrate-look): AMD's curve leaves corners far too dark.
    const bool calibrated = options.look == "calibrated" || (options.look == "auto" && options.scan());
    k.shadow_strength = std::clamp(4.3F * options.shadow_multiplier * (calibrated ? 0.294F : 1.0F), 0.0F, 10.0F);
    k.shadow_power =
        std::clamp(options.shadow_power * (calibrated ? 5.0F / 1.5F : 1.0F), 0.0F, calibrated ? 100.0F : 10.0F);
    k.shadow_clamp = std::clamp(options.shadow_clamp, 0.0F, 1.0F);
    k.horizon = std::clamp(options.horizon_angle, 0.0F, 1.0F);
    const bool documented = options.fade_to == 0 && options.fade_from == 0 && !options.scan();
    const float from = documented ? 50.0F : options.fade_from, to = documented ? 300.0F : options.fade_to;
    k.fade_mul = to > from ? -1.0F / (to - from) : 0.0F;
    k.fade_add = to > from ? from / (to - from) + 1.0F : 1.0F;
    k.all_ones = ~0U;
    k.depth_offset = 0.9992F;
    k.load_counter_div = static_cast<float>(9.0 / (static_cast<double>(texels(k.importance)) * 255.0));
    k.adaptive_limit = options.adaptive_limit;
    k.inv_sharpness = std::clamp(1.0F - options.sharpness, 0.0F, 1.0F);
    k.sigma_spatial = options.sigma_squared;
    k.sigma_depth = options.depth_sigma_squared;
    k.detail_strength = options.detail_strength;
    k.normals_mul = options.normals_mul;
    k.normals_add = options.normals_add;
    for (int odd = 0; odd < 2; ++odd)
        for (int tap = -2; tap <= 2; ++tap) {
            const float d = static_cast<float>(tap) - 0.5F * static_cast<float>(odd);
            k.spatial[5 * odd + tap + 2] = std::exp(-d * d / options.sigma_squared);
        }
    return k;
}

CacaoStorage cacao_storage(const CacaoOptions& options, const gpu::Device& device) {
    const gpu::DeviceInfo& info = device.info();
    const bool finishes = info.most_threads >= shared::cacao_wide * shared::cacao_high; // as one work group
    if (options.storage == "buffers" || !options.scan() || !finishes)
        return CacaoStorage::buffers;
    return options.storage == "images" || !gpu::is_cpu(info) ? CacaoStorage::images : CacaoStorage::buffers;
}

CacaoTables cacao_tables(const CacaoOptions& options, const CacaoConstants& k, bool normals_supplied,
                         CacaoStorage storage) {
    using Host = gpu::BufferRow::Host;
    using shared::spec_scan;
    const CacaoQuality level = options.level();
    const bool scan = options.scan(), highest = level == CacaoQuality::highest;
    const bool two_slices = level == CacaoQuality::lowest, mips = level >= CacaoQuality::high;
    const int layers = two_slices ? 2 : 4;
    const int kernel = level == CacaoQuality::lowest ? 0 : static_cast<int>(level) - 1;
    const int n = options.blur_passes, halo = scan ? 0 : n;
    int resolve = two_slices ? shared::resolve_half : shared::resolve_plain;
    if (level >= (options.downsampled ? CacaoQuality::high : CacaoQuality::medium))
        resolve = shared::resolve_smart;
    const bool power = !scan && (options.downsampled ? !two_slices : resolve == shared::resolve_smart);

    const std::size_t slices = 4 * texels(k.slice);
    const std::size_t haloed = 4 * texels({k.slice.x + 2 * halo, k.slice.y + 2 * halo});
    const bool images = storage == CacaoStorage::images;
    const int fused = images ? std::min(n, most_fused) : 0;
    const auto padded = [](int size) { return 8 * static_cast<std::uint32_t>(groups(size, 8)); };
    const gpu::BufferRow::Image depth_image{padded(k.slice.x), padded(k.slice.y), 4, 4};
    const std::vector<float> rows = pattern();
    CacaoTables tables;
    const auto floats = gpu::BufferRow::Texels::r32f, pairs = gpu::BufferRow::Texels::rg32f,
               words = gpu::BufferRow::Texels::r32ui;
    tables.buffers = {
        {"depth in", texels(k.image) * 4, Host::upload, floats},
        {"normals in", normals_supplied ? texels(k.image) * 12 : 4, normals_supplied ? Host::upload : Host::none,
         floats},
        images ? gpu::BufferRow{"depths", gpu::image_bytes(depth_image), Host::none, {}, {}, depth_image}
               : gpu::BufferRow{"depths", static_cast<std::size_t>(k.depth_pitch) * 16, Host::none, floats},
        {"normals", slices * 4, Host::none, words},
        {"ping", slices * 4, Host::none, words},
        {"pong", slices * 4, Host::none, words},
        {"importance", highest ? texels(k.importance) * 4 : 4, Host::none, words},
        {"importance pong", highest ? texels(k.importance) * 4 : 4, Host::none, words},
        {"load counter", 4, Host::none, words},
        {"blur a", !scan && n > 1 ? haloed * 4 : 4, Host::none, words},
        {"blur b", !scan && n > 2 ? haloed * 4 : 4, Host::none, words},
        {"staged", options.downsampled ? texels(k.grid) * 8 : 8, Host::none, pairs},
        {"pattern", rows.size() * 4, Host::none, gpu::BufferRow::Texels::rgba32f, rows},
        {"visibility", texels(k.image) * 4, Host::download},
    };

    // Texels a work group makes, as its shader declares.
    const auto tile_of = [&](std::string_view shader) -> ivec2 {
        if (!images)
            return {shared::cacao_row, 1};
        if (shader == "cacao/prepare_image")
            return {8, 8};
        if (shader == "cacao/generate_image")
            return {20, 8};
        if (shader == "cacao/blur")
            return {shared::cacao_row, 1};
        if (shader == "cacao/finish")
            return {shared::cacao_wide - 2 * (fused + 1), shared::cacao_high - 2 * (fused + 1)};
        return {shared::cacao_tile, shared::cacao_tile};
    };
    const auto add = [&](std::string name, std::string_view shader, std::vector<int> reads, std::vector<int> writes,
                         ivec2 threads, int depth, std::vector<std::pair<int, int>> extra = {}) {
        const ivec2 tile = tile_of(shader);
        std::vector<std::pair<int, int>> constants{{spec_scan, scan},
                                                   {shared::spec_spacing, options.downsampled ? 2 : 1},
                                                   {shared::spec_kernel, kernel},
                                                   {shared::spec_two_slices, two_slices},
                                                   {shared::spec_device_depth, options.depth_input != "metric"}};
        constants.insert(constants.end(), extra.begin(), extra.end());
        tables.passes.push_back(
            {std::move(name),
             shader,
             std::move(reads),
             std::move(writes),
             {static_cast<std::uint32_t>(groups(threads.x, tile.x)),
              static_cast<std::uint32_t>(groups(threads.y, tile.y)), static_cast<std::uint32_t>(depth)},
             std::move(constants)});
    };

    const int given = normals_supplied ? cacao_normals_in : cacao_depth_in;
    add("prepare", images ? "cacao/prepare_image" : "cacao/prepare", {cacao_depth_in, given},
        images ? std::vector<int>{cacao_depths, cacao_normals, cacao_counter}
               : std::vector<int>{cacao_depths, cacao_normals},
        k.slice, 1, {{shared::spec_normals, normals_supplied}, {shared::spec_mips, mips}});
    if (mips && !images) {
        add("mips", "cacao/mips", {cacao_depth_in}, {cacao_depths}, {0, 0}, 1);
        tables.passes.back().groups = {
            static_cast<std::uint32_t>(groups(4 * groups(k.slice.x, 8) * groups(k.slice.y, 8), 64)), 1, 1};
    }
    const std::string_view generate = images ? "cacao/generate_image" : "cacao/generate";
    // Slots a configuration does not read are filled with a buffer it reads anyway.
    std::vector<int> inputs{cacao_depths, cacao_normals, cacao_normals, cacao_normals, cacao_normals, cacao_pattern};
    if (highest) {
        if (!images)
            tables.passes.push_back({"clear counter", "", {}, {cacao_counter}, {1, 1, 1}, {}});
        add("base", generate, inputs, {cacao_pong}, k.slice, 4, {{shared::spec_base, 1}, {shared::spec_mips, 1}});
        if (images) {
            add("importance", "cacao/importance_smooth", {cacao_pong}, {cacao_importance, cacao_counter}, k.importance,
                1);
        } else {
            add("importance", "cacao/importance", {cacao_pong}, {cacao_importance}, k.importance, 1);
            add("importance blur a", "cacao/importance_blur", {cacao_importance, cacao_pong},
                {cacao_importance_pong, cacao_counter}, k.importance, 1);
            add("importance blur b", "cacao/importance_blur", {cacao_importance_pong, cacao_pong},
                {cacao_importance, cacao_counter}, {k.importance.x, 8 * groups(k.importance.y, 8)}, 1,
                {{shared::spec_last, 1}}); // beyond the map, too: see counts()
        }
        inputs = {cacao_depths, cacao_normals, cacao_pong, cacao_importance, cacao_counter, cacao_pattern};
    }
    add("generate", generate, inputs, {cacao_ping}, k.slice, layers, {{shared::spec_mips, mips}});

    int from = cacao_ping;
    for (int i = 0; i < n - fused; ++i) {
        const bool first = i == 0, last = i == n - 1;
        int to = from == cacao_ping ? cacao_pong : cacao_ping;
        if (!scan)
            to = last ? cacao_pong : (i % 2 == 0 ? cacao_blur_a : cacao_blur_b);
        add(fmt::format("blur {}", i + 1), "cacao/blur", {from}, {to}, {k.slice.x + 2 * halo, k.slice.y + 2 * halo},
            layers, {{shared::spec_first, first}, {shared::spec_last, last}, {shared::spec_halo, halo}});
        from = to;
    }
    tables.blurred = from;

    const std::vector<std::pair<int, int>> how{{shared::spec_resolve, resolve}, {shared::spec_power, power}};
    if (images) {
        add("finish", "cacao/finish", {from, cacao_depth_in}, {cacao_out, cacao_staged}, k.slice, 1,
            {{shared::spec_steps, fused}});
        if (options.downsampled)
            add("upsample", "cacao/upsample_shared", {cacao_staged, cacao_depth_in}, {cacao_out},
                {halved(k.image.x), halved(k.image.y)}, 1, how);
    } else if (!options.downsampled) {
        add("apply", "cacao/apply", {from, cacao_depth_in}, {cacao_out}, k.slice, 1, how);
    } else {
        add("stage", "cacao/stage", {from, cacao_depths}, {cacao_staged}, {halved(k.grid.x), halved(k.grid.y)}, 1, how);
        add("upsample", "cacao/upsample", {cacao_staged, cacao_depth_in}, {cacao_out},
            {halved(k.image.x), halved(k.image.y)}, 1, how);
    }
    return tables;
}

Cacao::Cacao(gpu::Device& device, CacaoOptions options) : device_(device), options_(std::move(options)) {
    for (const Parameter& row : options_.parameters())
        check(row);
    if (options_.fade_to <= options_.fade_from && options_.fade_to > 0)
        throw Misuse("fade-to must lie beyond fade-from");
    if (options_.near_m == options_.far_m)
        throw Misuse("near and far must differ");
}

void Cacao::prepare(const View& view) {
    const Pinhole& camera = view.depth.camera;
    const bool supplied = view.normals || view.prepared;
    if (program_ && supplied == normals_supplied_ && camera.size == camera_.size) {
        if (std::memcmp(&camera, &camera_, sizeof camera) == 0)
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
    const cv::Mat1f& z = view.depth.z_m;
    if (z.empty() || z.size() != view.depth.camera.size)
        throw Error(fmt::format("depth image of {}x{} with a camera of {}x{}", z.cols, z.rows,
                                view.depth.camera.size.width, view.depth.camera.size.height));
    if (view.normals && view.normals->normals.size() != z.size())
        throw Error("normals and depth differ in size");
    prepare(view);
    const auto start = std::chrono::steady_clock::now();
    if (view.prepared) {
        program_->take(cacao_depth_in, 0, view.prepared->z_m);
        program_->take(cacao_normals_in, 0, view.prepared->normals);
    } else if (options_.scan() && options_.depth_input == "metric") {
        gpu::upload_depth(z, program_->host_as<float>(cacao_depth_in));
    } else {
        gpu::upload(z, program_->host(cacao_depth_in));
    }
    if (view.normals && !view.prepared)
        gpu::upload(view.normals->normals, program_->host(cacao_normals_in));
    const auto uploaded = std::chrono::steady_clock::now();
    program_->run(std::as_bytes(std::span(&constants_, 1)));
    const auto ran = std::chrono::steady_clock::now();
    AoMap ao{gpu::downloaded(program_->host_as<float>(cacao_out), z.size())};
    const auto done = std::chrono::steady_clock::now();
    const auto ms = [](auto from, auto to) { return std::chrono::duration<double, std::milli>(to - from).count(); };
    timings_.assign({{"host upload", ms(start, uploaded)}});
    timings_.insert(timings_.end(), program_->timings().begin(), program_->timings().end());
    timings_.emplace_back("host download", ms(ran, done));
    return ao;
}

/// The four slices of one mip, without the padding of their buffer.
Intermediate Cacao::depth_slices(int mip) {
    const CacaoConstants& k = constants_;
    const int width = std::max(1, k.slice.x >> mip), height = std::max(1, k.slice.y >> mip);
    Intermediate slices{fmt::format("depth_mip{}", mip),
                        "f4",
                        {4, height, width},
                        {},
                        "metres, 0 = hole; slice 2 (y mod 2) + (x mod 2)"};
    const auto bytes = program_->read_back(cacao_depths);
    const gpu::BufferRow::Image& image = tables_.buffers[cacao_depths].image;
    int before = 0; // texels of the mips before this one
    for (int m = 0; m < mip; ++m)
        before += 4 * static_cast<int>((image.width >> m) * (image.height >> m));
    const int wide = static_cast<int>(image.width) >> mip, high = static_cast<int>(image.height) >> mip;
    for (int a = 0; a < 4; ++a)
        for (int y = 0; y < height; ++y) {
            const int in_buffer =
                a * k.depth_pitch + k.depth_end - (k.depth_mips >> (2 * mip)) + y * (k.depth_stride >> mip);
            const int first = wide > 0 ? before + (a * high + y) * wide : in_buffer;
            slices.data.insert(slices.data.end(), bytes.begin() + 4L * first, bytes.begin() + 4L * (first + width));
        }
    return slices;
}

/// HIGHEST: how many pairs of taps each texel of the importance map asks for, as cacao/generate counts them.
Intermediate Cacao::tap_pairs(const Intermediate& importance, const Intermediate& load_counter) const {
    const auto word = [](const Intermediate& from, std::size_t i) {
        std::uint32_t value = 0;
        std::memcpy(&value, from.data.data() + 4 * i, 4);
        return static_cast<float>(value);
    };
    const float average = word(load_counter, 0) * constants_.load_counter_div;
    const float ration = std::clamp(constants_.adaptive_limit / average, 0.0F, 1.0F);
    Intermediate pairs{"tap_pairs", "u4", importance.shape, std::vector<std::byte>(importance.data.size()),
                       "pairs of taps, those of the base pass included"};
    for (std::size_t i = 0; i < pairs.data.size() / 4; ++i) {
        const float wanted = word(importance, i) / 255.0F * ration;
        const std::uint32_t count = std::min(31U, static_cast<std::uint32_t>(27.0F * wanted + 1.5F) + 5U);
        std::memcpy(pairs.data.data() + 4 * i, &count, 4);
    }
    return pairs;
}

std::vector<Intermediate> Cacao::intermediates() {
    std::vector<Intermediate> all;
    if (!program_)
        return all;
    const CacaoQuality level = options_.level();
    const auto words = [&](int buffer, std::size_t count) {
        auto bytes = program_->read_back(buffer);
        bytes.resize(count * 4);
        return bytes;
    };
    const auto add = [&](std::string name, std::vector<int> shape, int buffer, std::string meaning) {
        std::size_t count = 1;
        for (int n : shape)
            count *= static_cast<std::size_t>(n);
        all.push_back({std::move(name), "u4", std::move(shape), words(buffer, count), std::move(meaning)});
    };
    const CacaoConstants& k = constants_;
    for (int m = 0; m < (level >= CacaoQuality::high ? 4 : 1); ++m)
        all.push_back(depth_slices(m));
    const std::vector<int> slices{4, k.slice.y, k.slice.x};
    const bool scan = options_.scan();
    const std::string texel =
        scan ? "visibility / 65535 in bits 0-15, edges to left, right, above, below / 3 in bits 22, 20, 18, 16, filled "
               "hole in bit 30, hole in bit 31"
             : "visibility / 255 in bits 0-7, edges to left, right, above, below / 3 in bits 22, 20, 18, 16";
    add("normals", slices, cacao_normals,
        scan ? "x right, y up, z forward, each (n - 512) / 511 in 10 bits from bit 0"
             : "each n / 127 in 8 signed bits from bit 0");
    if (level == CacaoQuality::highest) {
        add("importance", {k.importance.y, k.importance.x}, cacao_importance, "255ths");
        add("load_counter", {1}, cacao_counter, "sum of every ninth importance");
        all.push_back(tap_pairs(all[all.size() - 2], all.back()));
    }
    add("ao", slices, cacao_ping, texel);
    const bool fused = tables_.buffers[cacao_depths].image.width > 0; // then the last blur steps end in shared memory
    if (options_.blur_passes > 0 && !fused)
        add("ao_blurred", slices, tables_.blurred, texel);
    return all;
}

} // namespace scanshade
