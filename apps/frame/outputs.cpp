#include "apps/frame/outputs.h"

#include "io/clouds/format.h"

#include <fmt/format.h>

namespace scanshade {

namespace fs = std::filesystem;

fs::path ao_file(const std::string& name, const Outputs& outputs) {
    return fs::path("ao") / (name + extension(outputs.format));
}
fs::path confidence_file(const std::string& name, const Outputs& outputs) {
    return fs::path("confidence") / (name + extension(outputs.format));
}
fs::path error_file(const std::string& name, const Outputs& outputs) {
    return fs::path("error") / (name + extension(outputs.format));
}
fs::path picture_file(const char* kind, const std::string& name) { return fs::path(kind) / (name + ".png"); }
fs::path light_file(const char* kind, const std::string& name, const Outputs& outputs) {
    return fs::path(kind) / (name + extension(outputs.colour_format.value_or(AoFormat::png8)));
}
fs::path cloud_file(const std::string& name, const std::string& extension) {
    return fs::path("clouds") / (name + extension);
}
fs::path fields_file(const std::string& name) { return cloud_file(name, ".ao.ply"); }
fs::path tiles_path(const std::string& name) { return fs::path("tiles") / name; }
fs::path preview_file(const std::string& name) { return fs::path("previews") / (name + ".js"); }
fs::path points_file(const std::string& name, std::size_t part) {
    return fs::path("points") / fmt::format("{}.{:03}.js", name, part);
}

Outputs of_points(const Outputs& outputs) {
    Outputs those = outputs;
    those.cloud = outputs.cloud || outputs.ao || outputs.confidence || outputs.error;
    those.ao = those.confidence = those.shaded = those.unshaded = those.light = those.indirect = those.panel = false;
    return those;
}

std::vector<fs::path> files_of(const CaptureEntry& entry, const Outputs& outputs) {
    std::vector<fs::path> files;
    const auto add = [&](const fs::path& file) { files.push_back(outputs.files_folder() / file); };
    if (outputs.ao)
        add(ao_file(entry.name, outputs));
    if (outputs.confidence)
        add(confidence_file(entry.name, outputs));
    if (outputs.error)
        add(error_file(entry.name, outputs));
    if (outputs.shaded)
        add(picture_file("shaded", entry.name));
    if (outputs.unshaded)
        add(light_file("unshaded", entry.name, outputs));
    for (const char* part : {"ambient", "direct"})
        if (outputs.light)
            add(light_file(part, entry.name, outputs));
    if (outputs.indirect)
        add(light_file("indirect", entry.name, outputs));
    if (outputs.panel)
        add(picture_file("panel", entry.name));
    if (outputs.preview)
        add(preview_file(entry.name));
    if (outputs.preview && !entry.cloud.empty())
        add(points_file(entry.name, 0));
    if (entry.cloud.empty() && outputs.depth_cloud)
        add(cloud_file(entry.name, ".ply"));
    if (outputs.texture.wanted) // images of several materials are named after these
        for (const std::string& end : {std::string(".obj"), std::string(".mtl"), std::string(".glb"),
                                       std::string(".gltf"), std::string(".ply"), ".ao" + extension(outputs.format)})
            add(fs::path(texture_folder) / (entry.name + end));
    if (outputs.tiles3d)
        add(tiles_path(entry.name) / "tileset.json");
    if (outputs.glb)
        add(cloud_file(entry.name, ".glb"));
    if (!entry.cloud.empty() && of_points(outputs).cloud)
        for (const std::string_view extension : written_cloud_extensions())
            add(cloud_file(entry.name, std::string(extension)));
    if (!entry.cloud.empty() && of_points(outputs).cloud)
        add(fields_file(entry.name));
    if (const std::string plain = plain_laz_name(entry.name); !entry.cloud.empty() && plain != entry.name)
        add(cloud_file(plain, ".laz"));
    return files;
}

std::string colour_encoding(const Outputs& outputs) {
    if (!outputs.unshaded && !outputs.light && !outputs.indirect)
        return {};
    if (!outputs.colour_format)
        return "sRGB: PNG of 16 bits where the colour image has 16, else of 8";
    switch (*outputs.colour_format) {
    case AoFormat::png8:
        return "sRGB: PNG of 8 bits";
    case AoFormat::png16:
        return "sRGB: PNG of 16 bits";
    case AoFormat::tiff:
    case AoFormat::exr:
        break;
    }
    return "linear light of sRGB's primaries: floats, 1 = white of the colour image; unshaded may exceed it";
}

} // namespace scanshade
