// WebP with libwebp: of 2^14 pixels a side at most.
#include "io/images/readers.h"

#include <webp/decode.h>

namespace scanshade::images {

using image_check::refuse;

ImageFacts webp_header(std::string_view bytes, const Path& file) {
    WebPBitstreamFeatures features;
    if (WebPGetFeatures(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size(), &features) != VP8_STATUS_OK)
        refuse(file, "WebP without a sound header");
    ImageFacts facts;
    facts.size = image_check::checked_size(static_cast<std::uint64_t>(features.width),
                                           static_cast<std::uint64_t>(features.height), file);
    facts.bits = 8;
    facts.channels = features.has_alpha ? 4 : 3;
    return facts;
}

cv::Mat3b colour_webp(std::string_view bytes, const ImageFacts& facts, const Path& file) {
    cv::Mat3b image(facts.size);
    if (!WebPDecodeBGRInto(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size(), image.data,
                           image.total() * image.elemSize(), static_cast<int>(image.step[0])))
        refuse(file, "WebP is damaged, cut short or an animation");
    return image;
}

} // namespace scanshade::images
