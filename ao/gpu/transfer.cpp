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

shared::NeighbourPlace place_of(const Pinhole& camera, const Eigen::Isometry3d& here_from_there) {
    const auto single = [](double x) { return static_cast<float>(x); };
    const auto row = [&](const Eigen::Vector3d& v) {
        return shared::vec3(single(v.x()), single(v.y()), single(v.z()));
    };
    const Eigen::Matrix3d turn = here_from_there.linear();
    return {row(turn.row(0)),
            row(turn.row(1)),
            row(turn.row(2)),
            row(here_from_there.translation()),
            {single(1 / camera.fx), single(1 / camera.fy)},
            {single(-camera.cx / camera.fx), single(-camera.cy / camera.fy)}};
}

cv::Mat1f downloaded(std::span<const float> from, cv::Size size) {
    cv::Mat1f image(size);
    std::memcpy(image.data, from.data(), from.size_bytes());
    return image;
}

} // namespace scanshade::gpu
