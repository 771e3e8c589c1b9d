// Plain PNG files, the most common input.
#pragma once

#include <opencv2/core.hpp>
#include <string_view>

namespace scanshade {

/// The image in a file that check_png_chunks() has passed, of the plainest kinds: grey of 8 or 16 bits, or 8-bit RGB
/// (which becomes BGR), without palette, transparency or interlacing (W3C PNG, second edition). Empty for any other
/// kind, and if anything is wrong with the packed pixels: then libpng reports what.
[[nodiscard]] cv::Mat decoded_plain_png(std::string_view bytes);

} // namespace scanshade
