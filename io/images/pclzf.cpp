// PCL's compressed images: a header of 37 bytes, then one block of LZF whose samples are sorted by kind, as PCL's
// writers (pcl/io/lzf_image_io.h) leave them.
#include "io/images/readers.h"

#include "io/text.h"

#include <algorithm>
#include <array>
#include <fmt/format.h>
#include <liblzf/lzf.h>
#include <opencv2/imgproc.hpp>

namespace scanshade::images {

namespace {

using image_check::little_endian_32;
using image_check::refuse;

constexpr std::size_t header_bytes = 37; ///< "PCLZF", width, height, 16 characters of type, packed and unpacked size

/// Red, green and blue, a plane each.
cv::Mat from_planes(const cv::Mat& stored) {
    const auto plane = [&](std::size_t index) {
        return cv::Mat(stored.size(), CV_8UC1, stored.data + stored.total() * index);
    };
    cv::Mat bgr;
    cv::merge(std::array<cv::Mat, 3>{plane(2), plane(1), plane(0)}, bgr);
    return bgr;
}

/// A U for two pixels, a Y for each, a V for two: a plane each. Analogue YUV over the whole range of 8 bits, as in PCL
/// and in COLOR_YUV2BGR.
cv::Mat from_yuv422(const cv::Mat& stored) {
    const std::size_t pixels = stored.total();
    const uchar *u = stored.data, *y = u + pixels / 2, *v = y + pixels;
    cv::Mat3b yuv(stored.size());
    for (std::size_t i = 0; i < pixels; ++i)
        yuv.ptr<cv::Vec3b>()[i] = {y[i], u[i / 2], v[i / 2]};
    cv::cvtColor(yuv, yuv, cv::COLOR_YUV2BGR);
    return yuv;
}

/// The Bayer pattern of Kinect and similar sensors: green and red in even rows, blue and green in odd ones.
cv::Mat from_bayer(const cv::Mat& stored) {
    cv::Mat bgr;
    cv::cvtColor(stored, bgr, cv::COLOR_BayerGRBG2BGR);
    return bgr;
}

struct Kind {
    std::string_view name;
    int stored_type;                          ///< OpenCV's type of as many bytes for a pixel as are stored
    cv::Mat (*to_bgr)(const cv::Mat& stored); ///< none: depth, which is wanted as it is stored
};
constexpr Kind kinds[] = {{"depth16", CV_16UC1, nullptr},
                          {"rgb24", CV_8UC3, &from_planes},
                          {"yuv422", CV_8UC2, &from_yuv422},
                          {"bayer8", CV_8UC1, &from_bayer}};

const Kind& kind_of(std::string_view bytes, const Path& file) {
    const std::string_view name = trimmed(bytes.substr(13, 16)); // padded with blanks
    const auto kind = std::ranges::find(kinds, name, &Kind::name);
    if (kind == std::end(kinds))
        refuse(file, fmt::format("PCLZF image of type {}, expected depth16, rgb24, yuv422 or bayer8", in_quotes(name)));
    return *kind;
}

void check_block(std::string_view bytes, const ImageFacts& facts, const Kind& kind, const Path& file) {
    const std::uint32_t packed = little_endian_32(bytes, 29);
    if (const std::size_t found = bytes.size() - header_bytes; packed != found)
        refuse(file, fmt::format("{} bytes of packed data expected, found {}", packed, found));
    constexpr std::uint64_t longest_copy = 264, its_code = 3; // bytes
    image_check::check_expansion(packed, longest_copy / its_code, facts, CV_MAT_CN(kind.stored_type), file);
}

cv::Mat unpacked(std::string_view bytes, const ImageFacts& facts, const Kind& kind, const Path& file) {
    check_block(bytes, facts, kind, file);
    cv::Mat stored(facts.size, kind.stored_type);
    const std::string_view block = bytes.substr(header_bytes);
    const auto size = static_cast<unsigned>(stored.total() * stored.elemSize());
    if (block.empty() || // of which liblzf would read a byte all the same
        lzf_decompress(block.data(), static_cast<unsigned>(block.size()), stored.data, size) != size)
        refuse(file, fmt::format("damaged: its packed data do not become {} bytes", size));
    return stored;
}

} // namespace

ImageFacts pclzf_header(std::string_view bytes, const Path& file) {
    if (bytes.size() < header_bytes)
        refuse(file, fmt::format("PCLZF ends early: {} bytes, expected a header of {}", bytes.size(), header_bytes));
    const Kind& kind = kind_of(bytes, file);
    ImageFacts facts;
    facts.size = image_check::checked_size(little_endian_32(bytes, 5), little_endian_32(bytes, 9), file);
    facts.bits = CV_ELEM_SIZE1(kind.stored_type) * 8;
    facts.channels = kind.to_bgr ? 3 : 1;
    const std::uint64_t expected = std::uint64_t(facts.size.area()) * CV_ELEM_SIZE(kind.stored_type);
    if (const std::uint32_t unpacked = little_endian_32(bytes, 33); unpacked != expected)
        refuse(file, fmt::format("{}x{} pixels of {} are {} bytes, but the header says that {} are packed",
                                 facts.size.width, facts.size.height, kind.name, expected, unpacked));
    return facts;
}

cv::Mat stored_pclzf(std::string_view bytes, const ImageFacts& facts, const Path& file) {
    return unpacked(bytes, facts, kind_of(bytes, file), file);
}

cv::Mat3b colour_pclzf(std::string_view bytes, const ImageFacts& facts, const Path& file) {
    const Kind& kind = kind_of(bytes, file);
    if (!kind.to_bgr)
        refuse(file, "PCLZF depth, expected a colour image");
    return kind.to_bgr(unpacked(bytes, facts, kind, file));
}

} // namespace scanshade::images
