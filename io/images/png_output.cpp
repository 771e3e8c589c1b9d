// Images as PNG files, the most common output.
#include "io/images/png_output.h"

#include "io/compression/deflate.h"
#include "projection/base/error.h"

#include <algorithm>
#include <cstring>
#include <fmt/format.h>
#include <isa-l/crc.h>
#include <memory>
#include <opencv2/imgproc.hpp>
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

/// Rows with samples in PNG's order: red first, high byte first.
cv::Mat in_file_order(const cv::Mat& rows) {
    cv::Mat ordered; // not the rows themselves: these are the caller's
    if (rows.channels() == 3)
        cv::cvtColor(rows, ordered, cv::COLOR_BGR2RGB);
    else
        ordered = rows;
    if (rows.depth() != CV_16U)
        return ordered;
    cv::Mat swapped(ordered.size(), ordered.type());
    const int samples = ordered.cols * ordered.channels();
    for (int v = 0; v < ordered.rows; ++v) {
        const auto* from = ordered.ptr<std::uint16_t>(v);
        auto* to = swapped.ptr<std::uint16_t>(v);
        for (int i = 0; i < samples; ++i)
            to[i] = static_cast<std::uint16_t>(from[i] << 8 | from[i] >> 8);
    }
    return swapped;
}

/// Memory that is written before it is read: zeros would take as long as the filter.
struct Bytes {
    std::unique_ptr<char[]> data;
    std::size_t size = 0;

    explicit Bytes(std::size_t size_) : data(new char[size_]), size(size_) {}
};

void subtract(const uchar* a, const uchar* b, std::size_t count, char* to) {
    for (std::size_t i = 0; i < count; ++i)
        to[i] = static_cast<char>(a[i] - b[i]);
}

/// The rows from `from` to `to` as differences to the row above (filter 2, Up), each behind the filter's number. Of
/// depth, AO and pictures of them it leaves 1 to 10 % fewer bytes than differences to the left.
Bytes filtered(const cv::Mat& image, int from, int to) {
    const std::size_t row = image.elemSize() * static_cast<std::size_t>(image.cols);
    const int first = std::max(from - 1, 0); // the row above belongs to the band before
    const cv::Mat rows = in_file_order(image.rowRange(first, to));
    Bytes bytes((row + 1) * static_cast<std::size_t>(to - from));
    char* out = bytes.data.get();
    for (int v = from; v < to; ++v) {
        const uchar* here = rows.ptr(v - first);
        *out++ = '\2';
        if (v == 0)
            std::memcpy(out, here, row);
        else
            subtract(here, rows.ptr(v - first - 1), row, out);
        out += row;
    }
    return bytes;
}

/// The image's pixels, packed. A large image goes in bands: the filtered bytes of all would take as much memory again.
std::string packed(const cv::Mat& image) {
    constexpr std::size_t band_bytes = std::size_t(1) << 26;
    const std::size_t row = image.elemSize() * static_cast<std::size_t>(image.cols) + 1;
    const int rows_at_once = static_cast<int>(std::clamp<std::size_t>(band_bytes / row, 1, 1 << 24));
    Packer packer;
    std::string result;
    for (int from = 0; from < image.rows; from += rows_at_once) {
        const int to = std::min(from + rows_at_once, image.rows);
        const Bytes band = filtered(image, from, to);
        packer.append({band.data.get(), band.size}, to == image.rows, result);
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
    bytes.reserve(pixels.size() + pixels.size() / most * 12 + 100);
    append_chunk(bytes, "IHDR", header_of(image));
    for (std::size_t at = 0; at < pixels.size(); at += most)
        append_chunk(bytes, "IDAT", std::string_view(pixels).substr(at, most));
    append_chunk(bytes, "IEND", {});
    return bytes;
}

} // namespace scanshade
