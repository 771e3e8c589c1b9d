// Depth as ROS's compressed_depth_image_transport packs it: 12 bytes of settings, then a PNG, or RVL (Wilson, "Fast
// lossless depth image compression", 2017).
#include "io/captures/recordings/ros/messages.h"

#include "io/images/image_check.h"
#include "io/images/image_file.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <cmath>
#include <cstring>
#include <fmt/format.h>

namespace scanshade::ros {

namespace {

/// RVL's numbers: groups of 4 bits from the top of each 32-bit word; 3 of them count, the fourth says that more follow.
class Groups {
  public:
    explicit Groups(std::string_view words) : words_(words) {}
    std::uint32_t next() {
        std::uint32_t value = 0;
        for (int shift = 0;; shift += 3) {
            if (shift > 30)
                throw Error("RVL data with a number of more than 32 bits");
            const std::uint32_t group = next_group();
            value |= (group & 7) << shift;
            if ((group & 8) == 0)
                return value;
        }
    }

  private:
    std::uint32_t next_group() {
        if (left_ == 0) {
            if (words_.size() - at_ < sizeof word_)
                throw Error("RVL data that end before all pixels are there");
            std::memcpy(&word_, words_.data() + at_, sizeof word_);
            at_ += sizeof word_;
            left_ = 8;
        }
        const std::uint32_t group = word_ >> 28;
        word_ <<= 4;
        --left_;
        return group;
    }

    std::string_view words_;
    std::size_t at_ = 0;
    std::uint32_t word_ = 0;
    int left_ = 0;
};

cv::Mat1w rvl(std::string_view bytes) {
    if (bytes.size() < 8)
        throw Error(fmt::format("RVL data of {}, expected their size first", counted(bytes.size(), "byte")));
    const std::uint32_t width = image_check::little_endian_32(bytes, 0),
                        height = image_check::little_endian_32(bytes, 4);
    const cv::Size size = image_check::checked_size(width, height, "RVL data");
    constexpr std::uint64_t most_zeros_per_byte = std::uint64_t(1) << 20;
    if (static_cast<std::uint64_t>(size.area()) / most_zeros_per_byte > bytes.size())
        throw Error(fmt::format("RVL data of {} for {}x{} pixels", counted(bytes.size(), "byte"), width, height));
    cv::Mat1w image(size, ushort(0));
    Groups groups(bytes.substr(8));
    const auto pixels = static_cast<std::uint64_t>(size.area());
    std::int64_t previous = 0;
    for (std::uint64_t at = 0; at < pixels;) {
        const std::uint32_t zeros = groups.next(), values = groups.next();
        if (zeros > pixels - at || values > pixels - at - zeros || (zeros == 0 && values == 0))
            throw Error(
                fmt::format("RVL data with {} zeros and {} values at pixel {} of {}", zeros, values, at, pixels));
        at += zeros;
        for (std::uint32_t i = 0; i < values; ++i, ++at) {
            const std::uint32_t code = groups.next();
            previous += static_cast<std::int64_t>(code >> 1) ^ -static_cast<std::int64_t>(code & 1);
            image(static_cast<int>(at)) = static_cast<ushort>(previous);
        }
    }
    return image;
}

} // namespace

cv::Mat depth_in(const CompressedImage& image) {
    constexpr std::size_t settings = 12; // a number, then a and b of the inverse depth
    constexpr std::string_view png = "\x89PNG";
    const std::string_view data = image.data;
    const bool bare = data.starts_with(png);
    if (!bare && data.size() < settings)
        throw Error(fmt::format("compressed depth of {}, expected at least 12", counted(data.size(), "byte")));
    const std::string packed(bare ? data : data.substr(settings));
    const cv::Mat1w stored = packed.starts_with(png) ? cv::Mat1w(stored_depth_in(packed, "a message's PNG"))
                             : image.format.find("rvl") != std::string::npos
                                 ? rvl(packed)
                                 : throw Error(fmt::format("compressed depth of the format {}, expected PNG or RVL",
                                                           in_quotes(image.format)));
    if (!image.format.starts_with("32FC1"))
        return stored;
    float a = 0, b = 0;
    if (bare)
        throw Error("inverse depth without the numbers that it was made with");
    std::memcpy(&a, data.data() + 4, sizeof a);
    std::memcpy(&b, data.data() + 8, sizeof b);
    if (!std::isfinite(a) || !std::isfinite(b) || !(a > 0))
        throw Error(fmt::format("inverse depth made with {} and {}, expected numbers above 0", a, b));
    cv::Mat1f metres(stored.size());
    std::transform(stored.begin(), stored.end(), metres.begin(), [&](ushort v) {
        const float z = a / (static_cast<float>(v) - b);
        return v > 0 && z > 0 && std::isfinite(z) ? z : 0;
    });
    return metres;
}

} // namespace scanshade::ros
