// The joined table of formats, and how it is printed in READMEs.
#include "io/captures/formats.h"

#include "io/cameras/camera_formats.h"
#include "io/cameras/known_cameras.h"
#include "io/captures/recording_formats.h"
#include "io/clouds/format.h"
#include "io/images/format.h"
#include "io/images/image_file.h"
#include "io/text.h"

#include <algorithm>
#include <array>
#include <fmt/format.h>
#include <fmt/ranges.h>

namespace scanshade {

namespace {

/// What is written and is no format of an input.
const std::array written_only = {
    Format{FormatKind::output,
           "cloud of a recording",
           "`run --cloud FILE`, `run --write cloud`",
           {".ply"},
           "points of frames with colour, AO and confidence",
           "",
           false,
           true},
    Format{FormatKind::output,
           "glTF",
           "`run --write glb`, `run --cloud FILE.glb`",
           {".glb"},
           "points or meshes with `_AMBIENT_OCCLUSION` and colour",
           "",
           false,
           true},
    Format{FormatKind::output,
           "textures of meshes",
           "`run --write texture`",
           {".obj", ".gltf", ".glb", ".ply"},
           "the mesh with links to images of visibility: `occlusionTexture`, `map_Ka`",
           "",
           false,
           true},
    Format{FormatKind::output,
           "MCAP",
           "`run --write mcap`",
           {".mcap"},
           "a run as one recording of ROS 2: images, camera, points with AO, poses",
           "",
           false,
           true},
    Format{FormatKind::output,
           "tars of results",
           "`run --tar N`",
           {".tar"},
           "N frames each, as WebDataset reads them: `KEY.ao.png`, `KEY.json`",
           "",
           false,
           true},
};

template <class Extensions>
std::vector<std::string> extensions_of(const Extensions& extensions) {
    std::vector<std::string> found(std::begin(extensions), std::end(extensions));
    std::erase(found, "");
    return found;
}

std::vector<std::string> separate(std::string_view words_with_blanks) {
    std::vector<std::string> found;
    for (const std::string_view word : words(words_with_blanks))
        found.emplace_back(word);
    return found;
}

void add_recordings(std::vector<Format>& all) {
    for (const RecordingFormat& row : recording_formats())
        all.push_back({*row.extensions ? FormatKind::recording_file : FormatKind::recording_folder, row.name,
                       row.recognised, separate(row.extensions), row.depth, row.camera});
}

void add_images(std::vector<Format>& all) {
    for (const ImageFormat& row : image_formats())
        if (row.read_stored)
            all.push_back({FormatKind::depth_image, std::string(row.name), "first bytes", extensions_of(row.extensions),
                           std::string(row.depth), "", true, row.written != nullptr});
    for (const ImageFormat& row : image_formats())
        if (row.read_colour)
            all.push_back({FormatKind::colour_image, std::string(row.name), "first bytes",
                           extensions_of(row.extensions), "", "", true, row.written != nullptr});
}

void add_clouds(std::vector<Format>& all) {
    for (const CloudFormat& row : cloud_formats())
        all.push_back({FormatKind::cloud, std::string(row.name), row.signature ? "first bytes" : "name",
                       extensions_of(row.extensions), std::string(row.content), "", row.read != nullptr,
                       row.written && row.written_extension.empty()});
}

void add_cameras(std::vector<Format>& all) {
    for (const CameraFormatRow& row : camera_formats())
        all.push_back({FormatKind::camera, row.name, row.recognised, separate(row.extension), row.content, "", true,
                       row.written != nullptr});
    all.push_back({FormatKind::camera, "fx,fy,cx,cy", "four numbers after `--camera`", {}, "a pinhole"});
    all.push_back({FormatKind::camera,
                   "known camera",
                   "its name after `--camera`",
                   {},
                   fmt::format("published numbers: `{}`", fmt::join(known_camera_names(), "`, `"))});
}

void add_outputs(std::vector<Format>& all) {
    for (const AoFormatRow& row : ao_formats)
        all.push_back({FormatKind::output,
                       row.name,
                       "`run --format`",
                       {std::string(row.extension)},
                       "visibility: " + std::string(row.content),
                       "",
                       false,
                       true});
    all.insert(all.end(), written_only.begin(), written_only.end());
}

// --- Markdown ---

using Cells = std::vector<std::string>;

std::string row_of(const Cells& cells) { return fmt::format("| {} |\n", fmt::join(cells, " | ")); }

std::string head_of(const Cells& cells) { return row_of(cells) + row_of(Cells(cells.size(), "---")); }

/// "`.tif`, `.tiff`"
std::string coded(const std::vector<std::string>& extensions) {
    return extensions.empty() ? "" : fmt::format("`{}`", fmt::join(extensions, "`, `"));
}

std::string yes_or_no(bool yes) { return yes ? "yes" : "no"; }

/// The rows of these kinds, each as `cells` of it.
template <class CellsOf>
std::string table_of(const Cells& head, std::initializer_list<FormatKind> kinds, const CellsOf& cells_of) {
    std::string text = head_of(head);
    for (const Format& format : formats())
        if (std::ranges::find(kinds, format.kind) != kinds.end())
            text += row_of(cells_of(format));
    return text;
}

} // namespace

const char* name_of(FormatKind kind) {
    static constexpr std::array names{"recording folder", "recording file", "depth image", "colour image", "cloud",
                                      "camera",           "output"};
    return names[static_cast<std::size_t>(kind)];
}

std::vector<Format> formats() {
    std::vector<Format> all;
    add_recordings(all);
    add_images(all);
    add_clouds(all);
    add_cameras(all);
    add_outputs(all);
    std::ranges::stable_sort(all, {}, &Format::kind);
    return all;
}

std::vector<std::string> format_names(FormatKind kind) {
    std::vector<std::string> names;
    for (const Format& format : formats())
        if (format.kind == kind && format.read)
            names.push_back(format.name);
    return names;
}

std::string formats_in_short() {
    using enum FormatKind;
    const auto names = [](FormatKind kind) { return fmt::format("{}", fmt::join(format_names(kind), ", ")); };
    return head_of({"input", "formats"}) + row_of({"folders of recordings", names(recording_folder)}) +
           row_of({"files of recordings", names(recording_file)}) +
           row_of({"single depth images", names(depth_image)}) + row_of({"colour images", names(colour_image)}) +
           row_of({"clouds and meshes", names(cloud)}) + row_of({"cameras", names(camera)});
}

std::string formats_in_full() {
    using enum FormatKind;
    return table_of({"recording", "recognised by", "depth", "camera"}, {recording_folder, recording_file},
                    [](const Format& f) {
                        const std::string called = f.extensions.empty() ? "" : ": " + coded(f.extensions);
                        return Cells{f.name + called, f.recognised, f.content, f.camera};
                    }) +
           "\n" +
           table_of({"depth image", "files", "numbers", "written"}, {depth_image},
                    [](const Format& f) {
                        return Cells{f.name, coded(f.extensions), f.content, yes_or_no(f.written)};
                    }) +
           "\n" +
           table_of({"colour image", "files", "written"}, {colour_image},
                    [](const Format& f) {
                        return Cells{f.name, coded(f.extensions), yes_or_no(f.written)};
                    }) +
           "\n" +
           table_of({"cloud", "files", "told by", "what is read", "written"}, {cloud},
                    [](const Format& f) {
                        return Cells{f.name, coded(f.extensions), f.recognised, f.content, yes_or_no(f.written)};
                    }) +
           "\n" +
           table_of({"camera", "recognised by", "what is read", "written"}, {camera},
                    [](const Format& f) {
                        return Cells{f.name, f.recognised, f.content, f.written ? coded(f.extensions) : "no"};
                    }) +
           "\n" + table_of({"output", "asked for by", "files", "content"}, {output}, [](const Format& f) {
               return Cells{f.name, f.recognised, coded(f.extensions), f.content};
           });
}

} // namespace scanshade
