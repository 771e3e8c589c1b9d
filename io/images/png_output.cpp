// Images as PNG files, the most common output. ISA-L packs them in a quarter of zlib's time, to the same size.
#include "io/images/png_output.h"

#include "projection/error.h"

#include <algorithm>
#include <fmt/format.h>
#include <isa-l/crc.h>
#include <isa-l/igzip_lib.h>
#include <memory>
#include <stdexcept>
#include <string_view>

namespace scanshade {
namespace {

const std::uint8_t* as_bytes(const char* text) { return reinterpret_cast<const std::uint8_t*>(text); }

void append_32(std::string& bytes, std::size_t value) { // most significant byte first
    for (int shift = 24; shift >= 0; shift -= 8)
        bytes += static_cast<char>(value >> shift & 0xff);
}

void append_chunk(std::string& bytes, std::string_view type, std::string_view content) {
    append_32(bytes, content.size());
    const std::size_t covered = bytes.size();
    bytes.append(type).append(content);
    append_32(bytes, crc32_gzip_refl(0, as_bytes(bytes.data()) + covered, bytes.size() - covered));
}

std::string header_of(const cv::Mat& image) {
    std::string header;
    append_32(header, static_cast<std::size_t>(image.cols));
    append_32(header, static_cast<std::size_t>(image.rows));
    header += image.depth() == CV_16U ? '\x10' : '\x08';
    header += image.channels() == 3 ? '\x02' : '\0'; // RGB or grey
    return header + std::string(3, '\0');            // deflate, the five filters, not interlaced
}

/// A row's samples in PNG's order: red first, high byte first.
void copy_samples(const cv::Mat& image, int row, unsigned char* to) {
    const int samples = image.cols * image.channels();
    if (image.depth() == CV_16U) {
        const ushort* from = image.ptr<ushort>(row);
        for (int i = 0; i < samples; ++i) {
            const ushort value = from[image.channels() == 3 ? i + 2 - 2 * (i % 3) : i];
            to[2 * i] = static_cast<unsigned char>(value >> 8);
            to[2 * i + 1] = static_cast<unsigned char>(value & 0xff);
        }
        return;
    }
    const uchar* from = image.ptr<uchar>(row);
    if (image.channels() == 1)
        std::copy_n(from, samples, to);
    else
        for (int i = 0; i < samples; i += 3) {
            to[i] = from[i + 2];
            to[i + 1] = from[i + 1];
            to[i + 2] = from[i];
        }
}

/// Rows as differences to the pixel on the left (filter 1, Sub), each behind the filter's number.
std::string filtered(const cv::Mat& rows) {
    const std::size_t pixel = rows.elemSize(), row = pixel * static_cast<std::size_t>(rows.cols);
    std::string bytes((row + 1) * static_cast<std::size_t>(rows.rows), '\1');
    const auto samples = std::make_unique<unsigned char[]>(row + pixel); // a pixel of zeros comes first
    for (int v = 0; v < rows.rows; ++v) {
        copy_samples(rows, v, samples.get() + pixel);
        char* to = bytes.data() + static_cast<std::size_t>(v) * (row + 1) + 1;
        for (std::size_t i = 0; i < row; ++i)
            to[i] = static_cast<char>(samples[i + pixel] - samples[i]);
    }
    return bytes;
}

/// A zlib stream of level 3. Level 0 has only fixed codes and makes maps larger. Levels 1 and 2 are not deterministic:
/// the third byte's slot in their table depends on the address of `stream`, because ISA-L 2.30's assembly hashes a
/// register that is not set yet. Sometimes the same pixels were therefore packed into other bytes.
class Packer {
  public:
    Packer() : scratch_(std::make_unique<std::uint8_t[]>(ISAL_DEF_LVL3_DEFAULT)) {
        isal_deflate_init(&stream_);
        stream_.level = 3;
        stream_.level_buf = scratch_.get();
        stream_.level_buf_size = ISAL_DEF_LVL3_DEFAULT;
        stream_.gzip_flag = IGZIP_ZLIB;
    }
    void append(const std::string& bytes, bool last, std::string& packed) {
        stream_.next_in = const_cast<std::uint8_t*>(as_bytes(bytes.data())); // is only read
        stream_.avail_in = static_cast<std::uint32_t>(bytes.size());
        stream_.end_of_stream = last ? 1 : 0;
        std::string piece(bytes.size() + bytes.size() / 8 + 1024, '\0'); // incompressible data are stored
        do {
            stream_.next_out = reinterpret_cast<std::uint8_t*>(piece.data());
            stream_.avail_out = static_cast<std::uint32_t>(piece.size());
            if (const int code = isal_deflate(&stream_); code != COMP_OK)
                throw std::runtime_error(fmt::format("pixels could not be packed: ISA-L's code {}", code));
            packed.append(piece, 0, piece.size() - stream_.avail_out);
        } while (stream_.avail_out == 0);
        if (last && stream_.internal_state.state != ZSTATE_END)
            throw std::runtime_error("pixels could not be packed: ISA-L did not end its stream");
    }

  private:
    std::unique_ptr<std::uint8_t[]> scratch_;
    isal_zstream stream_ = {};
};

/// The image's pixels, packed. A large image goes in bands: the filtered bytes of all would take as much memory again.
std::string packed(const cv::Mat& image) {
    constexpr std::size_t band_bytes = std::size_t(1) << 26;
    const std::size_t row = image.elemSize() * static_cast<std::size_t>(image.cols) + 1;
    const int rows_at_once = static_cast<int>(std::clamp<std::size_t>(band_bytes / row, 1, 1 << 24));
    Packer packer;
    std::string result;
    for (int from = 0; from < image.rows; from += rows_at_once) {
        const int to = std::min(from + rows_at_once, image.rows);
        packer.append(filtered(image.rowRange(from, to)), to == image.rows, result);
    }
    return result;
}

} // namespace

std::string encoded_png(const cv::Mat& image) {
    const bool depth = image.depth() == CV_8U || image.depth() == CV_16U;
    if (image.empty() || !depth || (image.channels() != 1 && image.channels() != 3))
        throw Error(fmt::format("no PNG holds {}x{} pixels of OpenCV's type {}", image.cols, image.rows, image.type()));
    constexpr std::size_t most = std::size_t(1) << 30; // chunks end at 2^31 - 1 bytes
    const std::string pixels = packed(image);
    std::string bytes = "\x89PNG\r\n\x1a\n";
    append_chunk(bytes, "IHDR", header_of(image));
    for (std::size_t at = 0; at < pixels.size(); at += most)
        append_chunk(bytes, "IDAT", std::string_view(pixels).substr(at, most));
    append_chunk(bytes, "IEND", {});
    return bytes;
}

} // namespace scanshade
