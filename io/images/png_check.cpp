// PNG's container (W3C PNG, section 5): header, chunk lengths, checksums and end, for both readers of
// its pixels. ISA-L and libpng themselves check that no pixels are missing.
#include "io/checksum.h"
#include "io/images/readers.h"

#include <fmt/format.h>
#include <isa-l/crc.h>

namespace scanshade::images {

namespace {

using image_check::big_endian_32;
using image_check::refuse;

constexpr std::size_t signature_length = 8;
constexpr std::size_t chunk_overhead = 12; // length, type, checksum

int channels_of(int colour_type) {
    switch (colour_type) {
    case 0:
        return 1; // grey
    case 2:       // RGB
    case 3:       // palette, RGB once decoded
        return 3;
    case 4:
        return 2; // grey and alpha
    case 6:
        return 4; // RGB and alpha
    default:
        return 0;
    }
}

} // namespace

ImageFacts png_header(std::string_view bytes, const Path& file) {
    constexpr std::size_t header_end = signature_length + chunk_overhead + 13;
    if (bytes.size() < header_end)
        refuse(file, fmt::format("PNG ends early: {} bytes, the header alone takes {}", bytes.size(), header_end));
    if (big_endian_32(bytes, 8) != 13 || bytes.substr(12, 4) != "IHDR")
        refuse(file, "PNG does not start with its header IHDR");
    ImageFacts facts;
    facts.size = image_check::checked_size(big_endian_32(bytes, 16), big_endian_32(bytes, 20), file);
    facts.bits = static_cast<unsigned char>(bytes[24]);
    facts.channels = channels_of(static_cast<unsigned char>(bytes[25]));
    const bool legal_bits =
        facts.bits == 1 || facts.bits == 2 || facts.bits == 4 || facts.bits == 8 || facts.bits == 16;
    if (facts.channels == 0 || !legal_bits)
        refuse(file, fmt::format("PNG header says {} bits and colour type {}, which is not PNG", facts.bits,
                                 static_cast<unsigned char>(bytes[25])));
    if (facts.channels == 2) // how opaque it is, is left out: grey
        facts.channels = 1;
    return facts;
}

void check_png_chunks(std::string_view bytes, const ImageFacts& facts, const Path& file) {
    std::uint64_t packed = 0;
    for (std::size_t at = signature_length;;) {
        if (bytes.size() - at < chunk_overhead)
            refuse(file, fmt::format("PNG ends early at byte {} of its data: no end chunk IEND", bytes.size()));
        const std::size_t length = big_endian_32(bytes, at);
        const std::string_view type = bytes.substr(at + 4, 4);
        if (length > bytes.size() - at - chunk_overhead)
            refuse(file, fmt::format("PNG ends early at byte {}: the chunk at byte {} says {} bytes, {} are there",
                                     bytes.size(), at, length, bytes.size() - at - 8));
        const std::string_view covered = bytes.substr(at + 4, length + 4);
        const auto* first = reinterpret_cast<const std::uint8_t*>(covered.data());
        const std::uint32_t sum = crc32_gzip_refl(0, first, covered.size());
        if (!sums_agree(sum, big_endian_32(bytes, at + 8 + length)))
            refuse(file, fmt::format("PNG is damaged: checksum (CRC) of the chunk at byte {} does not match", at));
        if (type == "IEND")
            break;
        if (type == "IDAT")
            packed += length;
        at += chunk_overhead + length;
    }
    constexpr std::uint64_t deflate_most = 1032; // a match of 258 bytes takes two bits
    constexpr char palette = 3;
    image_check::check_expansion(packed, deflate_most, facts, bytes[25] == palette ? 1 : channels_of(bytes[25]), file);
}

} // namespace scanshade::images
