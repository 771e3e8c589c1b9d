#include "ao/finish/finish.h"

#include "ao/gpu/transfer.h"
#include "projection/attach.h"
#include "projection/base/error.h"
#include "projection/sensor/expected_error.h"
#include "projection/srgb.h"
#include "shaders/shared/finish.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <fmt/format.h>
#include <limits>

namespace scanshade {
namespace {

enum Buffers : int {
    seen,       // z; far behind the camera where there is no visibility
    surface,    // of clay: 1/z, or z of plane fits; 0 in holes
    visibility, // pack and expected errors read it
    colour,     // these pack alone reads
    colour_known,
    linear_light,
    stored_light,
    error_of_each,
    across, // 1/z smoothed along rows, and
    smooth, // along columns, too
    cosine,
    map_out,
    confidence_out,
    picture_out,
    normals, // of plane fits
    direct,  // over ambient light
    unshaded_out,
    ambient_out,
    direct_out,
    gathered, // light from neighbours: sums of colours, and of weights
    bounced,  // their mean times what is closed
    indirect_out,
    linear_colour, // 0 .. 1, in place of `colour` where floats are made
    linear_unshaded,
    linear_ambient,
    linear_direct,
    linear_indirect
};

std::size_t words_of(cv::Size size) { return (static_cast<std::size_t>(size.area()) + 3) / 4; }

std::vector<float> as_floats(std::span<const unsigned char> bytes) {
    std::vector<float> words(bytes.size());
    std::ranges::transform(bytes, words.begin(), [](unsigned char byte) {
        return std::bit_cast<float>(static_cast<std::uint32_t>(byte)); // buffers begin with floats
    });
    return words;
}

void check_sizes(const FinishInput& input) {
    const cv::Size size = input.z_m.size();
    const auto differs = [&](const cv::Mat& image, bool may_be_empty) {
        return image.size() != size && !(may_be_empty && image.empty());
    };
    if (size.empty() || differs(input.visibility, false) || differs(input.colour, true) ||
        differs(input.deep_colour, true) || differs(input.colour_known, true) || differs(input.fitted_m, true) ||
        differs(input.fitted_normals_host, true))
        throw Error(fmt::format("depth is {}x{}, visibility {}x{}, colour {}x{}: nothing says which pixel belongs to "
                                "which",
                                size.width, size.height, input.visibility.cols, input.visibility.rows,
                                input.colour.cols, input.colour.rows));
}

/// A copy: the next frame overwrites the program's.
template <class Pixel>
cv::Mat_<Pixel> copied(gpu::Program& program, int buffer, cv::Size size) {
    return gpu::image_on<Pixel>(program.host(buffer), size).clone();
}

/// One pass over two images; rows are plain loops, which become vector instructions.
template <class Formula>
void combine(const cv::Mat1f& a, const cv::Mat1f& b, cv::Mat1f to, Formula&& formula) {
    for (int y = 0; y < to.rows; ++y) {
        const float *left = a[y], *right = b[y];
        float* result = to[y];
        for (int x = 0; x < to.cols; ++x)
            result[x] = formula(left[x], right[x]);
    }
}

/// Linear light, 0 .. 1, of each stored value.
template <class Integer>
const std::vector<float>& light_of_stored() {
    static const std::vector<float> light = [] {
        std::vector<float> all(std::size_t(std::numeric_limits<Integer>::max()) + 1);
        for (std::size_t i = 0; i < all.size(); ++i)
            all[i] = static_cast<float>(linear_from_srgb(static_cast<double>(i) / static_cast<double>(all.size() - 1)));
        return all;
    }();
    return light;
}

template <class Integer>
void linearise(const cv::Mat_<cv::Vec<Integer, 3>>& stored, cv::Mat3f to) {
    const std::vector<float>& light = light_of_stored<Integer>();
    for (int y = 0; y < to.rows; ++y)
        for (int x = 0; x < to.cols; ++x)
            for (int c = 0; c < 3; ++c)
                to(y, x)[c] = light[stored(y, x)[c]];
}

void upload_linear(const FinishInput& input, const cv::Mat3f& to) {
    if (input.deep_colour.empty())
        linearise<uchar>(input.colour, to);
    else
        linearise<ushort>(input.deep_colour, to);
}

bool shows_clay(int picture) { return picture == shared::picture_clay || picture == shared::picture_both; }
bool shows_colour(int picture) { return picture == shared::picture_colour || picture == shared::picture_both; }

} // namespace

bool Finish::Shape::clay() const { return shows_clay(picture); }
bool Finish::Shape::colours() const { return on_device && (shows_colour(picture) || (light() && !linear())); }
bool Finish::Shape::packed() const {
    return on_device && (outputs.map_bits > 0 || outputs.confidence_bits > 0 || outputs.pictures());
}

Finish::Finish(gpu::Device& device)
    : device_(device), packing_(gpu::is_cpu(device.info()) ? Packing::on_host : Packing::on_device) {}

Finish::Shape Finish::shape_of(const FinishInput& input, const FinishOutputs& outputs) const {
    Shape shape{input.z_m.size(), outputs, shared::picture_none};
    const bool colour = !input.colour.empty();
    if (outputs.picture)
        shape.picture = !colour || input.shade == Shade::clay ? shared::picture_clay
                        : input.colour_known.empty()          ? shared::picture_colour
                                                              : shared::picture_both;
    shape.outputs.unshaded = outputs.unshaded && colour;
    shape.outputs.split = outputs.split && colour;
    shape.outputs.indirect = outputs.indirect && colour;
    shape.known = !input.colour_known.empty() && (shape.picture == shared::picture_both || shape.outputs.indirect);
    const bool shades_ambient = input.shade == Shade::ambient && shows_colour(shape.picture);
    const bool by_light = shades_ambient || (shape.outputs.unshaded && input.shade == Shade::ambient);
    const shared::vec3 from = input.light ? input.light->direct : shared::vec3();
    shape.ambient_alone = by_light && shared::dotted(from, from) > 0;
    shape.direct = (by_light || shape.outputs.split) && shared::dotted(from, from) > 0;
    shape.fitted = shape.looks_at_surface() && input.fitted;
    shape.smoothed = shape.looks_at_surface() && !input.fitted && input.fitted_m.empty();
    shape.normals = shape.looks_at_surface() && (input.fitted_normals || !input.fitted_normals_host.empty());
    shape.on_device = packing_ == Packing::on_device || shape.direct || shape.light();
    if (!shape.on_device) {
        shape.outputs.error = shape.error();
        shape.outputs.confidence_bits = shape.outputs.map_bits = 0;
    }
    return shape;
}

/// In the order of the names of buffers. What these outputs do not need has one texel.
std::vector<gpu::BufferRow> Finish::buffers_of(const Shape& shape) {
    using Host = gpu::BufferRow::Host;
    constexpr auto floats = gpu::BufferRow::Texels::r32f, words = gpu::BufferRow::Texels::r32ui;
    const auto pixels = static_cast<std::size_t>(shape.size.area()), packs = words_of(shape.size);
    const FinishOutputs& outputs = shape.outputs;
    const bool on_device = shape.on_device, colours = shape.colours(), linear = shape.linear();
    const auto image = [&](std::string_view name, bool needed, Host host = Host::none) {
        return gpu::BufferRow{.name = name,
                              .bytes = needed ? pixels * 4 : 4,
                              .host = needed ? host : Host::none,
                              .texels = floats,
                              .plain_writes = true};
    };
    const auto bytes = [&](std::string_view name, int words_a_pack, Host host) {
        return gpu::BufferRow{.name = name,
                              .bytes = words_a_pack > 0 ? packs * static_cast<std::size_t>(words_a_pack) * 4 : 4,
                              .host = words_a_pack > 0 ? host : Host::none,
                              .texels = words,
                              .plain_writes = true};
    };
    const auto three_floats = [&](std::string_view name, bool needed, Host host) {
        return gpu::BufferRow{.name = name,
                              .bytes = needed ? pixels * 12 : 4,
                              .host = needed ? host : Host::none,
                              .texels = floats,
                              .plain_writes = true};
    };
    const SrgbTables& light = srgb_tables();
    return {
        image("seen", true, Host::upload),
        image("surface", shape.looks_at_surface(), Host::upload),
        image("visibility", shape.packed() || shape.error(), Host::upload),
        bytes("colour", colours ? 3 : 0, Host::upload),
        bytes("colour known", colours && shape.known ? 1 : 0, Host::upload),
        {"linear light", light.linear.size() * 4, Host::none, floats, {light.linear.begin(), light.linear.end()}},
        {"stored light", light.stored.size() * 4, Host::none, words, as_floats(light.stored)},
        image("expected error", shape.error(), outputs.error ? Host::download : Host::none),
        image("across", shape.smoothed),
        image("smooth", shape.smoothed),
        image("cosine", shape.clay(), on_device ? Host::none : Host::download),
        bytes("map", on_device ? outputs.map_bits / 8 : 0, Host::download),
        bytes("confidence map", on_device && outputs.confidence_bits > 0 ? 1 : 0, Host::download),
        bytes("picture", on_device && outputs.picture ? 3 : 0, Host::download),
        three_floats("normals", shape.normals, Host::upload),
        image("direct light", shape.direct),
        bytes("unshaded", outputs.unshaded && !linear ? 3 : 0, Host::download),
        bytes("ambient part", outputs.split && !linear ? 3 : 0, Host::download),
        bytes("direct part", outputs.split && !linear ? 3 : 0, Host::download),
        {.name = "gathered light", .bytes = outputs.indirect ? pixels * 32 : 4, .texels = floats, .plain_writes = true},
        three_floats("indirect light", outputs.indirect, Host::none),
        bytes("indirect", outputs.indirect && !linear ? 3 : 0, Host::download),
        three_floats("linear colour", linear, Host::upload),
        three_floats("linear unshaded", linear && outputs.unshaded, Host::download),
        three_floats("linear ambient part", linear && outputs.split, Host::download),
        three_floats("linear direct part", linear && outputs.split, Host::download),
        three_floats("linear indirect", linear && outputs.indirect, Host::download),
    };
}

std::vector<gpu::PassRow> Finish::passes_of(const Shape& shape) {
    const FinishOutputs& outputs = shape.outputs;
    const bool colours = shape.colours(), clay = shape.clay(), linear = shape.linear();
    const auto groups_of = [](std::size_t n) {
        return static_cast<std::uint32_t>((n + shared::finish_row - 1) / shared::finish_row);
    };
    const std::array<std::uint32_t, 3> rows{groups_of(static_cast<std::size_t>(shape.size.width)),
                                            static_cast<std::uint32_t>(shape.size.height), 1};
    std::vector<gpu::PassRow> passes;
    if (shape.error())
        passes.push_back({"expected error", "finish/expected_error", {seen, visibility}, {error_of_each}, rows, {}});
    if (shape.smoothed) {
        passes.push_back({"smooth across", "finish/smooth", {surface}, {across}, rows, {{shared::spec_down, 0}}});
        passes.push_back({"smooth down", "finish/smooth", {across}, {smooth}, rows, {{shared::spec_down, 1}}});
    }
    const int shown = shape.smoothed ? smooth : surface;
    const std::vector<std::pair<int, int>> of_surface{{shared::spec_is_depth, shape.fitted},
                                                      {shared::spec_normals, shape.normals}};
    const int fitted_normals = shape.normals ? normals : shown; // unread without
    if (clay)
        passes.push_back({"clay", "finish/facing", {shown, fitted_normals}, {cosine}, rows, of_surface});
    if (shape.direct)
        passes.push_back({"light", "finish/light", {shown, fitted_normals, visibility}, {direct}, rows, of_surface});
    if (outputs.indirect) {
        passes.push_back(
            {"bounce",
             "finish/bounce",
             {shown, fitted_normals, linear ? stored_light : colour, shape.known ? colour_known : stored_light,
              linear_light, linear ? linear_colour : linear_light},
             {gathered},
             rows,
             {{shared::spec_is_depth, shape.fitted},
              {shared::spec_normals, shape.normals},
              {shared::spec_known, shape.known},
              {shared::spec_linear, linear}}});
        passes.push_back({"bounce's mean",
                          "finish/bounce_mean",
                          {shown, visibility, gathered},
                          {bounced},
                          rows,
                          {{shared::spec_is_depth, shape.fitted}}});
    }
    if (linear)
        passes.push_back({"linear light",
                          "finish/linear",
                          {visibility, shape.error() ? error_of_each : visibility, linear_colour,
                           shape.direct ? direct : visibility, outputs.indirect ? bounced : visibility},
                          {linear_unshaded, linear_ambient, linear_direct, linear_indirect},
                          rows,
                          {{shared::spec_light, shape.direct},
                           {shared::spec_ambient, shape.ambient_alone},
                           {shared::spec_unshaded, outputs.unshaded},
                           {shared::spec_split, outputs.split},
                           {shared::spec_indirect, outputs.indirect},
                           {shared::spec_unbounded, outputs.light_values == LightValues::unbounded}}});
    constexpr std::uint32_t most_groups = 1 << 15;
    const std::uint32_t groups = groups_of(words_of(shape.size));
    if (shape.packed())
        passes.push_back({"pack",
                          "finish/pack",
                          {visibility, shape.error() ? error_of_each : visibility, clay ? surface : visibility,
                           clay ? cosine : visibility, colours ? colour : stored_light,
                           shape.known ? colour_known : stored_light, linear_light, stored_light,
                           shape.direct ? direct : visibility, outputs.indirect && !linear ? bounced : visibility},
                          {map_out, confidence_out, picture_out, unshaded_out, ambient_out, direct_out, indirect_out},
                          {std::min(groups, most_groups), (groups + most_groups - 1) / most_groups, 1},
                          {{shared::spec_map_bits, outputs.map_bits},
                           {shared::spec_confidence_bits, outputs.confidence_bits},
                           {shared::spec_picture, shape.picture},
                           {shared::spec_light, shape.direct},
                           {shared::spec_ambient, shape.ambient_alone},
                           {shared::spec_unshaded, outputs.unshaded && !linear},
                           {shared::spec_split, outputs.split && !linear},
                           {shared::spec_indirect, outputs.indirect && !linear}}});
    return passes;
}

gpu::Program& Finish::program_for(const Shape& shape) {
    constexpr std::size_t most_kept = 3; // a frame has two at most: its errors in the view, its picture as recorded
    const auto known = std::ranges::find(programs_, shape, &decltype(programs_)::value_type::first);
    if (known != programs_.end())
        return *known->second;
    if (programs_.size() == most_kept)
        programs_.erase(programs_.begin());
    auto program =
        std::make_unique<gpu::Program>(device_, buffers_of(shape), passes_of(shape), sizeof(shared::FinishConstants));
    return *programs_.emplace_back(shape, std::move(program)).second;
}

void Finish::upload(gpu::Program& program, const Shape& shape, const FinishInput& input) {
    const auto image_of = [&](int buffer) { return gpu::image_on<float>(program.host(buffer), shape.size); };
    const auto is_depth = [](float z) { return z >= 1e-4F && z <= 1e6F; }; // as gpu::upload_depth() has it
    if (shape.error())
        combine(input.z_m, input.visibility, image_of(seen),
                [&](float z, float value) { return value == value && is_depth(z) ? z : -1e30F; });
    if (shape.normals && input.fitted_normals)
        program.take(normals, 0, input.fitted_normals);
    else if (shape.normals)
        std::memcpy(program.host(normals).data(), input.fitted_normals_host.data, input.z_m.total() * 12);
    if (shape.fitted)
        program.take(surface, 0, input.fitted);
    else if (shape.looks_at_surface()) {
        const cv::Mat1f& z_m = input.fitted_m.empty() ? input.z_m : input.fitted_m;
        combine(z_m, z_m, image_of(surface), [&](float z, float) { return is_depth(z) ? 1 / z : 0.0F; });
    }
}

Finished Finish::compute(const FinishInput& input, const FinishOutputs& outputs) {
    timings_.clear();
    if (!outputs.any())
        return {};
    check_sizes(input);
    if (!outputs.pictures() && !outputs.error && outputs.confidence_bits == 0)
        return {}; // a map alone would cost more to send than to pack
    const Shape shape = shape_of(input, outputs);
    const cv::Size size = shape.size;
    const bool on_device = shape.on_device;
    if (!on_device && !shape.error() && !shape.clay())
        return {.picture = outputs.picture ? picture_on_host(input, {}) : cv::Mat3b()};
    gpu::Program& program = program_for(shape);

    shared::FinishConstants k{};
    k.size = {size.width, size.height};
    k.camera = input.camera.on_gpu();
    k.radius = static_cast<float>(input.radius_m);
    k.noise_floor = static_cast<float>(input.noise.floor_m);
    k.noise_per_z2 = static_cast<float>(input.noise.per_z2);
    k.strength = static_cast<float>(input.strength);
    k.light = input.light.value_or(shared::LightConstants{});
    k.errors = input.errors;
    k.words = static_cast<int>(words_of(size));
    std::ranges::transform(seeds_of_ball(), k.seeds,
                           [](const cv::Point2f& seed) { return shared::vec2(seed.x, seed.y); });

    upload(program, shape, input);
    if (shape.error() || shape.packed())
        gpu::upload(input.visibility, program.host(visibility));
    if (shape.colours())
        gpu::upload(input.colour, program.host(colour));
    if (shape.linear())
        upload_linear(input, gpu::image_on<cv::Vec3f>(program.host(linear_colour), size));
    if (on_device && shape.known)
        gpu::upload(input.colour_known, program.host(colour_known));
    program.run(std::as_bytes(std::span(&k, 1)));
    timings_ = program.timings();

    Finished finished;
    if (shape.outputs.error)
        finished.error = copied<float>(program, error_of_each, size);
    if (!on_device) {
        if (outputs.picture)
            finished.picture =
                picture_on_host(input, shape.clay() ? clay_of(gpu::image_on<float>(program.host(cosine), size),
                                                              gpu::image_on<float>(program.host(surface), size))
                                                    : cv::Mat3b());
        return finished;
    }
    if (outputs.confidence_bits > 0)
        finished.confidence_map = copied<uchar>(program, confidence_out, size);
    if (outputs.map_bits == 16)
        finished.map = copied<ushort>(program, map_out, size);
    if (outputs.map_bits == 8)
        finished.map = copied<uchar>(program, map_out, size);
    if (outputs.picture)
        finished.picture = copied<cv::Vec3b>(program, picture_out, size);
    if (shape.linear()) {
        const auto taken = [&](bool made, int buffer) {
            return made ? copied<cv::Vec3f>(program, buffer, size) : cv::Mat3f();
        };
        finished.linear = {taken(shape.outputs.unshaded, linear_unshaded), taken(shape.outputs.split, linear_ambient),
                           taken(shape.outputs.split, linear_direct), taken(shape.outputs.indirect, linear_indirect)};
        return finished;
    }
    if (shape.outputs.unshaded)
        finished.unshaded = copied<cv::Vec3b>(program, unshaded_out, size);
    if (shape.outputs.split) {
        finished.ambient = copied<cv::Vec3b>(program, ambient_out, size);
        finished.direct = copied<cv::Vec3b>(program, direct_out, size);
    }
    if (shape.outputs.indirect)
        finished.indirect = copied<cv::Vec3b>(program, indirect_out, size);
    return finished;
}

Finished Finishers::compute(const FinishInput& input, const FinishOutputs& outputs, Timings& timings) {
    std::unique_ptr<Finish> finish;
    {
        const std::lock_guard alone(access_);
        if (!idle_.empty()) {
            finish = std::move(idle_.back());
            idle_.pop_back();
        }
    }
    if (!finish)
        finish = std::make_unique<Finish>(device_);
    Finished finished = finish->compute(input, outputs);
    for (const auto& [pass, took_ms] : finish->timings())
        timings.emplace_back(pass == "upload" || pass == "download" ? "finish: " + pass : pass, took_ms);
    const std::lock_guard alone(access_);
    idle_.push_back(std::move(finish));
    return finished;
}

cv::Mat3b picture_on_host(const FinishInput& input, const cv::Mat3b& clay) {
    // Clay has no colours to keep where there is no surface, so both kinds go through the same multiplication.
    cv::Mat3b base = clay.empty() ? input.colour : clay.clone();
    if (!clay.empty() && !input.colour.empty() && input.shade != Shade::clay)
        input.colour.copyTo(base, input.colour_known);
    return shade(base, input.visibility, input.strength);
}

cv::Mat3b clay_of(const cv::Mat1f& cosine, const cv::Mat1f& surface) {
    const cv::Vec3b none(shared::no_surface_blue, shared::no_surface_green, shared::no_surface_red);
    cv::Mat3b picture(cosine.size());
    std::transform(cosine.begin(), cosine.end(), surface.begin(), picture.begin(), [&](float c, float at) {
        return at > 0 ? cv::Vec3b::all(cv::saturate_cast<uchar>(shared::clay_edge_on + shared::clay_facing * c)) : none;
    });
    return picture;
}

} // namespace scanshade
