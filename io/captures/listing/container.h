// A file that holds the images of a whole recording: ScanNet's .sens, bags of ROS, archives.
#pragma once

#include "io/images/image_file.h"

#include <cstddef>
#include <memory>
#include <opencv2/core.hpp>
#include <string>

namespace scanshade {

struct CaptureEntry;

/// Gives the images of its frames by place, which is the container's own number. Several threads may ask at once.
/// Every function throws Error naming file and place for what is damaged, Outage where the file cannot be reached.
class FrameContainer {
  public:
    enum class Part { depth, colour, confidence };

    FrameContainer() = default;
    FrameContainer(const FrameContainer&) = delete;
    FrameContainer& operator=(const FrameContainer&) = delete;
    virtual ~FrameContainer() = default;

    /// depth: as read_stored_depth() gives it; colour: 8-bit BGR; confidence: one channel of 8 bits, 0 = not believed.
    [[nodiscard]] virtual cv::Mat image(Part part, std::size_t place) const = 0;
    /// Without decoding where the container can.
    [[nodiscard]] virtual cv::Size size(Part part, std::size_t place) const { return image(part, place).size(); }
    /// Of what is stored of a frame: equal hashes mean equal images.
    [[nodiscard]] virtual std::string content_hash(std::size_t place, bool with_colour, bool with_confidence) const;
};

// An entry's images, wherever they are: in files of their own or in a container. Errors as of the image readers.
[[nodiscard]] cv::Mat stored_depth_of(const CaptureEntry& entry);
[[nodiscard]] cv::Mat3b colour_of(const CaptureEntry& entry);
/// With 16 bits, too, where it is a file that has them.
[[nodiscard]] StoredColour stored_colour_of(const CaptureEntry& entry);
[[nodiscard]] cv::Mat1b confidence_of(const CaptureEntry& entry);
[[nodiscard]] cv::Size depth_size_of(const CaptureEntry& entry);
[[nodiscard]] cv::Size colour_size_of(const CaptureEntry& entry);
/// Of all of its files' bytes, or of its images in a container; "unreadable" for what cannot be read.
[[nodiscard]] std::string content_hash_of(const CaptureEntry& entry);

} // namespace scanshade
