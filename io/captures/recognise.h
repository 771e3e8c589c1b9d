// Opening, first step: which recording, depth image or cloud a path is.
#pragma once

#include "io/captures/listing/layouts.h"

namespace scanshade {

/// By the table of recordings, and for single files by their content. Throws NoFrames, which names what was looked for,
/// for a folder that is none of these; Error for such a file.
[[nodiscard]] Listing list_capture(const std::filesystem::path& path, const CaptureOptions& options);

} // namespace scanshade
