// Grey PNG files: what most runs read most of.
#pragma once

#include <opencv2/core.hpp>
#include <string_view>

namespace scanshade {

/// The image in a file that check_png_chunks() has passed, as 8 or 16 bits, of the plainest kind: grey without palette,
/// transparency or interlacing (W3C PNG, second edition). Empty for any other, and where anything about the packed
/// pixels is odd: libpng says what.
[[nodiscard]] cv::Mat decoded_grey_png(std::string_view bytes);

} // namespace scanshade
