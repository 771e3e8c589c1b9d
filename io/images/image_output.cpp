// AO maps, pictures and depth to disk: encoded in memory, or in a temporary file, then renamed.
#include "io/images/image_file.h"

#include "io/images/format.h"
#include "io/output_file.h"
#include "io/text.h"
#include "projection/base/error.h"
#include "projection/srgb.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

const ImageFormat& image_of(const AoFormatRow& row) { return *image_format_by_extension(row.extension); }

const AoFormatRow& row_of(AoFormat format) { return *std::ranges::find(ao_formats, format, &AoFormatRow::format); }

void write_image(const fs::path& file, const cv::Mat& image, const ImageFormat& format) {
    write_atomically(file, during(file.string(), [&] { return format.written(image); }));
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
            const float value = from[x], above = value > 0 ? value : 0, within = above < 1 ? above : 1; // of NaN 0
            const int code = static_cast<int>(within * steps + 1.5F);
            to[x] = static_cast<Integer>(value == value ? code : 0);
        }
    }
    return image;
}

/// With sRGB's curve.
template <class Integer>
cv::Mat stored_light(const cv::Mat3f& light) {
    constexpr double most = std::numeric_limits<Integer>::max();
    cv::Mat image(light.size(), CV_MAKETYPE(cv::DataType<Integer>::depth, 3));
    for (int y = 0; y < image.rows; ++y) {
        const auto* from = light.ptr<float>(y);
        auto* to = image.ptr<Integer>(y);
        for (int i = 0; i < 3 * image.cols; ++i) {
            const double linear = from[i] > 0 ? std::min<double>(from[i], 1) : 0; // 0 for NaN
            to[i] = static_cast<Integer>(std::lround(most * srgb_from_linear(linear)));
        }
    }
    return image;
}

} // namespace

AoFormat ao_format(const std::string& name) {
    const auto row = std::ranges::find(ao_formats, name, &AoFormatRow::name);
    if (row != ao_formats.end())
        return row->format;
    std::vector<std::string_view> names;
    for (const AoFormatRow& each : ao_formats)
        names.emplace_back(each.name);
    throw Misuse(fmt::format("--format {}: expected {}", in_quotes(name), listed(names, "or")));
}

std::string extension(AoFormat format) { return std::string(row_of(format).extension); }

bool is_ao_map(const ImageFacts& facts) {
    return facts.channels == 1 && std::ranges::any_of(ao_formats, [&](const AoFormatRow& row) {
               return &image_of(row) == facts.format && CV_ELEM_SIZE1(row.depth) * 8 == facts.bits &&
                      (row.depth == CV_32F) == facts.floats;
           });
}

bool has_ao_extension(const fs::path& file) {
    const ImageFormat* format = image_format_by_extension(lower_extension(file));
    return format && std::ranges::any_of(ao_formats, [&](const AoFormatRow& row) { return &image_of(row) == format; });
}

cv::Mat ao_integers(const cv::Mat1f& visibility, AoFormat format) {
    return format == AoFormat::png8 ? cv::Mat(as_integers<uchar>(visibility))
                                    : cv::Mat(as_integers<ushort>(visibility));
}

void write_ao(const fs::path& file, const cv::Mat1f& visibility, AoFormat format) {
    const AoFormatRow& row = row_of(format);
    write_image(file, row.depth == CV_32F ? cv::Mat(visibility) : ao_integers(visibility, format), image_of(row));
}

void write_ao_integers(const fs::path& file, const cv::Mat& integers) {
    write_image(file, integers, *image_format_by_extension(".png"));
}

void write_light(const fs::path& file, const cv::Mat3f& light, AoFormat format) {
    const AoFormatRow& row = row_of(format);
    write_image(file,
                row.depth == CV_32F   ? cv::Mat(light)
                : row.depth == CV_16U ? stored_light<ushort>(light)
                                      : stored_light<uchar>(light),
                image_of(row));
}

void write_picture(const fs::path& file, const cv::Mat3b& picture) {
    const ImageFormat* format = image_format_by_extension(lower_extension(file));
    if (!format || !format->written || !format->read_colour) {
        std::vector<std::string_view> names;
        for (const ImageFormat& each : image_formats())
            if (each.written && each.read_colour)
                names.emplace_back(each.name);
        throw Error(fmt::format("{}: pictures are written as {}", file.string(), listed(names, "or")));
    }
    write_image(file, picture, *format);
}

void write_depth_png(const fs::path& file, const cv::Mat1f& depth_m, double units_per_metre) {
    cv::Mat1w image(depth_m.size());
    std::transform(depth_m.begin(), depth_m.end(), image.begin(), [&](float metres) {
        // Some sensors mark holes with 65535, so a depth too large to store becomes a hole, not a wrong distance.
        const double value = std::round(metres * units_per_metre);
        return value >= 1 && value < 65535 ? static_cast<ushort>(value) : ushort(0);
    });
    write_image(file, image, *image_format_by_extension(".png"));
}

void write_float_tiff(const fs::path& file, const cv::Mat& image) {
    write_image(file, image, *image_format_by_extension(".tiff"));
}

} // namespace scanshade
