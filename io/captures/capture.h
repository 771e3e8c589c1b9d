// Open a recording, list its frames, load one: the first steps of the walk.
#pragma once

#include "io/captures/listing/capture_listing.h"

#include <filesystem>
#include <string>
#include <vector>

namespace scanshade {

/// Opens a folder (its content determines the layout), a single depth image, or a cloud file.
/// Throws Error "no frames found in ..." if there are none, with the file names it looked for.
[[nodiscard]] Capture open_capture(const std::filesystem::path& path, const CaptureOptions& options = {});
/// The same; a folder without frames of its own, one of whose folders is a capture, stands for that one, with a
/// warning. Throws Error naming them where several are.
[[nodiscard]] Capture open_capture_at_or_below(const std::filesystem::path& path, const CaptureOptions& options = {});
/// For what measures in metres. Throws Error, which names `what`, where the capture's unit is arbitrary.
void require_metres(const Capture& capture, const std::string& what);

/// The folders in `path` that are captures by themselves; empty where there are none.
[[nodiscard]] std::vector<std::filesystem::path> captures_below(const std::filesystem::path& path,
                                                                const CaptureOptions& options = {});

} // namespace scanshade
