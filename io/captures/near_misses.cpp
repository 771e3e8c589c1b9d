#include "io/captures/near_misses.h"

#include "io/captures/listing/layouts.h"
#include "io/clouds/format.h"
#include "io/files.h"
#include "io/images/format.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <map>
#include <vector>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

constexpr const char* meshes = "meshes are read from PLY, OBJ and glTF, which Blender writes, too";
constexpr const char* splats =
    "Gaussian splats are read from PLY, .splat and .spz: `splat-transform IN OUT.ply` makes one";
constexpr const char* videos =
    "videos hold no distances; of recordings with depth, .mkv of Azure Kinect, .bag, .mcap and .r3d are read";

/// Formats that people have and that are not read.
struct Foreign {
    std::string_view extension, begins, name;
    const char* instead;
};
constexpr std::array foreign{
    Foreign{".stl", "solid ", "a mesh in STL", meshes},
    Foreign{".off", "OFF", "a mesh in OFF", meshes},
    Foreign{".fbx", "Kaydara FBX", "a scene in FBX", meshes},
    Foreign{".dae", "", "a scene in COLLADA", meshes},
    Foreign{".3ds", "", "a mesh in 3DS", meshes},
    Foreign{".usdz", "", "a scene in USD", meshes},
    Foreign{".usd", "", "a scene in USD", meshes},
    Foreign{".usda", "#usda", "a scene in USD", meshes},
    Foreign{".vtk", "# vtk", "a data set of VTK", meshes},
    Foreign{".vtp", "", "a data set of VTK", meshes},
    Foreign{".ksplat", "", "Gaussian splats in .ksplat", splats},
    Foreign{".sog", "", "Gaussian splats in SOG", splats},
    Foreign{".svo", "", "a recording of a ZED camera",
            "export its depth images and camera with the ZED SDK (ZED_SVO_Export)"},
    Foreign{".svo2", "", "a recording of a ZED camera",
            "export its depth images and camera with the ZED SDK (ZED_SVO_Export)"},
    Foreign{".oni", "NI10", "a recording of OpenNI", "export its depth images as 16-bit PNG"},
    Foreign{".klg", "", "a log of ElasticFusion", "export its depth images as 16-bit PNG"},
    Foreign{".pcap", "", "a lidar's network packets", "export its sweeps as PCD or LAS"},
    Foreign{".rcp", "", "a project of ReCap", "export its scans as E57"},
    Foreign{".rcs", "", "a scan of ReCap", "export it as E57"},
    Foreign{".fls", "", "a scan of FARO", "export it as E57"},
    Foreign{".zfs", "", "a scan of Z+F", "export it as E57"},
    Foreign{".rdbx", "", "a scan of RIEGL", "export it as LAS or E57"},
    Foreign{".raw", "", "bare numbers without a size",
            "RealSense Viewer's need NAME_metadata.csv beside them: give their folder"},
    Foreign{".mp4", "", "a video", videos},
    Foreign{".mov", "", "a video", videos},
    Foreign{".avi", "RIFF", "a video", videos},
    Foreign{".pdf", "%PDF", "a document", "expected a recording, a depth image or a cloud"},
};

const Foreign* foreign_format(const fs::path& file, std::string_view start) {
    const std::string extension = lower_extension(file);
    const auto by_name = std::ranges::find(foreign, extension, &Foreign::extension);
    const auto* const found =
        by_name != foreign.end() ? by_name : std::ranges::find_if(foreign, [&](const Foreign& row) {
            return !row.begins.empty() && start.starts_with(row.begins);
        });
    return found == foreign.end() ? nullptr : found;
}

bool is_text(std::string_view start) {
    return !start.empty() && std::ranges::none_of(start, [](unsigned char c) { return c < 9 || (c > 13 && c < 32); });
}

/// "9 .jpg, 2 .txt", the most frequent first, at most five kinds.
std::string kinds_of(const FolderFiles& files) {
    constexpr std::size_t most = 5;
    std::map<std::string, std::size_t> counts;
    for (const fs::path& file : files)
        ++counts[file.has_extension() ? lower_extension(file) : "without extension"];
    std::vector<std::pair<std::string, std::size_t>> rows(counts.begin(), counts.end());
    std::ranges::stable_sort(rows, [](const auto& a, const auto& b) { return a.second > b.second; });
    std::vector<std::string> words;
    for (const auto& [kind, count] : rows)
        if (words.size() < most)
            words.push_back(fmt::format("{} {}", count, kind));
    return fmt::format("{}{}", fmt::join(words, ", "), rows.size() > most ? " ..." : "");
}

/// Images that hold no depth, by what they are: "8-bit PNG of 3 channels", and the first of them.
struct Pictures {
    std::size_t count = 0;
    std::string first, facts;
    bool grey = false;
};

Pictures pictures_among(const FolderFiles& files) {
    constexpr std::size_t most_looks = 1000;
    Pictures found;
    for (std::size_t i = 0; i < std::min(files.size(), most_looks); ++i) {
        const fs::path file = files[i];
        if (!has_depth_extension(file) && !has_colour_extension(file))
            continue;
        try {
            const ImageFacts facts = peek(file);
            if (!facts.format || ++found.count > 1)
                continue;
            found.first = file.filename().string();
            found.facts = fmt::format("{} of {} bits, {}", facts.format->name, facts.bits,
                                      counted(static_cast<std::size_t>(facts.channels), "channel"));
            found.grey = facts.channels == 1;
        } catch (const Error&) { // what cannot be read is no near miss
        }
    }
    return found;
}

std::string of_pictures(const Pictures& pictures) {
    const std::string which = fmt::format(
        "{}{} ({})", pictures.first,
        pictures.count > 1 ? fmt::format(" and {} more {}", pictures.count - 1, pictures.count > 2 ? "images" : "image")
                           : "",
        pictures.facts);
    if (pictures.grey)
        return which + ": 8 bits are too few for distances; depth is 16-bit integers or floats";
    return which +
           ": a picture, also of depth in colours, holds no distances; depth is 16-bit integers or floats of one "
           "channel. Pictures of a chessboard calibrate a camera: `scanshade refine --board COLUMNSxROWS`";
}

/// Of a text that is no cloud.
std::string what_is_in_text(std::string_view start) {
    const std::string_view line = start.substr(0, start.find_first_of("\r\n"));
    std::string lower(line);
    std::ranges::transform(lower, lower.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    const bool degrees = lower.find("lat") != std::string::npos && lower.find("lon") != std::string::npos;
    return fmt::format("text that begins with {}: {}", in_quotes(line.substr(0, 40)),
                       degrees ? "latitudes and longitudes are no lengths: project them to metres"
                               : "no cloud, which is eight lines or more of x y z, also with intensity, colours, "
                                 "normals, or names in the first line");
}

} // namespace

std::string what_it_is(const fs::path& file, std::string_view start) {
    if (const Foreign* const format = foreign_format(file, start))
        return fmt::format("{}, which is not read: {}", format->name, format->instead);
    if (start.empty())
        return "empty file (0 bytes), expected a recording, a depth image or a cloud";
    const std::string_view line = start.substr(0, start.find_first_of("\r\n"));
    constexpr const char* more = "`scanshade help formats` lists what is read";
    if (!is_text(start))
        return fmt::format("begins with {}, as no recording, depth image or cloud that is known; {}",
                           in_quotes(start.substr(0, 8)), more);
    if (start.find_first_not_of(" \t\r\n") != std::string_view::npos &&
        (trimmed(line).starts_with('{') || trimmed(line).starts_with('[')))
        return fmt::format("JSON: no capture by itself. Give the folder that it lies in, or a camera with --camera; {}",
                           more);
    return fmt::format("{}; {}", what_is_in_text(start), more);
}

std::string why_no_frames(const fs::path& folder) {
    constexpr std::size_t most_lines = 3;
    const FolderFiles files = files_in(folder);
    std::vector<std::string> lines;
    for (const char* name : {"depth", "depths", "Depth", "depth_images"})
        if (is_folder(folder / name)) {
            const FolderFiles inside = files_in(folder / name);
            const Pictures pictures = pictures_among(inside);
            lines.push_back(inside.empty() ? fmt::format("{}/: it is empty", name)
                            : pictures.count == 0
                                ? fmt::format("{}/: {}, none of them an image of depth", name, kinds_of(inside))
                                : fmt::format("{}/{}", name, of_pictures(pictures)));
        }
    for (const fs::path& file : files) {
        constexpr std::size_t enough = 16;
        const Foreign* const format = foreign_format(file, "");
        const bool told = std::ranges::any_of(
            lines, [&](const std::string& line) { return format && line.find(format->name) != std::string::npos; });
        if (format && !told && lines.size() < most_lines && !read_bytes(file, enough).empty())
            lines.push_back(
                fmt::format("{}: {}, which is not read: {}", file.filename().string(), format->name, format->instead));
    }
    if (const Pictures pictures = pictures_among(files); pictures.count > 0)
        lines.push_back(of_pictures(pictures));
    constexpr std::array tables{".txt", ".csv", ".asc", ".dat"};
    for (const fs::path& file : files) {
        constexpr std::size_t enough = 4096;
        if (!lines.empty() || std::ranges::find(tables, lower_extension(file)) == tables.end())
            continue;
        const std::string start = read_bytes(file, enough);
        lines.push_back(fmt::format("{}: {}", file.filename().string(),
                                    is_cloud(start, file) ? "points as text, beside other files: give the file itself"
                                                          : what_is_in_text(start)));
    }
    std::string text = files.empty()
                           ? ": it holds no files"
                           : fmt::format(": it holds {} ({})", counted(files.size(), "file"), kinds_of(files));
    for (std::size_t i = 0; i < std::min(lines.size(), most_lines); ++i)
        text += "\n  " + lines[i];
    return text +
           (lines.empty() ? "; a capture has depth/ or depth.txt, depth images, clouds or a recording in it" : "") +
           (lines.empty() ? "; `" : "\n  `") + "scanshade help formats` lists what is read";
}

} // namespace scanshade
