#include "ao/gpu/transfer.h"

#include <cstring>

namespace scanshade::gpu {

void upload(const cv::Mat& image, std::span<std::byte> to) {
    const std::size_t row = static_cast<std::size_t>(image.cols) * image.elemSize();
    for (int y = 0; y < image.rows; ++y)
        std::memcpy(to.data() + static_cast<std::size_t>(y) * row, image.ptr(y), row);
}

void upload_depth(const cv::Mat1f& z_m, cv::Mat1f to) {
    constexpr float nearest_m = 1e-4F, farthest_m = 1e6F; // beyond them single precision, not the scene, would decide
    for (int y = 0; y < z_m.rows; ++y) {
        const float* const from = z_m[y];
        float* const row = to[y];
        for (int x = 0; x < z_m.cols; ++x)
            row[x] = from[x] >= nearest_m && from[x] <= farthest_m ? from[x] : 0.0F;
    }
}

cv::Mat1f downloaded(std::span<const float> from, cv::Size size) {
    cv::Mat1f image(size);
    std::memcpy(image.data, from.data(), from.size_bytes());
    return image;
}

} // namespace scanshade::gpu
