// Opening, first step: which recording, depth image or cloud a path is, by its content, and what it lists. The messages
// about those that are none.
#include "io/captures/recognise.h"

#include "io/captures/formats.h"
#include "io/captures/near_misses.h"
#include "io/captures/recording_formats.h"
#include "io/clouds/cloud_file.h"
#include "io/clouds/format.h"
#include "io/files.h"
#include "io/images/format.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <fmt/format.h>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t enough_for_signatures = 1 << 12;

/// Of a file that begins so; null where it holds no recording.
const RecordingFormat* recording_format(std::string_view start) {
    const auto rows = recording_formats();
    const auto found = std::ranges::find_if(rows, [&](const auto& row) { return row.begins && row.begins(start); });
    return found == rows.end() ? nullptr : &*found;
}

Listing named(Listing listing, const RecordingFormat& format) {
    listing.generic = format.generic;
    if (listing.capture.kind.empty())
        listing.capture.kind = format.name;
    return listing;
}

/// A folder's only file that holds a recording; of several, each is a capture by itself.
std::optional<fs::path> recording_in(const fs::path& folder) {
    std::vector<fs::path> recordings;
    for (const fs::path& file : files_in(folder))
        if (is_recording_file(file))
            recordings.push_back(file);
    if (recordings.size() > 1)
        throw NoFrames(fmt::format("{}: {} recordings, each a capture by itself: open {} or another by its name",
                                   folder.string(), recordings.size(), recordings.front().filename().string()));
    return recordings.empty() ? std::nullopt : std::optional(recordings.front());
}

[[noreturn]] void refuse_folder(const fs::path& folder) {
    throw NoFrames(fmt::format("no frames found in {}{}", folder.string(), why_no_frames(folder)));
}

Listing list_folder(const fs::path& folder, const CaptureOptions& options) {
    for (const RecordingFormat& format : recording_formats())
        if (auto listing = format.folder ? format.folder(folder, options) : std::nullopt)
            return named(*std::move(listing), format);
    const auto file = recording_in(folder);
    if (!file)
        refuse_folder(folder);
    const RecordingFormat& format = *recording_format(read_bytes(*file, enough_for_signatures));
    return named(format.file(*file, options), format);
}

[[noreturn]] void refuse_file(const fs::path& file, std::string_view start) {
    throw Error(fmt::format("{}: {}", file.string(), what_it_is(file, start)));
}

/// As a shell takes it.
std::string quoted(const std::string& word) {
    const auto plain = [](unsigned char c) {
        return std::isalnum(c) != 0 || std::string_view("/._-+:").find(static_cast<char>(c)) != std::string::npos;
    };
    if (std::ranges::all_of(word, plain))
        return word;
    std::string text = "'";
    for (const char c : word)
        text += c == '\'' ? std::string("'\\''") : std::string(1, c);
    return text + "'";
}

/// Files that are packed as a whole are not read: no frame could be reached without unpacking all before it, and every
/// command and every process of a job would unpack them anew.
void refuse_packed(std::string_view start, const fs::path& file) {
    struct Packer {
        std::string_view magic;
        const char* program;
    };
    constexpr std::array packers = {Packer{"\x1f\x8b", "gzip"}, Packer{"BZh", "bzip2"},
                                    Packer{std::string_view("\xfd"
                                                            "7zXZ\0",
                                                            6),
                                           "xz"},
                                    Packer{"\x28\xb5\x2f\xfd", "zstd"}, Packer{"\x04\x22\x4d\x18", "lz4"}};
    for (const Packer& packer : packers) {
        if (!start.starts_with(packer.magic))
            continue;
        const std::string extension = lower_extension(file);
        const bool tar = extension.starts_with(".t"); // .tgz, .tbz2, .txz, .tzst
        const fs::path stem = file.has_extension() ? file.parent_path() / file.stem() : file;
        const std::string whole = tar || !file.has_extension() ? stem.string() + ".tar" : stem.string();
        throw Error(
            fmt::format("{}: packed as a whole by {}, so that no frame can be reached by itself; unpack it once: "
                        "`{} -dc {} > {}`",
                        file.string(), packer.program, packer.program, quoted(file.string()), quoted(whole)));
    }
}

Listing list_file(const fs::path& file, const CaptureOptions& options) {
    const std::string start = read_bytes(file, enough_for_signatures);
    if (const RecordingFormat* format = recording_format(start))
        return named(format->file(file, options), *format);
    CaptureEntry entry;
    entry.name = file.stem().string();
    Listing listing;
    listing.find_camera = [](cv::Size, std::vector<std::string>&) { return std::nullopt; };
    if (is_cloud(start, file)) {
        entry.cloud = file;
        listing.capture.kind = name_of(FormatKind::cloud);
        listing.capture.depth = depth_encoding("m", "of clouds: metres by custom, or the unit that the file names");
        listing.capture.registration_reason = "colours belong to the points";
    } else {
        if (!image_format(start))
            refuse_packed(start, file);
        if (!image_format(start) && !has_depth_extension(file))
            refuse_file(file, start);
        entry.depth = file;
        listing.capture.kind = name_of(FormatKind::depth_image);
        listing.capture.depth = assumed_encoding(file);
        listing.capture.registration_reason = "there is no colour";
        listing.find_camera = [file](cv::Size, std::vector<std::string>&) { return camera_beside_pclzf(file); };
    }
    listing.capture.entries.push_back(std::move(entry));
    return listing;
}

} // namespace

bool is_recording_file(const fs::path& file) {
    return recording_format(read_bytes(file, enough_for_signatures)) != nullptr;
}

Listing list_capture(const fs::path& path, const CaptureOptions& options) {
    return is_folder(path) ? list_folder(path, options) : list_file(path, options);
}

} // namespace scanshade
