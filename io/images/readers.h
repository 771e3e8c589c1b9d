// The functions in the table of image formats; format.h says what each does.
#pragma once

#include "io/images/image_check.h"

#include <filesystem>
#include <opencv2/core.hpp>
#include <string>
#include <string_view>

namespace scanshade::images {

using Path = std::filesystem::path;

[[nodiscard]] ImageFacts png_header(std::string_view bytes, const Path& file);
[[nodiscard]] cv::Mat stored_png(std::string_view bytes, const ImageFacts& facts, const Path& file);
[[nodiscard]] cv::Mat3b colour_png(std::string_view bytes, const ImageFacts& facts, const Path& file);
[[nodiscard]] cv::Mat3w deep_png(std::string_view bytes, const ImageFacts& facts, const Path& file);
/// Every chunk, its checksum and length, and the end of the file.
void check_png_chunks(std::string_view bytes, const ImageFacts& facts, const Path& file);

[[nodiscard]] ImageFacts jpeg_header(std::string_view bytes, const Path& file);
[[nodiscard]] cv::Mat3b colour_jpeg(std::string_view bytes, const ImageFacts& facts, const Path& file);
[[nodiscard]] std::string encoded_jpeg(const cv::Mat& image);

[[nodiscard]] ImageFacts tiff_header(std::string_view bytes, const Path& file);
[[nodiscard]] cv::Mat stored_tiff(std::string_view bytes, const ImageFacts& facts, const Path& file);
[[nodiscard]] cv::Mat3b colour_tiff(std::string_view bytes, const ImageFacts& facts, const Path& file);
[[nodiscard]] cv::Mat3w deep_tiff(std::string_view bytes, const ImageFacts& facts, const Path& file);
[[nodiscard]] std::string encoded_tiff(const cv::Mat& image);

[[nodiscard]] ImageFacts exr_header(std::string_view bytes, const Path& file);
[[nodiscard]] std::string exr_channels(std::string_view bytes, const Path& file);
[[nodiscard]] cv::Mat stored_exr(std::string_view bytes, const ImageFacts& facts, const Path& file);
[[nodiscard]] std::string encoded_exr(const cv::Mat& image);

[[nodiscard]] ImageFacts netpbm_header(std::string_view bytes, const Path& file); ///< P1 to P7, PFM
[[nodiscard]] cv::Mat stored_pgm(std::string_view bytes, const ImageFacts& facts, const Path& file);
[[nodiscard]] cv::Mat stored_pfm(std::string_view bytes, const ImageFacts& facts, const Path& file);
[[nodiscard]] cv::Mat3b colour_netpbm(std::string_view bytes, const ImageFacts& facts, const Path& file);
[[nodiscard]] cv::Mat3w deep_netpbm(std::string_view bytes, const ImageFacts& facts, const Path& file);

[[nodiscard]] ImageFacts bmp_header(std::string_view bytes, const Path& file);
[[nodiscard]] cv::Mat3b colour_bmp(std::string_view bytes, const ImageFacts& facts, const Path& file);

[[nodiscard]] ImageFacts webp_header(std::string_view bytes, const Path& file);
[[nodiscard]] cv::Mat3b colour_webp(std::string_view bytes, const ImageFacts& facts, const Path& file);

[[nodiscard]] ImageFacts npy_header(std::string_view bytes, const Path& file);
[[nodiscard]] cv::Mat stored_npy(std::string_view bytes, const ImageFacts& facts, const Path& file);

[[nodiscard]] ImageFacts pclzf_header(std::string_view bytes, const Path& file);
[[nodiscard]] cv::Mat stored_pclzf(std::string_view bytes, const ImageFacts& facts, const Path& file);
[[nodiscard]] cv::Mat3b colour_pclzf(std::string_view bytes, const ImageFacts& facts, const Path& file);

[[nodiscard]] bool is_colmap_map(std::string_view start);
[[nodiscard]] ImageFacts colmap_map_header(std::string_view bytes, const Path& file);
[[nodiscard]] cv::Mat stored_colmap_map(std::string_view bytes, const ImageFacts& facts, const Path& file);

} // namespace scanshade::images
