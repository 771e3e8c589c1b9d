// The focal length from EXIF tags, read with libexif.
#include "io/images/exif.h"

#include <cmath>
#include <libexif/exif-data.h>
#include <memory>

namespace scanshade {
namespace {

using Tags = std::unique_ptr<ExifData, decltype(&exif_data_unref)>;

/// A number of any of EXIF's types; none where the tag is absent, not a number or not positive.
std::optional<double> positive(const Tags& tags, ExifTag tag) {
    const ExifEntry* entry = exif_data_get_entry(tags.get(), tag);
    if (!entry || entry->components < 1 || entry->size < exif_format_get_size(entry->format))
        return std::nullopt;
    const ExifByteOrder order = exif_data_get_byte_order(tags.get());
    double value = 0;
    if (entry->format == EXIF_FORMAT_SHORT)
        value = exif_get_short(entry->data, order);
    else if (entry->format == EXIF_FORMAT_LONG)
        value = exif_get_long(entry->data, order);
    else if (entry->format == EXIF_FORMAT_RATIONAL) {
        const ExifRational ratio = exif_get_rational(entry->data, order);
        value = ratio.denominator == 0 ? 0 : static_cast<double>(ratio.numerator) / ratio.denominator;
    }
    return value > 0 && std::isfinite(value) ? std::optional(value) : std::nullopt;
}

double diagonal(double width, double height) { return std::hypot(width, height); }

/// Pixels per millimetre of the sensor, at the size in which the picture was taken.
std::optional<double> pixels_per_mm(const Tags& tags) {
    auto resolution = positive(tags, EXIF_TAG_FOCAL_PLANE_X_RESOLUTION);
    if (!resolution)
        resolution = positive(tags, EXIF_TAG_FOCAL_PLANE_Y_RESOLUTION);
    if (!resolution)
        return std::nullopt;
    constexpr double millimetres[] = {0, 25.4, 25.4, 10, 1, 0.001}; // by EXIF's number of the unit; inches unless said
    const auto unit = static_cast<int>(positive(tags, EXIF_TAG_FOCAL_PLANE_RESOLUTION_UNIT).value_or(2));
    if (unit < 1 || unit > 5)
        return std::nullopt;
    return *resolution / millimetres[unit];
}

} // namespace

std::optional<double> exif_focal_length_px(const std::filesystem::path& picture, cv::Size size) {
    const Tags tags(exif_data_new_from_file(picture.c_str()), &exif_data_unref);
    if (!tags)
        return std::nullopt;
    constexpr double film_diagonal_mm = 43.2666; // 36 x 24
    const double now = diagonal(size.width, size.height);
    if (const auto film_mm = positive(tags, EXIF_TAG_FOCAL_LENGTH_IN_35MM_FILM))
        return *film_mm / film_diagonal_mm * now;
    const auto length_mm = positive(tags, EXIF_TAG_FOCAL_LENGTH), per_mm = pixels_per_mm(tags);
    if (!length_mm || !per_mm)
        return std::nullopt;
    const auto width = positive(tags, EXIF_TAG_PIXEL_X_DIMENSION), height = positive(tags, EXIF_TAG_PIXEL_Y_DIMENSION);
    const double taken = width && height ? diagonal(*width, *height) : now;
    return *length_mm * *per_mm * now / taken;
}

} // namespace scanshade
