// Uploads images that stay on the device.
#pragma once

#include "ao/gpu/program.h"

#include <opencv2/core.hpp>

namespace scanshade::gpu {

/// Not thread-safe: one image at a time.
class ImageUpload {
  public:
    explicit ImageUpload(Device& device) : device_(device), pool_(device) {}
    /// Single-channel floats, rows without gaps.
    [[nodiscard]] std::shared_ptr<const DeviceBytes> operator()(const cv::Mat1f& image);

  private:
    Device& device_;
    DeviceBytesPool pool_;
    std::size_t bytes_ = 0;
    std::unique_ptr<Program> program_; ///< one buffer and no pass
};

/// A copy on the host of what is on the device. Makes a program each time: for what is seldom done.
[[nodiscard]] std::vector<std::byte> read_back(Device& device, std::shared_ptr<const DeviceBytes> from);

} // namespace scanshade::gpu
