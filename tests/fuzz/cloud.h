// Any cloud: read, asked for all it may hold, written with a field more and read again.
#pragma once

#include "io/clouds/cloud_file.h"
#include "io/clouds/cloud_records.h"
#include "io/clouds/mesh_textures.h"
#include "tests/fuzz/fuzz.h"

namespace scanshade::fuzz {

inline void ask_for_all(const Cloud& cloud, const std::filesystem::path& file) {
    must_hold(cloud.colours.empty() || cloud.colours.size() == cloud.points.size());
    must_hold(static_cast<std::size_t>(cloud.grid.area()) == cloud.points.size());
    for (const auto& corners : triangles_of(cloud))
        for (const int corner : corners)
            must_hold(corner >= -1 && corner < static_cast<int>(cloud.points.size()));
    const auto normals = recorded_normals(cloud);
    must_hold(normals.empty() || normals.size() == cloud.points.size());
    (void)accepted([&] { (void)recorded_field(cloud, "ambient_occlusion", file); });
    (void)accepted([&] { (void)recorded_field(cloud, "intensity", file); });
    (void)describe(*cloud.records);
    (void)accepted([&] {
        const TexturedMesh mesh = textured_mesh(cloud, file);
        must_hold(mesh.triangles == triangles_of(cloud) && mesh.material.size() == mesh.triangles.size());
        for (const auto& set : mesh.sets)
            must_hold(set.size() == mesh.triangles.size());
        const std::vector<OcclusionLink> links{{mesh.materials.size() - 1, 0, "a.png", "image"}};
        must_hold(!linked_mesh(cloud, file, "linked", mesh, links, true).files.empty());
    });
}

/// Whether the file begins as one of another format does.
inline bool has_a_signature(const std::filesystem::path& file) {
    std::string start(8, '\0');
    std::ifstream(file, std::ios::binary).read(start.data(), 8);
    return start.starts_with("LASF") || start.starts_with("ASTM-E57") || start.starts_with("ply") ||
           start.starts_with("# .PCD") || start.starts_with("VERSION") || start.starts_with("glTF");
}

inline void take_cloud(std::string_view bytes, const std::string& name) {
    const std::filesystem::path file = as_file(bytes, name);
    std::vector<std::string> warnings;
    Cloud cloud;
    if (!accepted([&] { cloud = read_cloud(file, warnings); }))
        return;
    ask_for_all(cloud, file);
    const std::vector<float> values(cloud.points.size(), 0.5F);
    const std::filesystem::path more = folder() / ("more-" + name);
    if (!accepted([&] { write_cloud(more, cloud, {{"ambient_occlusion", values}}, cloud.colours); }))
        return;
    const std::string end = extension(*cloud.records);
    const bool text = end == ".xyz" || end == ".pts" || end == ".ptx"; // whose columns may have no names
    if (text && has_a_signature(more))                                 // which blanks, not written again, stood before
        return;
    const Cloud again = read_cloud(more, warnings);
    must_hold(again.points.size() == cloud.points.size());
    must_hold(again.grid == cloud.grid);
    must_hold(again.records->octree.size() == cloud.records->octree.size());
    must_hold(text || recorded_field(again, "ambient_occlusion", more).size() == values.size());
}

} // namespace scanshade::fuzz
