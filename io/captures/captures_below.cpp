// Captures in the folders and tars of a folder that is none itself.
#include "io/captures/capture.h"

#include "io/captures/listing/layouts.h"
#include "io/files.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <array>
#include <fmt/format.h>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

bool is_recording_by_name(const std::string& name) {
    constexpr std::array extensions{".bag", ".mcap", ".db3", ".sens", ".r3d"};
    return std::ranges::count(extensions, lower_extension(name)) > 0;
}

bool may_be_capture(const fs::path& file) {
    try {
        return lower_extension(file) == ".tar" ? is_tar(file) : is_recording_file(file);
    } catch (const Error&) { // nobody may read it
        return false;
    }
}

/// The captures in the folder's own folders, recordings and tars, and the last one opened: opening may read a whole
/// recording.
std::vector<fs::path> captures_below(const fs::path& path, const CaptureOptions& options,
                                     std::optional<Capture>& last) {
    std::vector<fs::path> captures;
    std::error_code ignored;
    for (const auto& [name, kind] : items_in(path, ignored)) {
        if (name.starts_with('.') || (kind != FolderItem::Kind::folder && !may_be_capture(path / name)))
            continue;
        try {
            last = open_capture(path / name, options);
            captures.push_back(path / name);
        } catch (const NoFrames&) { // but for videos and archives beside captures, a recording is missed
            if (is_recording_by_name(name))
                captures.push_back(path / name);
        }
    }
    std::ranges::sort(captures);
    return captures;
}

} // namespace

std::vector<fs::path> captures_below(const fs::path& path, const CaptureOptions& options) {
    std::optional<Capture> last;
    return captures_below(path, options, last);
}

Capture open_capture_at_or_below(const fs::path& path, const CaptureOptions& options) {
    try {
        return open_capture(path, options);
    } catch (const NoFrames&) {
        std::optional<Capture> last;
        const std::vector<fs::path> captures = captures_below(path, options, last);
        if (captures.empty() || (captures.size() == 1 && !last))
            throw;
        if (captures.size() > 1)
            throw SeveralCaptures(
                fmt::format("{}: {} captures lie in it, among them {} and {}; name one, or let `plan` list them",
                            path.string(), captures.size(), captures[0].filename().string(),
                            captures[1].filename().string()),
                captures);
        last->warnings.insert(last->warnings.begin(), fmt::format("{}: no frames of its own; its folder {} is opened.",
                                                                  path.string(), captures[0].filename().string()));
        return *std::move(last);
    }
}

} // namespace scanshade
