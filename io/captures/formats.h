// All formats as one table for people and programs: the rows of recordings, images, clouds and cameras, each of which
// stands once, in its own room, beside the functions that read and write it. `help formats`, `help --json` and the
// READMEs' tables are printed from it.
#pragma once

#include <span>
#include <string>
#include <vector>

namespace scanshade {

enum class FormatKind { recording_folder, recording_file, depth_image, colour_image, cloud, camera, output };
/// "recording folder", "depth image" ...
[[nodiscard]] const char* name_of(FormatKind kind);

struct Format {
    FormatKind kind = FormatKind::output;
    std::string name, recognised;
    std::vector<std::string> extensions = {}; ///< with the dot
    std::string content = {};                 ///< of recordings and images the depth: encoding and unit
    std::string camera = {};                  ///< of recordings: where it comes from
    bool read = true, written = false;
};

/// By kind, and in each by the order in which they are tried. An image format that may hold depth and colour is there
/// as both.
[[nodiscard]] std::vector<Format> formats();
/// The names of those that are read of this kind.
[[nodiscard]] std::vector<std::string> format_names(FormatKind kind);

/// The formats that are read, by use, as a table of Markdown of a few lines.
[[nodiscard]] std::string formats_in_short();
/// All, a table of Markdown for each use.
[[nodiscard]] std::string formats_in_full();

} // namespace scanshade
