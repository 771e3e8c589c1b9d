// The table of recordings: names, what tells them, what is in them, readers. A new layout or container is a row in
// recording_formats.cpp and a file beside it.
#pragma once

#include "io/captures/listing/layouts.h"

#include <span>
#include <string_view>

namespace scanshade {

/// A function that lists a recording; most need no options.
template <class Found>
class RecordingReader {
  public:
    using Plain = Found (*)(const std::filesystem::path& path);
    using WithOptions = Found (*)(const std::filesystem::path& path, const CaptureOptions& options);

    constexpr RecordingReader() = default;
    constexpr RecordingReader(Plain read) : plain_(read) {}
    constexpr RecordingReader(WithOptions read) : with_options_(read) {}

    constexpr explicit operator bool() const { return plain_ || with_options_; }
    [[nodiscard]] Found operator()(const std::filesystem::path& path, const CaptureOptions& options) const {
        return plain_ ? plain_(path) : with_options_(path, options);
    }

  private:
    Plain plain_ = nullptr;
    WithOptions with_options_ = nullptr;
};

struct RecordingFormat {
    const char* name;       ///< what `inspect` calls it
    const char* recognised; ///< by which files in the folder, or how the file begins
    const char* depth;      ///< its encoding and unit
    const char* camera;     ///< where it comes from

    RecordingReader<std::optional<Listing>> folder = {}; ///< of a folder; none: it is a file
    bool (*begins)(std::string_view start) = nullptr;    ///< whether a file that begins so is one
    RecordingReader<Listing> file = {};                  ///< of such a file
    const char* extensions = "";                         ///< what such files are called mostly; nothing relies on it
    bool generic = false; ///< nothing but images: what looks like poses or cameras beside them may be another layout's
};

/// Folders in the order in which they are tried, the most specific first. A row without functions is found by the
/// reader of another: the listing's kind names it.
[[nodiscard]] std::span<const RecordingFormat> recording_formats();

} // namespace scanshade
