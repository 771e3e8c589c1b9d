// The last step of the walk: a frame's pictures and files.
#include "apps/walk/frame_files.h"

#include "apps/frame/frame_points.h"
#include "apps/frame/point_clouds.h"
#include "apps/page/points.h"
#include "apps/page/preview.h"
#include "apps/picture.h"
#include "apps/results/cloud_picture.h"
#include "apps/walk/cloud_tiles.h"
#include "apps/walk/mesh_textures.h"
#include "io/clouds/cloud_file.h"
#include "io/clouds/glb.h"
#include "io/clouds/number_fields.h"
#include "io/images/npy_file.h"
#include "io/output_file.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <functional>
#include <span>

namespace scanshade {
namespace {

cv::Mat3b panel_picture(const Frame& frame, const Scene& scene, const cv::Mat3b& shaded, Shade shade) {
    const bool fits = !scene.colour.empty();
    const std::string colour = fits                   ? "colour"
                               : frame.colour.empty() ? "no colour"
                                                      : "colour (not known to fit the depth)";
    return panel({{colour, fits ? scene.colour : frame.colour},
                  {"depth", depth_picture(scene.z_m)},
                  {"ambient occlusion", visibility_picture(scene.visibility)},
                  {!fits || shade == Shade::clay ? "clay x AO"
                   : shade == Shade::ambient     ? "ambient part x AO"
                                                 : "colour x AO",
                   shaded}});
}

/// The depth frame's surface as points in camera space.
void write_depth_cloud(const std::filesystem::path& file, const Work& work, const FramePoints& all,
                       const LengthUnit& unit) {
    std::vector<AddedField> added = {{"ambient_occlusion", all.visibility}, {"ao_confidence", all.confidence}};
    if (!all.error.empty())
        added.push_back({"ao_error", all.error});
    if (has_secondary_camera(work.frame))
        added.push_back({"colour_known", all.colour_known});
    write_new_ply(file, all.made, all.colours, added,
                  {fmt::format("camera space: x right, y down, z forward, {}",
                               unit.arbitrary() ? "in the recording's arbitrary unit" : "metres")});
}

using Writer = std::function<void(const std::filesystem::path&)>;

/// The cloud's files by their names. A format without room for fields gets a list of values, and the cloud itself where
/// its colours change.
std::vector<std::pair<std::filesystem::path, Writer>> recorded_cloud_files(const Work& work, const FramePoints& all,
                                                                           const Outputs& outputs) {
    const Cloud& cloud = *work.frame.cloud;
    std::vector<AddedField> fields{{"ambient_occlusion", all.visibility}};
    if (!all.confidence.empty())
        fields.push_back({"ao_confidence", all.confidence});
    if (!all.error.empty())
        fields.push_back({"ao_error", all.error});
    const bool changed = outputs.colour_cloud != CloudColours::kept && takes_colours(cloud);
    const std::filesystem::path same = cloud_file(written_name(work.entry.name, *cloud.records), "");
    std::vector<std::pair<std::filesystem::path, Writer>> files;
    if (!takes_fields(cloud))
        files.emplace_back(fields_file(work.entry.name),
                           [=, &cloud](const auto& file) { write_new_ply(file, points_with_haze(cloud), {}, fields); });
    if (changed && !splats_of(cloud).empty())
        files.emplace_back(same, [&cloud, &all, &outputs](const auto& file) {
            write_shaded_splats(file, cloud, all.visibility, outputs.shade_strength);
        });
    else if (takes_fields(cloud))
        files.emplace_back(same, [=, &cloud, &all](const auto& file) {
            write_cloud(file, cloud, fields, changed ? std::span(all.colours) : std::span<const cv::Vec3b>());
        });
    return files;
}

/// The points or the mesh as glTF, which has colours: visibility as grey where the frame has none.
void write_points_glb(const std::filesystem::path& file, Work& work, FramePoints all) {
    GlbScene scene{.name = work.entry.name,
                   .points = all.points,
                   .triangles = {},
                   .normals = {},
                   .colours = {},
                   .fields = {{"_AMBIENT_OCCLUSION", all.visibility}},
                   .up = UpAxis::unknown};
    std::vector<std::array<int, 3>> triangles;
    std::vector<Eigen::Vector3d> normals;
    if (work.frame.cloud) {
        scene.triangles = triangles = triangles_of(*work.frame.cloud);
        scene.normals = normals = recorded_normals(*work.frame.cloud);
    }
    if (work.frame.cloud && z_is_up(*work.frame.cloud))
        scene.up = UpAxis::z;
    else if (!work.by_points)
        scene.up = UpAxis::minus_y;
    if (all.colours.empty())
        all.colours = greys(all.visibility);
    scene.colours = all.colours;
    if (!all.confidence.empty())
        scene.fields.push_back({"_AO_CONFIDENCE", all.confidence});
    if (!all.error.empty())
        scene.fields.push_back({"_AO_ERROR", all.error});
    const GlbWritten written = write_glb(file, scene);
    if (work.frame.cloud) // depth images have holes and pixels without a value: no news
        std::ranges::move(describe(written, scene.up, cloud_file(work.entry.name, ".glb").generic_string()),
                          std::back_inserter(work.row.notes));
}

/// The maps of what the pictures show. A colour image of other pixels is shown by itself.
std::string preview_of(const Work& work, const FrameImages& images, const LengthUnit& unit) {
    const Scene& scene = images.scene;
    const cv::Mat1f& confidence = scene.confidence.empty() ? work.confidence.visibility : scene.confidence;
    page::Preview preview{.z_m = scene.z_m, .visibility = scene.visibility, .camera = scene.camera};
    if (unit.arbitrary()) {
        cv::Mat1f own; // an expression assigned to preview.z_m would write into the scene's pixels
        scene.z_m.convertTo(own, CV_32F, unit.units_per_length);
        preview.z_m = own;
        preview.unit = unit.name();
    }
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
    if (outputs.error && !work.by_points)
        wrote(error_file(name, outputs), [&](const auto& file) {
            write_ao(file, scene.error.empty() ? work.error.visibility : scene.error, outputs.format);
        });
    if (outputs.shaded)
        wrote(picture_file("shaded", name), [&](const auto& file) { write_picture(file, images.shaded); });
    const auto wrote_if_made = [&](const char* kind, const cv::Mat3b& picture, const cv::Mat3f& light) {
        if (!light.empty())
            wrote(light_file(kind, name, outputs),
                  [&](const auto& file) { write_light(file, light, images.light_format); });
        else if (!picture.empty())
            wrote(light_file(kind, name, outputs), [&](const auto& file) { write_picture(file, picture); });
    };
    wrote_if_made("unshaded", images.unshaded, images.linear.unshaded);
    wrote_if_made("ambient", images.ambient, images.linear.ambient);
    wrote_if_made("direct", images.direct, images.linear.direct);
    wrote_if_made("indirect", images.indirect, images.linear.indirect);
    if (outputs.panel)
        wrote(picture_file("panel", name), [&](const auto& file) {
            write_picture(file, panel_picture(work.frame, scene, images.shaded, outputs.shade));
        });
    if (outputs.preview && !scene.z_m.empty())
        wrote(preview_file(name),
              [&](const auto& file) { write_atomically(file, preview_of(work, images, outputs.unit)); });
    if (work.frame.cloud && outputs.cloud && outputs.colour_cloud == CloudColours::grey &&
        !takes_colours(*work.frame.cloud))
        work.row.warnings.push_back("the file's point format has no colour, so grey is not written; the field "
                                    "ambient_occlusion has the values.");
    if (outputs.error && work.by_points && work.error.per_point.empty())
        work.row.warnings.push_back("the method estimates no errors of single points, so there is no field ao_error.");
    if (work.frame.cloud && outputs.cloud && outputs.colour_cloud == CloudColours::kept &&
        !splats_of(*work.frame.cloud).empty() && extension(*work.frame.cloud->records) == ".ply" &&
        takes_fields(*work.frame.cloud))
        work.row.notes.push_back("ambient_occlusion comes behind the splats' own properties: what reads these by name "
                                 "opens the file, INRIA's viewer does not; --colour-cloud shaded adds none.");
    if (work.frame.cloud && outputs.cloud) {
        const FramePoints points = points_of_cloud(work, outputs);
        for (const auto& [file, write] : recorded_cloud_files(work, points, outputs))
            wrote(file, write);
    }
    if (!work.frame.cloud && outputs.depth_cloud)
        wrote(cloud_file(name, ".ply"), [&](const auto& file) {
            write_depth_cloud(file, work, points_of_depth(work, scene, outputs), outputs.unit);
        });
    const bool is_glb_already = work.frame.cloud && outputs.cloud && work.frame.cloud->records &&
                                extension(*work.frame.cloud->records) == ".glb";
    if (outputs.glb && is_glb_already)
        work.row.notes.push_back("--write glb makes no other file: the splats' own is one.");
    else if (outputs.glb)
        wrote(cloud_file(name, ".glb"), [&](const auto& file) {
            write_points_glb(file, work,
                             work.frame.cloud ? points_of_cloud(work, outputs) : points_of_depth(work, scene, outputs));
        });
    if (outputs.texture.wanted)
        write_mesh_textures(work, outputs);
    if (outputs.tiles3d)
        write_cloud_tiles(work, outputs);
}

std::filesystem::path write_cloud_picture(const Work& work, const Outputs& outputs) {
    std::filesystem::path file = picture_file(outputs.shaded ? "shaded" : "panel", work.entry.name);
    const std::optional<Eigen::Vector3d> viewpoint = scanner_of(work.frame);
    write_picture(outputs.files_folder() / file,
                  cloud_picture(*work.frame.cloud, work.of_points, viewpoint, outputs.shade_strength));
    return file;
}

std::vector<std::filesystem::path> write_page_points(const Work& work, const Outputs& outputs) {
    const Cloud& cloud = *work.frame.cloud;
    const std::optional<Eigen::Vector3d> viewpoint = scanner_of(work.frame);
    const std::vector<NumberField> numbers = cloud.records ? number_fields(*cloud.records) : std::vector<NumberField>();
    std::vector<page::Field> fields;
    for (const NumberField& each : numbers)
        fields.push_back({each.name, each.whole});
    const page::Points points{.points = cloud.points,
                              .colours = has_colours(cloud) ? std::span(cloud.colours) : std::span<const cv::Vec3b>(),
                              .visibility = work.attached.per_point,
                              .confidence = work.confidence.per_point,
                              .normals = work.of_points.normals,
                              .up = up_of(cloud, work.of_points, viewpoint),
                              .fields = std::move(fields),
                              .read = [&](std::size_t point, std::span<double> values) {
                                  read_numbers(*cloud.records, numbers, point, values);
                              }};
    return page::write_points(outputs.files_folder(), std::filesystem::path("points") / work.entry.name, points,
                              outputs.page_points);
}

void remove_files(Work& work, const Outputs& outputs) {
    work.row.files.clear();
    std::error_code gone_already;
    for (const auto& file : files_of(work.entry, outputs))
        std::filesystem::remove(file, gone_already);
    if (outputs.tiles3d)
        std::filesystem::remove_all(outputs.files_folder() / tiles_path(work.entry.name), gone_already);
    const auto points = [&](std::size_t part) { return outputs.files_folder() / points_file(work.entry.name, part); };
    for (std::size_t part = 0; outputs.preview && std::filesystem::remove(points(part), gone_already); ++part)
        continue;
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
