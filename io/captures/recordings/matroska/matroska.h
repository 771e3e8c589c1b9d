// Matroska (RFC 9559) in EBML (RFC 8794), as far as recordings of frames need it: tracks, tags, attached files, and
// where each block's bytes are. No codec is known here.
#pragma once

#include "io/file_bytes.h"

#include <cstdint>
#include <opencv2/core.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace scanshade::matroska {

struct Track {
    std::uint64_t number = 0, uid = 0;
    bool video = false;
    std::string name, codec, codec_private;
    double width = 0, height = 0; ///< pixels, as the file says
    std::int64_t duration_ns = 0; ///< of a frame; 0 = not given
    bool packed = false;          ///< each block is compressed or encrypted as a whole
};

struct Tag {
    std::string name, value;
    std::uint64_t track_uid = 0, attachment_uid = 0; ///< what it is about; 0 = the whole file
};

struct Attachment {
    std::string name;
    std::uint64_t uid = 0, at = 0, bytes = 0; ///< where its bytes are in the file
};

/// What a track has for one instant.
struct Block {
    std::uint64_t track = 0; ///< its number
    std::int64_t time_ns = 0;
    std::uint64_t at = 0, bytes = 0; ///< where its bytes are in the file
    bool laced = false;              ///< several frames in one: they start with their number and sizes
};

struct Contents {
    std::vector<Track> tracks;
    std::vector<Tag> tags;
    std::vector<Attachment> attachments;
    std::vector<Block> blocks;         ///< of video tracks, in the file's order
    std::vector<std::string> warnings; ///< damage, and what was left out: complete sentences
};

/// Whether a file that starts so is EBML: Matroska or WebM, as a rule.
[[nodiscard]] bool is_matroska(std::string_view start);

/// In one pass over the heads of the elements, without an index. What is whole in a damaged or unfinished file is
/// found: after damage, reading goes on at the next cluster. Throws Error naming file and byte where it is no Matroska
/// file, or has more elements than any recording.
[[nodiscard]] Contents read(const FileBytes& file);

} // namespace scanshade::matroska
