// Fuzz target: depth, colour and AO images of every format, and a picture's EXIF.
#include "io/images/exif.h"
#include "io/images/format.h"
#include "io/images/image_file.h"
#include "tests/fuzz/fuzz.h"

#include <zlib.h>

namespace {

using namespace scanshade;
using namespace scanshade::fuzz;

/// With checksums that fit: a fuzzer hardly ever guesses one, and would never get behind them.
std::string with_checksums(std::string bytes) {
    for (std::size_t at = 8; name_of(image_format(bytes)) == "PNG" && at + 12 <= bytes.size();) {
        const std::size_t length = image_check::big_endian_32(bytes, at);
        if (length > bytes.size() - at - 12)
            break;
        const auto sum = crc32(0, reinterpret_cast<const Bytef*>(bytes.data()) + at + 4, static_cast<uInt>(length + 4));
        for (unsigned i = 0; i < 4; ++i)
            bytes[at + 8 + length + i] = static_cast<char>(sum >> (24 - 8 * i));
        at += 12 + length;
    }
    return bytes;
}

void read_all_ways(const std::filesystem::path& file) {
    (void)accepted([&] { (void)peek(file); });
    (void)accepted([&] { (void)read_stored_colour(file); });
    (void)accepted([&] { (void)read_ao(file); });
    cv::Mat stored;
    if (!accepted([&] { stored = read_stored_depth(file); }))
        return;
    for (const char* encoding : {"mm", "sun", "nyu", "m", "2000"})
        (void)accepted([&] { (void)depth_in_metres(stored, depth_encoding(encoding, "fuzz")); });
}

} // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const std::string bytes(text_of(data, size));
    const auto file = as_file(with_checksums(bytes), "image");
    read_all_ways(file);
    (void)exif_focal_length_px(file, {64, 48});
    return 0;
}
