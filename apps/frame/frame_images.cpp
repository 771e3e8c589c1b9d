// After a frame is computed: values on the recorded pixels or points, confidence, maps and pictures.
#include "apps/frame/frame_images.h"

#include "apps/picture.h"
#include "projection/colour_view.h"
#include "projection/sensor/expected_error.h"

#include <algorithm>
#include <fmt/format.h>

namespace scanshade {
namespace {

/// Colour warped into the depth view, or everything else into the colour view.
Scene scene_across_cameras(const Work& work, bool colour_view) {
    const Frame& frame = work.frame;
    const SurfaceInColour surface = surface_in_colour(frame.depth_m, frame.camera, *frame.colour_camera);
    if (colour_view) {
        const auto in_colour = [&](const cv::Mat1f& values) {
            return values.empty() ? cv::Mat1f() : on_colour_pixels(values, surface);
        };
        return {surface.z_m,
                on_colour_pixels(work.attached.visibility, surface),
                frame.colour,
                frame.colour_camera->camera.pinhole,
                {},
                in_colour(work.confidence.visibility),
                in_colour(work.error.visibility),
                frame.deep_colour};
    }
    const auto [colour, known, deep] =
        colour_on_depth(frame.colour, frame.depth_m, frame.camera, *frame.colour_camera, surface, frame.deep_colour);
    return {frame.depth_m, work.attached.visibility, colour, frame.camera.pinhole, known, {}, {}, deep};
}

cv::Mat3b colour_in_view(const Cloud& cloud, const DepthImage& depth) {
    if (!has_colours(cloud))
        return {};
    cv::Mat3b colour(depth.z_m.size(), cv::Vec3b(64, 40, 28));
    std::transform(depth.source.begin(), depth.source.end(), colour.begin(), colour.begin(),
                   [&](int point, const cv::Vec3b& none) { return point < 0 ? none : cloud.colours[point]; });
    return colour;
}

cv::Mat1f depth_on_grid(const Cloud& cloud) {
    cv::Mat1f z_m(cloud.grid);
    std::transform(cloud.points.begin(), cloud.points.end(), z_m.begin(),
                   [](const Eigen::Vector3d& p) { return p.allFinite() ? static_cast<float>(p.z()) : 0.0f; });
    return z_m;
}

/// On the device that computed the frame. Without one, what Finish does, but for maps: these are made when written.
/// Very large images, too: the device's programs keep their memory, the host's images are freed one after the other.
Finished finished(Work& work, const FinishInput& input, const FinishOutputs& outputs) {
    constexpr std::size_t most_pixels = std::size_t(1) << 26;
    if (work.finishers && input.z_m.total() <= most_pixels)
        return work.finishers->compute(input, outputs, work.row.passes);
    Finished made;
    if (outputs.error || outputs.confidence_bits > 0)
        made.error = expected_error_of({input.camera, input.z_m, {}}, input.visibility, input.radius_m, input.noise,
                                       input.errors);
    if (outputs.unshaded || outputs.split || outputs.indirect || (outputs.picture && input.shade == Shade::ambient))
        work.row.warnings.push_back("the image is too large for the device: colours are not split into ambient and "
                                    "direct light, none comes from neighbours, and shaded multiplies all of them.");
    if (outputs.picture) {
        const bool has_gaps = input.colour.empty() || !input.colour_known.empty() || input.shade == Shade::clay;
        made.picture = picture_on_host(input, has_gaps ? clay(input.z_m, input.camera) : cv::Mat3b());
    }
    return made;
}

bool wants_confidence(const Work& work, const Outputs& outputs) {
    return outputs.confidence || outputs.error || (work.frame.cloud ? outputs.cloud : outputs.depth_cloud) ||
           outputs.glb || outputs.tiles3d;
}

/// The light as the camera of that scene sees it.
std::optional<shared::LightConstants> light_on(const Work& work, const FrameOptions& options, bool colour_view) {
    if (!options.light)
        return std::nullopt;
    Eigen::Isometry3d world_from_camera = work.frame.world_from_camera.value_or(Eigen::Isometry3d::Identity());
    Light light = *options.light;
    if (light.in_world && !work.frame.world_from_camera)
        return std::nullopt; // nobody knows where this camera looks
    if (colour_view && has_secondary_camera(work.frame)) {
        world_from_camera = world_from_camera * work.frame.colour_camera->colour_from_depth.inverse();
        if (!light.in_world) { // in the depth camera's space
            light.in_world = true;
            world_from_camera = work.frame.colour_camera->colour_from_depth.inverse();
        }
    }
    return light.on_gpu(world_from_camera.linear());
}

/// Sentences for what a frame could not be given.
void warn_of_light(Work& work, const FrameOptions& options, const Outputs& outputs, const Scene& scene) {
    const bool divided = outputs.unshaded || outputs.light || outputs.indirect;
    if (scene.colour.empty() && (divided || (outputs.shade == Shade::ambient && (outputs.shaded || outputs.panel))))
        work.row.warnings.push_back(
            fmt::format("no colour that fits the depth: {}",
                        divided ? "it has no unshaded, ambient, direct or indirect image." : "shaded shows clay."));
    else if (options.light && options.light->in_world && options.light->has_direct() && needs_light(outputs) &&
             !work.frame.world_from_camera)
        work.row.warnings.emplace_back("the frame has no pose, so nobody knows where the light comes from: all of it "
                                       "is taken for ambient.");
}

/// Whether the view has the recorded pixels: nothing needs to be attached.
bool is_as_recorded(const Frame& frame) {
    return !frame.cloud && !frame.camera.distortion.any() && !has_secondary_camera(frame);
}

} // namespace

bool has_secondary_camera(const Frame& frame) {
    return frame.registration != Registration::yes && frame.colour_camera && !frame.colour.empty();
}

Scene scene_of(const Work& work, bool colour_view) {
    const Frame& frame = work.frame;
    const cv::Mat1f& visibility = work.attached.visibility;
    if (!frame.cloud) {
        if (has_secondary_camera(frame))
            return scene_across_cameras(work, colour_view);
        const bool fits = frame.registration == Registration::yes && frame.colour.size() == frame.depth_m.size();
        return {frame.depth_m,
                visibility,
                fits ? frame.colour : cv::Mat3b(),
                frame.camera.pinhole,
                {},
                {},
                {},
                fits ? frame.deep_colour : cv::Mat3w()};
    }
    const Cloud& cloud = *frame.cloud;
    if (!cloud.organised())
        return {work.depth.z_m, visibility, colour_in_view(cloud, work.depth), work.depth.camera};
    const cv::Mat3b colour = has_colours(cloud) ? on_grid(cloud.colours, cloud.grid) : cv::Mat3b();
    return {depth_on_grid(cloud), visibility, colour, frame.camera.pinhole};
}

FrameImages finish(Work& work, const FrameOptions& options, const Outputs& outputs, bool every_error) {
    work.attached = attach(work.frame, work.depth, work.ao);
    const bool confidence = every_error || wants_confidence(work, outputs);
    const FinishInput view{.camera = work.depth.camera,
                           .z_m = work.depth.z_m,
                           .visibility = work.ao.visibility,
                           .fitted = work.fitted,
                           .fitted_normals = work.fitted_normals,
                           .fitted_m = work.looked_at.z_m,
                           .radius_m = options.radius_m,
                           .noise = options.noise,
                           .errors = work.errors};
    FinishOutputs made{.map_bits = !outputs.ao || is_float(outputs.format) ? 0
                                   : outputs.format == AoFormat::png8      ? 8
                                                                           : 16,
                       .picture = outputs.shaded || outputs.panel,
                       .unshaded = outputs.unshaded,
                       .split = outputs.light,
                       .indirect = outputs.indirect};
    FrameImages images;
    const auto take = [&](const Finished& all) {
        images.map = all.map;
        images.shaded = all.picture;
        images.unshaded = all.unshaded;
        images.ambient = all.ambient;
        images.direct = all.direct;
        images.indirect = all.indirect;
        images.linear = all.linear;
    };
    const auto choose_light_values = [&] {
        images.light_format =
            outputs.colour_format.value_or(images.scene.deep_colour.empty() ? AoFormat::png8 : AoFormat::png16);
        made.light_values = is_float(images.light_format)            ? LightValues::unbounded
                            : images.light_format == AoFormat::png16 ? LightValues::to_white
                                                                     : LightValues::bytes;
    };
    if (is_as_recorded(work.frame)) {
        images.scene = scene_of(work, outputs.colour_view);
        choose_light_values();
        FinishInput input = view;
        input.colour = images.scene.colour;
        input.deep_colour = images.scene.deep_colour;
        input.strength = outputs.shade_strength;
        input.shade = outputs.shade;
        input.light = light_on(work, options, outputs.colour_view);
        warn_of_light(work, options, outputs, images.scene);
        made.confidence_bits = outputs.confidence && !is_float(outputs.format) ? 8 : 0;
        made.error = confidence &&
                     (made.confidence_bits == 0 || outputs.error || every_error || outputs.depth_cloud || outputs.glb);
        Finished all = finished(work, input, made);
        work.error_in_view = work.error.visibility = all.error;
        work.confidence_in_view = work.confidence.visibility = confidence_from(all.error);
        take(all);
        images.confidence_map = all.confidence_map;
        return images;
    }
    if (confidence) {
        work.error_in_view = finished(work, view, {.error = true}).error;
        work.confidence_in_view = confidence_from(work.error_in_view);
        work.error = attach(work.frame, work.depth, {work.error_in_view});
        work.confidence = attach(work.frame, work.depth, {work.confidence_in_view});
    }
    const Scene scene = images.scene = scene_of(work, outputs.colour_view);
    choose_light_values();
    warn_of_light(work, options, outputs, scene);
    const Finished all = finished(work,
                                  {.camera = scene.camera,
                                   .z_m = scene.z_m,
                                   .visibility = scene.visibility,
                                   .radius_m = options.radius_m,
                                   .noise = options.noise,
                                   .colour = scene.colour,
                                   .deep_colour = scene.deep_colour,
                                   .colour_known = scene.colour_known,
                                   .strength = outputs.shade_strength,
                                   .shade = outputs.shade,
                                   .light = light_on(work, options, outputs.colour_view)},
                                  made);
    take(all);
    return images;
}

} // namespace scanshade
