// PNG: plain grey and RGB with ISA-L (png_input.h), all others with libpng, whose errors jump out of its functions
// (setjmp), so their callers hold no objects.
#include "io/images/png_input.h"
#include "io/images/readers.h"

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <fmt/format.h>
#include <png.h>
#include <vector>

namespace scanshade::images {

namespace {

using image_check::refuse;

struct PngBytes {
    std::string_view rest;
    char trouble[256] = "";
};

void read_source(png_structp png, png_bytep to, std::size_t count) {
    auto& source = *static_cast<PngBytes*>(png_get_io_ptr(png));
    if (count > source.rest.size())
        png_error(png, "ends early");
    std::memcpy(to, source.rest.data(), count);
    source.rest.remove_prefix(count);
}

[[noreturn]] void keep_png_error(png_structp png, const char* text) {
    auto& source = *static_cast<PngBytes*>(png_get_error_ptr(png));
    std::snprintf(source.trouble, sizeof source.trouble, "%s", text);
    png_longjmp(png, 1);
}

void pass_over_warning(png_structp, const char*) {}

/// From whatever is stored to grey or BGR of `image`'s depth.
void choose_conversions(png_structp png, png_infop info, const cv::Mat& image) {
    const int colour = png_get_color_type(png, info), bits = png_get_bit_depth(png, info);
    if (bits == 16 && image.depth() == CV_8U)
        png_set_strip_16(png);
    else if (bits == 16)
        png_set_swap(png);
    if (colour == PNG_COLOR_TYPE_PALETTE)
        png_set_palette_to_rgb(png);
    if (colour == PNG_COLOR_TYPE_GRAY && bits < 8)
        png_set_expand_gray_1_2_4_to_8(png);
    png_set_strip_alpha(png);
    if (image.channels() == 3)
        (colour & PNG_COLOR_MASK_COLOR) ? png_set_bgr(png) : png_set_gray_to_rgb(png);
    png_set_interlace_handling(png);
    png_read_update_info(png, info);
}

/// Whether libpng read `image`, whose rows begin at `rows`; if not, `source` says why.
bool read_pixels(PngBytes& source, const cv::Mat& image, png_bytepp rows) {
    png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &source, &keep_png_error, &pass_over_warning);
    png_infop info = png ? png_create_info_struct(png) : nullptr;
    const bool well = [&] {
        if (!info || setjmp(png_jmpbuf(png)) != 0)
            return false;
        png_set_read_fn(png, &source, &read_source);
        png_read_info(png, info);
        choose_conversions(png, info, image);
        if (png_get_rowbytes(png, info) != image.step[0])
            png_error(png, "rows of another length than the header says");
        png_read_image(png, rows);
        png_read_end(png, nullptr);
        return true;
    }();
    png_destroy_read_struct(&png, &info, nullptr);
    return well;
}

cv::Mat decoded(std::string_view bytes, const ImageFacts& facts, int type, const Path& file) {
    cv::Mat image(facts.size, type);
    std::vector<png_bytep> rows(static_cast<std::size_t>(image.rows));
    for (int y = 0; y < image.rows; ++y)
        rows[static_cast<std::size_t>(y)] = image.ptr(y);
    PngBytes source{bytes};
    if (!read_pixels(source, image, rows.data()))
        refuse(file, fmt::format("PNG is damaged: {}", source.trouble));
    return image;
}

} // namespace

cv::Mat stored_png(std::string_view bytes, const ImageFacts& facts, const Path& file) {
    check_png_chunks(bytes, facts, file);
    const int type = facts.bits == 16 ? CV_16UC1 : CV_8UC1;
    cv::Mat image = decoded_plain_png(bytes);
    return image.empty() || image.type() != type ? decoded(bytes, facts, type, file) : image;
}

cv::Mat3b colour_png(std::string_view bytes, const ImageFacts& facts, const Path& file) {
    check_png_chunks(bytes, facts, file);
    cv::Mat image = facts.channels == 3 ? decoded_plain_png(bytes) : cv::Mat();
    return image.empty() || image.type() != CV_8UC3 ? decoded(bytes, facts, CV_8UC3, file) : image;
}

cv::Mat3w deep_png(std::string_view bytes, const ImageFacts& facts, const Path& file) {
    check_png_chunks(bytes, facts, file);
    return decoded(bytes, facts, CV_16UC3, file);
}

} // namespace scanshade::images
