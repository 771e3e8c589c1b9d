// AO maps, pictures and depth to disk: encoded in memory, or beside the target, then renamed.
#include "io/images/image_file.h"

#include "io/images/image_check.h"
#include "io/output_file.h"
#include "io/images/png_output.h"
#include "io/text.h"
#include "projection/error.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <opencv2/imgcodecs.hpp>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

const std::vector<int> plain_tiff{cv::IMWRITE_TIFF_COMPRESSION, 1};
// ZIP, the default, takes ten times as long for a tenth of the size.
const std::vector<int> fast_exr{cv::IMWRITE_EXR_TYPE, cv::IMWRITE_EXR_TYPE_FLOAT, //
                                cv::IMWRITE_EXR_COMPRESSION, cv::IMWRITE_EXR_COMPRESSION_RLE};

void write_encoded(const fs::path& file, const cv::Mat& image, const std::string& extension,
                   const std::vector<int>& settings) {
    std::vector<uchar> bytes;
    bool done = false;
    try {
        done = cv::imencode(extension, image, bytes, settings);
    } catch (const cv::Exception& failure) {
        throw Error(fmt::format("{}: cannot be encoded: {}", file.string(), failure.err));
    }
    if (!done)
        throw Error(fmt::format("{}: cannot be encoded as {}", file.string(), extension));
    write_atomically(file, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

void write_png(const fs::path& file, const cv::Mat& image) {
    write_atomically(file, during(file.string(), [&] { return encoded_png(image); }));
}

/// 0 = no surface, 1 .. largest = visibility 0 .. 1. Plain rows, so that the compiler makes vectors of them.
template <class Integer>
cv::Mat_<Integer> as_integers(const cv::Mat1f& visibility) {
    constexpr float steps = std::numeric_limits<Integer>::max() - 1;
    cv::Mat_<Integer> image(visibility.size());
    for (int y = 0; y < image.rows; ++y) {
        const float* from = visibility[y];
        Integer* to = image[y];
        for (int x = 0; x < image.cols; ++x) {
            const float value = std::clamp(from[x], 0.0F, 1.0F); // a NaN stays one
            to[x] = value == value ? static_cast<Integer>(static_cast<int>(value * steps + 1.5F)) : Integer(0);
        }
    }
    return image;
}

} // namespace

AoFormat ao_format(const std::string& name) {
    if (name == "png16")
        return AoFormat::png16;
    if (name == "png8")
        return AoFormat::png8;
    if (name == "tiff")
        return AoFormat::tiff;
    if (name == "exr")
        return AoFormat::exr;
    throw Misuse(fmt::format("--format {}: expected png16, png8, tiff or exr", in_quotes(name)));
}

std::string extension(AoFormat format) {
    if (format == AoFormat::tiff)
        return ".tiff";
    return format == AoFormat::exr ? ".exr" : ".png";
}

void write_ao(const fs::path& file, const cv::Mat1f& visibility, AoFormat format) {
    switch (format) {
    case AoFormat::png16:
        return write_png(file, as_integers<ushort>(visibility));
    case AoFormat::png8:
        return write_png(file, as_integers<uchar>(visibility));
    case AoFormat::tiff:
        return write_encoded(file, visibility, ".tiff", plain_tiff);
    case AoFormat::exr:
        return write_encoded(file, visibility, ".exr", fast_exr);
    }
}

void write_picture(const fs::path& file, const cv::Mat3b& picture) {
    std::string kind = file.extension().string();
    std::transform(kind.begin(), kind.end(), kind.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    if (kind == ".jpg" || kind == ".jpeg")
        return write_encoded(file, picture, ".jpg", {cv::IMWRITE_JPEG_QUALITY, 95});
    if (kind != ".png")
        throw Error(file.string() + ": pictures are written as .png, .jpg or .jpeg");
    write_png(file, picture);
}

void write_depth_png(const fs::path& file, const cv::Mat1f& depth_m, double units_per_metre) {
    cv::Mat1w image(depth_m.size());
    std::transform(depth_m.begin(), depth_m.end(), image.begin(), [&](float metres) {
        // 65535 is some sensors' hole, so what is too far to be stored becomes one rather than a wrong distance.
        const double value = std::round(metres * units_per_metre);
        return value >= 1 && value < 65535 ? static_cast<ushort>(value) : ushort(0);
    });
    write_png(file, image);
}

void write_float_tiff(const fs::path& file, const cv::Mat& image) { write_encoded(file, image, ".tiff", plain_tiff); }

} // namespace scanshade
