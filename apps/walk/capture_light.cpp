#include "apps/walk/capture_light.h"

#include "apps/frame/first_look.h"
#include "apps/frame/frame_images.h"
#include "apps/frame/frame_steps.h"
#include "apps/json.h"
#include "io/text.h"
#include "projection/attach.h"
#include "projection/base/error.h"
#include "projection/base/spread.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace scanshade {
namespace {

/// Normals on recorded pixels; without distortion these are the view's.
NormalImage recorded_normals(const Work& work, const NormalImage& in_view) {
    if (!work.frame.camera.distortion.any())
        return in_view;
    NormalImage recorded{cv::Mat3f(in_view.normals.size())};
    std::vector<cv::Mat> channels, bent;
    cv::split(in_view.normals, channels);
    for (const cv::Mat& channel : channels)
        bent.push_back(attach(work.frame, work.depth, {channel}).visibility);
    cv::merge(bent, recorded.normals);
    return recorded;
}

/// Whether the frame told anything of light.
bool add_frame(LightSamples& samples, const Capture& capture, std::size_t index, FrameAo& method,
               const BatchOptions& options) {
    FrameRow row;
    Work work{.entry = capture.entries[index], .row = row};
    work.frame = capture.load(index, true);
    if (options.registration)
        work.frame.registration = *options.registration;
    if (work.frame.cloud && !work.frame.cloud->organised())
        return false;
    prepare_view(work, options.range);
    compute_view(work, method, options.noise, capture);
    work.attached = attach(work.frame, work.depth, work.ao);
    const Scene scene = scene_of(work, false);
    if (scene.colour.empty() || scene.colour.size() != work.depth.z_m.size())
        return false;
    const NormalImage normals = recorded_normals(work, method.normals(work.depth, options.noise));
    const DepthImage depth{scene.camera, scene.z_m, {}};
    samples.add({.depth = depth,
                 .normals = normals,
                 .visibility = scene.visibility,
                 .colour = scene.colour,
                 .colour_known = scene.colour_known,
                 .world_from_camera = work.frame.world_from_camera.value_or(Eigen::Isometry3d::Identity())});
    return true;
}

json array_of(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

Eigen::Vector3d vector_of(const json& j) {
    return {j.at(0).get<double>(), j.at(1).get<double>(), j.at(2).get<double>()};
}

} // namespace

LightEstimate light_of(const Capture& capture, const std::vector<std::size_t>& frames, FrameAo& method,
                       const BatchOptions& options, const LightRequest& request) {
    std::vector<std::size_t> chosen;
    for (const std::size_t i : spread(light_frames, frames.size()))
        chosen.push_back(frames[i]);
    const bool posed =
        std::ranges::all_of(chosen, [&](std::size_t i) { return capture.entries[i].world_from_camera.has_value(); });
    LightSamples samples(posed);
    std::string why;
    for (const std::size_t index : chosen)
        try {
            if (!add_frame(samples, capture, index, method, options) && why.empty())
                why = "no colour image, or none whose pixels are known to lie on the depth's";
        } catch (const Outage&) { // a light from fewer frames would change all pictures
            throw;
        } catch (const Error& failure) { // processing the frame reports the error
            why = failure.what();
        }
    if (samples.frames() == 0)
        throw NoLight(
            fmt::format("{}: its light cannot be estimated: none of the {} frames tried has colour and depth "
                        "that fit ({}); --shade multiply shows clay where there is no colour, --registered yes "
                        "says that colour pixels lie on depth pixels",
                        capture.path.string(), chosen.size(), why));
    samples.group();
    return estimate_light(samples, request);
}

std::string text_of(const LightEstimate& estimate, const std::string& task) {
    const Light& light = estimate.light;
    json models = json::array();
    for (const LightModel& model : estimate.models)
        models.push_back({{"name", model.name}, {"held_out_error", model.held_out}});
    const json all{{"task", task},
                   {"sentence", estimate.sentence},
                   {"chosen", estimate.chosen},
                   {"space", light.in_world ? "world" : "camera"},
                   {"direct", array_of(light.direct)},
                   {"tint", array_of(light.tint)},
                   {"ambient_gradient", array_of(light.gradient)},
                   {"visibility_power", light.power},
                   {"shadows", light.shadows},
                   {"doubt", light.doubt},
                   {"spread_degrees", estimate.spread_deg},
                   {"samples", estimate.samples},
                   {"frames", estimate.frames},
                   {"albedos", estimate.albedos},
                   {"models", models}};
    return text_of(all) + "\n";
}

std::optional<LightEstimate> light_in(const std::filesystem::path& file, const std::string& task) {
    if (!std::filesystem::exists(file))
        return std::nullopt;
    try {
        const json all = parsed_json(read_bytes(file));
        if (all.at("task") != task)
            return std::nullopt;
        LightEstimate found;
        found.sentence = all.at("sentence");
        found.chosen = all.at("chosen");
        found.light = {vector_of(all.at("direct")),
                       vector_of(all.at("tint")),
                       vector_of(all.at("ambient_gradient")),
                       all.at("visibility_power"),
                       all.at("shadows"),
                       all.at("space") == "world",
                       all.at("doubt")};
        return found;
    } catch (const json::exception&) { // torn or foreign: it is made again
        return std::nullopt;
    }
}

LightRequest light_request(const std::string& text) {
    if (text == "auto")
        return {};
    if (text == "none")
        return {.direct = false};
    Eigen::Vector3d l = Eigen::Vector3d::Zero();
    int used = 0;
    if (std::sscanf(text.c_str(), "%lf,%lf,%lf%n", &l.x(), &l.y(), &l.z(), &used) != 3 ||
        used != static_cast<int>(text.size()) || !l.allFinite() || !(l.norm() > 1e-9))
        throw Misuse("light: '" + text + "' given, expected auto, none, or X,Y,Z towards the light, such as 0,0,1");
    return {.direct = true, .towards = l.normalized()};
}

} // namespace scanshade
