// TIFF's first directory (TIFF 6.0, section 2) and OpenEXR's header: sizes before decoding, strips inside the file.
#include "io/images/image_check.h"

#include "io/text.h"

#include <algorithm>
#include <cstring>
#include <fmt/format.h>
#include <numeric>
#include <optional>
#include <vector>

namespace scanshade::image_check {

namespace {

// --- TIFF ---

struct TiffReader {
    std::string_view bytes;
    const std::filesystem::path& file;
    bool big_endian;

    [[nodiscard]] std::uint64_t unsigned_at(std::uint64_t offset, unsigned length) const {
        if (offset > bytes.size() || length > bytes.size() - offset)
            refuse(file,
                   fmt::format("TIFF ends early: {} bytes, something is said to lie at byte {}", bytes.size(), offset));
        std::uint64_t value = 0;
        for (unsigned i = 0; i < length; ++i) {
            const auto byte = static_cast<unsigned char>(bytes[offset + (big_endian ? i : length - 1 - i)]);
            value = value << 8 | byte;
        }
        return value;
    }
};

struct TiffEntry {
    std::uint64_t tag, type, count, at; ///< at: where the values lie
};

unsigned type_length(std::uint64_t type) { return type == 3 ? 2 : type == 4 ? 4 : 1; } // SHORT, LONG, else BYTE

std::vector<TiffEntry> first_directory(const TiffReader& tiff) {
    const std::uint64_t start = tiff.unsigned_at(4, 4);
    const std::uint64_t count = tiff.unsigned_at(start, 2);
    std::vector<TiffEntry> entries;
    for (std::uint64_t i = 0; i < count; ++i) {
        const std::uint64_t at = start + 2 + 12 * i;
        TiffEntry entry{tiff.unsigned_at(at, 2), tiff.unsigned_at(at + 2, 2), tiff.unsigned_at(at + 4, 4), at + 8};
        if (entry.count * type_length(entry.type) > 4)
            entry.at = tiff.unsigned_at(at + 8, 4);
        entries.push_back(entry);
    }
    return entries;
}

std::vector<std::uint64_t> values(const TiffReader& tiff, const std::vector<TiffEntry>& entries, std::uint64_t tag) {
    const auto entry = std::find_if(entries.begin(), entries.end(), [&](const TiffEntry& e) { return e.tag == tag; });
    if (entry == entries.end())
        return {};
    const unsigned length = type_length(entry->type);
    if (entry->count > tiff.bytes.size() / length)
        refuse(tiff.file,
               fmt::format("TIFF tag {} claims {} values in {} bytes", tag, entry->count, tiff.bytes.size()));
    std::vector<std::uint64_t> found(entry->count);
    for (std::uint64_t i = 0; i < entry->count; ++i)
        found[i] = tiff.unsigned_at(entry->at + i * length, length);
    return found;
}

/// Strips or tiles must lie in the file: libtiff fills what is missing with zeros.
void check_pieces(const TiffReader& tiff, const std::vector<std::uint64_t>& offsets,
                  const std::vector<std::uint64_t>& counts) {
    if (offsets.empty() || offsets.size() != counts.size())
        refuse(tiff.file,
               fmt::format("TIFF lists {} pieces of image data and {} lengths", offsets.size(), counts.size()));
    for (std::size_t i = 0; i < offsets.size(); ++i)
        if (offsets[i] > tiff.bytes.size() || counts[i] > tiff.bytes.size() - offsets[i])
            refuse(tiff.file, fmt::format("TIFF ends early: {} bytes, piece {} of the image lies at bytes {} to {}",
                                          tiff.bytes.size(), i + 1, offsets[i], offsets[i] + counts[i]));
}

/// How many bytes one coded byte can become; none where nothing is known of the compression.
std::optional<std::uint64_t> tiff_expansion(std::uint64_t compression) {
    switch (compression) {
    case 1:
        return 1; // none
    case 5:
        return 4096; // LZW: a code of 12 bits stands for fewer bytes than there are codes
    case 8:
    case 32946:
        return 1032; // deflate
    case 32773:
        return 128; // PackBits
    default:
        return std::nullopt;
    }
}

// --- EXR ---

std::uint32_t little_endian_32(std::string_view bytes, std::size_t at) {
    std::uint32_t value = 0;
    std::memcpy(&value, bytes.data() + at, sizeof value);
    return value;
}

/// The value of one header attribute: name, type, length, bytes; a list that an empty name ends.
std::optional<std::string_view> exr_attribute(std::string_view bytes, const std::filesystem::path& file,
                                              std::string_view wanted) {
    for (std::size_t at = 8;;) {
        const auto name_end = bytes.find('\0', std::min(at, bytes.size()));
        if (name_end == std::string_view::npos)
            refuse(file, "EXR ends inside its header");
        if (name_end == at)
            return std::nullopt;
        const auto type_end = bytes.find('\0', name_end + 1);
        if (type_end == std::string_view::npos || bytes.size() - type_end < 5)
            refuse(file, "EXR ends inside its header");
        const std::size_t length = little_endian_32(bytes, type_end + 1);
        const std::size_t value_at = type_end + 5;
        if (length > bytes.size() - value_at)
            refuse(file, "EXR ends inside its header");
        if (bytes.substr(at, name_end - at) == wanted)
            return bytes.substr(value_at, length);
        at = value_at + length;
    }
}

int exr_channels(std::string_view list) {
    int count = 0;
    for (std::size_t at = 0; at < list.size() && list[at] != '\0'; ++count) {
        const auto name_end = list.find('\0', at);
        if (name_end == std::string_view::npos)
            break;
        at = name_end + 1 + 16;
    }
    return count;
}

} // namespace

ImageFacts tiff_facts(std::string_view bytes, const std::filesystem::path& file) {
    const TiffReader tiff{bytes, file, bytes[0] == 'M'};
    const auto entries = first_directory(tiff);
    const auto one = [&](std::uint64_t tag, std::uint64_t otherwise) {
        const auto found = values(tiff, entries, tag);
        return found.empty() ? otherwise : found[0];
    };
    ImageFacts facts;
    facts.format = ImageFormat::tiff;
    facts.size = checked_size(one(256, 0), one(257, 0), file);
    facts.channels = static_cast<int>(std::min<std::uint64_t>(one(277, 1), 255));
    facts.bits = static_cast<int>(std::min<std::uint64_t>(one(258, 1), 255));
    facts.floats = one(339, 1) == 3;
    const bool tiled = !values(tiff, entries, 324).empty();
    const auto lengths = values(tiff, entries, tiled ? 325 : 279);
    check_pieces(tiff, values(tiff, entries, tiled ? 324 : 273), lengths);
    if (const auto most = tiff_expansion(one(259, 1)))
        check_expansion(std::accumulate(lengths.begin(), lengths.end(), std::uint64_t(0)), *most, facts, facts.channels,
                        file);
    return facts;
}

ImageFacts exr_facts(std::string_view bytes, const std::filesystem::path& file) {
    if (bytes.size() < 8)
        refuse(file, fmt::format("EXR ends early: {} bytes", bytes.size()));
    const auto window = exr_attribute(bytes, file, "dataWindow");
    const auto channels = exr_attribute(bytes, file, "channels");
    if (!window || window->size() != 16 || !channels)
        refuse(file, "EXR header lacks dataWindow or channels");
    const auto corner = [&](std::size_t i) {
        return std::int64_t(static_cast<std::int32_t>(little_endian_32(*window, 4 * i)));
    };
    const auto width = corner(2) - corner(0) + 1, height = corner(3) - corner(1) + 1;
    ImageFacts facts;
    facts.format = ImageFormat::exr;
    facts.size = checked_size(static_cast<std::uint64_t>(std::max<std::int64_t>(width, 0)),
                              static_cast<std::uint64_t>(std::max<std::int64_t>(height, 0)), file);
    facts.channels = exr_channels(*channels);
    facts.floats = true;
    facts.bits = 32;
    return facts;
}

} // namespace scanshade::image_check
