// The focal length in a picture's EXIF tags.
#pragma once

#include <filesystem>
#include <opencv2/core.hpp>
#include <optional>

namespace scanshade {

/// The focal length in pixels of a picture that is now `size` large, to a few percent: from FocalLengthIn35mmFilm (by
/// the image's diagonal, 43.27 mm), else from FocalLength with FocalPlaneXResolution or FocalPlaneYResolution and the
/// size at which those were taken. None if the file has no such tags.
[[nodiscard]] std::optional<double> exif_focal_length_px(const std::filesystem::path& picture, cv::Size size);

} // namespace scanshade
