// The last step of the walk: a frame's pictures and files.
#include "apps/walk/frame_files.h"

#include "apps/page/points.h"
#include "apps/page/preview.h"
#include "apps/picture.h"
#include "apps/results/cloud_picture.h"
#include "apps/walk/point_clouds.h"
#include "io/clouds/cloud_file.h"
#include "io/images/npy_file.h"
#include "io/output_file.h"
#include "projection/colour_view.h"
#include "projection/undistort.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <span>

namespace scanshade {
namespace {

cv::Mat3b panel_picture(const Frame& frame, const Scene& scene, const cv::Mat3b& shaded) {
    const bool fits = !scene.colour.empty();
    const std::string colour = fits                   ? "colour"
                               : frame.colour.empty() ? "no colour"
                                                      : "colour (not known to fit the depth)";
    return panel({{colour, fits ? scene.colour : frame.colour},
                  {"depth", depth_picture(scene.z_m)},
                  {"ambient occlusion", visibility_picture(scene.visibility)},
                  {fits ? "colour x AO" : "clay x AO", shaded}});
}

std::vector<cv::Vec3b> shaded_colours(const std::vector<cv::Vec3b>& colours, const std::vector<float>& visibility,
                                      double strength) {
    const cv::Size row(static_cast<int>(colours.size()), 1);
    if (row.empty())
        return {};
    const cv::Mat3b shaded = shade(on_grid(colours, row), on_grid(visibility, row), strength);
    return {shaded.begin(), shaded.end()};
}

/// Visibility as grey, so that 255 is open; black where it is not known.
std::vector<cv::Vec3b> greys(const std::vector<float>& visibility) {
    std::vector<cv::Vec3b> colours(visibility.size());
    std::ranges::transform(visibility, colours.begin(), [](float value) {
        return cv::Vec3b::all(std::isnan(value) ? uchar(0) : cv::saturate_cast<uchar>(255 * value));
    });
    return colours;
}

/// The colours of a written cloud; empty = none, or as they were.
std::vector<cv::Vec3b> colours_of(const std::vector<cv::Vec3b>& own, const std::vector<float>& visibility,
                                  const Outputs& outputs) {
    if (own.empty())
        return outputs.colour_cloud == CloudColours::grey ? greys(visibility) : std::vector<cv::Vec3b>();
    return shaded_colours(own, visibility, outputs.shade_strength);
}

/// The image without lens distortion. Zero where the camera saw nothing.
template <class Pixel>
cv::Mat_<Pixel> undistorted_image(const cv::Mat_<Pixel>& image, const Camera& camera) {
    if (image.empty() || !camera.distortion.any())
        return image;
    const auto maps = Undistortion::of(camera);
    cv::Mat_<Pixel> straight(image.size());
    std::transform(maps->recorded_pixel().begin(), maps->recorded_pixel().end(), straight.begin(),
                   [&](int pixel) { return pixel < 0 ? Pixel() : image(pixel / image.cols, pixel % image.cols); });
    return straight;
}

/// Clouds store confidence 0 where it is not known.
float known_or_none(float confidence) { return std::isnan(confidence) ? 0.0F : confidence; }

/// The depth frame's surface as points in camera space, coloured where the colour fits. Points that the colour camera
/// did not see are black, and colour_known says 0.
void write_depth_cloud(const std::filesystem::path& file, const Work& work, const Scene& shown,
                       const Outputs& outputs) {
    const auto& [camera, z_m, source] = work.depth;
    const bool warped = has_secondary_camera(work.frame);
    const Scene scene = warped && outputs.colour_view ? scene_of(work, false) : shown;
    const cv::Mat3b colour = undistorted_image(scene.colour, work.frame.camera);
    const cv::Mat1b colour_known = undistorted_image(scene.colour_known, work.frame.camera);
    std::vector<Eigen::Vector3d> points;
    std::vector<cv::Vec3b> colours;
    std::vector<float> visibility, confidence, known;
    for (int v = 0; v < z_m.rows; ++v) {
        for (int u = 0; u < z_m.cols; ++u) {
            const double z = z_m(v, u);
            if (z <= 0)
                continue;
            points.push_back(camera.point(u, v, z));
            visibility.push_back(work.ao.visibility(v, u));
            confidence.push_back(known_or_none(work.confidence_in_view(v, u)));
            if (!colour.empty())
                colours.push_back(colour(v, u));
            if (!colour_known.empty())
                known.push_back(colour_known(v, u) > 0 ? 1.0F : 0.0F);
        }
    }
    if (outputs.colour_cloud != CloudColours::kept)
        colours = colours_of(colours, visibility, outputs);
    std::vector<AddedField> added = {{"ambient_occlusion", visibility}, {"ao_confidence", confidence}};
    if (warped)
        added.push_back({"colour_known", known});
    write_new_ply(file, points, colours, added, {"camera space: x right, y down, z forward, metres"});
}

void write_recorded_cloud(const std::filesystem::path& file, const Work& work, const Outputs& outputs) {
    const Cloud& cloud = *work.frame.cloud;
    std::vector<cv::Vec3b> colours;
    if (outputs.colour_cloud != CloudColours::kept && takes_colours(cloud))
        colours =
            colours_of(has_colours(cloud) ? cloud.colours : std::vector<cv::Vec3b>(), work.attached.per_point, outputs);
    std::vector<AddedField> fields{{"ambient_occlusion", work.attached.per_point}};
    std::vector<float> confidence = work.confidence.per_point;
    std::ranges::transform(confidence, confidence.begin(), known_or_none);
    if (!confidence.empty())
        fields.push_back({"ao_confidence", confidence});
    write_cloud(file, cloud, fields, colours);
}

/// The maps of what the pictures show. A colour image of other pixels is shown by itself.
std::string preview_of(const Work& work, const FrameImages& images) {
    const Scene& scene = images.scene;
    const cv::Mat1f& confidence = scene.confidence.empty() ? work.confidence.visibility : scene.confidence;
    page::Preview preview{.z_m = scene.z_m, .visibility = scene.visibility, .camera = scene.camera};
    if (images.confidence_map.size() == scene.z_m.size())
        preview.confidence_map = images.confidence_map;
    else if (confidence.size() == scene.z_m.size())
        preview.confidence = confidence;
    preview.colour_fits = !scene.colour.empty();
    preview.colour = preview.colour_fits ? scene.colour : work.frame.colour;
    return page::preview_script(preview);
}

} // namespace

void write_all(Work& work, const FrameImages& images, const Outputs& outputs) {
    const std::string& name = work.entry.name;
    const Scene& scene = images.scene;
    const auto wrote = [&](const std::filesystem::path& file, const auto& write) {
        write(outputs.files_folder() / file);
        work.row.files.push_back(file);
    };
    const auto write_map = [](const std::filesystem::path& file, const cv::Mat& integers, const cv::Mat1f& values,
                              AoFormat format) {
        if (integers.empty())
            write_ao(file, values, format);
        else
            write_ao_integers(file, integers);
    };
    if (outputs.ao)
        wrote(ao_file(name, outputs),
              [&](const auto& file) { write_map(file, images.map, scene.visibility, outputs.format); });
    if (outputs.confidence)
        wrote(confidence_file(name, outputs), [&](const auto& file) {
            const bool floats = outputs.format == AoFormat::tiff || outputs.format == AoFormat::exr;
            write_map(file, images.confidence_map,
                      scene.confidence.empty() ? work.confidence.visibility : scene.confidence,
                      floats ? outputs.format : AoFormat::png8);
        });
    if (outputs.shaded)
        wrote(picture_file("shaded", name), [&](const auto& file) { write_picture(file, images.shaded); });
    if (outputs.panel)
        wrote(picture_file("panel", name),
              [&](const auto& file) { write_picture(file, panel_picture(work.frame, scene, images.shaded)); });
    if (outputs.preview && !scene.z_m.empty())
        wrote(preview_file(name), [&](const auto& file) { write_atomically(file, preview_of(work, images)); });
    if (work.frame.cloud && outputs.cloud && outputs.colour_cloud == CloudColours::grey &&
        !takes_colours(*work.frame.cloud))
        work.row.warnings.push_back("the file's point format has no colour, so grey is not written; the field "
                                    "ambient_occlusion has the values.");
    if (work.frame.cloud && outputs.cloud)
        wrote(cloud_file(name, extension(*work.frame.cloud->records)),
              [&](const auto& file) { write_recorded_cloud(file, work, outputs); });
    if (!work.frame.cloud && outputs.depth_cloud)
        wrote(cloud_file(name, ".ply"), [&](const auto& file) { write_depth_cloud(file, work, scene, outputs); });
}

std::filesystem::path write_cloud_picture(const Work& work, const Outputs& outputs) {
    const std::filesystem::path file = picture_file(outputs.shaded ? "shaded" : "panel", work.entry.name);
    const std::optional<Eigen::Vector3d> viewpoint = scanner_of(work.frame);
    write_picture(outputs.files_folder() / file,
                  cloud_picture(*work.frame.cloud, work.of_points, viewpoint, outputs.shade_strength));
    return file;
}

std::vector<std::filesystem::path> write_page_points(const Work& work, const Outputs& outputs) {
    const Cloud& cloud = *work.frame.cloud;
    const std::optional<Eigen::Vector3d> viewpoint = scanner_of(work.frame);
    const page::Points points{.points = cloud.points,
                              .colours = has_colours(cloud) ? std::span(cloud.colours) : std::span<const cv::Vec3b>(),
                              .visibility = work.attached.per_point,
                              .confidence = work.confidence.per_point,
                              .normals = work.of_points.normals,
                              .up = up_of(cloud, work.of_points, viewpoint)};
    return page::write_points(outputs.files_folder(), std::filesystem::path("points") / work.entry.name, points,
                              outputs.page_points);
}

void remove_files(Work& work, const Outputs& outputs) {
    work.row.files.clear();
    std::error_code gone_already;
    for (const auto& file : files_of(work.entry, outputs))
        std::filesystem::remove(file, gone_already);
    for (std::size_t part = 0; outputs.preview && part * page::points_in_a_chunk < outputs.page_points; ++part)
        std::filesystem::remove(outputs.files_folder() / points_file(work.entry.name, part), gone_already);
}

void write_intermediates(const std::filesystem::path& folder, const std::vector<Intermediate>& all) {
    std::string index = "name,type,shape,meaning\n";
    for (const Intermediate& each : all) {
        write_npy(folder / (each.name + ".npy"), each.type, each.shape, each.data);
        index += fmt::format("{},{},{},\"{}\"\n", each.name, each.type, fmt::join(each.shape, "x"), each.meaning);
    }
    write_atomically(folder / "index.csv", index);
}

void add_to(RecordingCloud& cloud, const Work& work) {
    if (!work.frame.world_from_camera)
        return;
    if (work.by_points && work.entry.world_from_camera) { // a viewpoint in the file does not say whose frame it uses
        const Cloud& own = *work.frame.cloud;
        cloud.add(CloudSweep{own.points, own.colours, work.attached.per_point, work.confidence.per_point,
                             *work.entry.world_from_camera, work.of_points.spacing});
    }
    if (work.looked_at.z_m.empty())
        return;
    const Scene scene = scene_of(work, false);
    cloud.add({work.looked_at, work.ao.visibility, work.confidence_in_view,
               undistorted_image(scene.colour, work.frame.camera),
               undistorted_image(scene.colour_known, work.frame.camera), *work.frame.world_from_camera});
}

} // namespace scanshade
