// NYU depth v2's labelled images: MATLAB's .mat of version 7.3, which is HDF5, with all images in two arrays.
#include "io/captures/listing/layouts.h"

#include "io/hdf5/hdf5.h"
#include "io/text.h"
#include "projection/base/error.h"
#include "projection/base/memory.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

/// MATLAB stores columns, and HDF5 names sizes in the other order: (image, x, y), with colours (image, channel, x, y).
class LabelledImages final : public FrameContainer {
  public:
    explicit LabelledImages(const Hdf5File& file) : depths_(file.dataset("depths")) {
        const std::vector<std::uint64_t>& shape = depths_.shape();
        if (!depths_.number().floats || shape.size() != 3)
            throw Error(
                fmt::format("{}: {}, expected floats of images x width x height", depths_.name(), depths_.described()));
        constexpr std::uint64_t most_frames = 1 << 22;
        if (shape[0] > most_frames)
            throw Error(
                fmt::format("{}: {}, expected at most {} images", depths_.name(), depths_.described(), most_frames));
        size_ = image_check::checked_size(shape[1], shape[2], depths_.name());
        if (!file.has("images"))
            return;
        images_ = file.dataset("images");
        const std::vector<std::uint64_t> expected{shape[0], 3, shape[1], shape[2]};
        if (images_->number().bytes != 1 || images_->shape() != expected)
            throw Error(fmt::format("{}: {}, expected uint8 of {}", images_->name(), images_->described(),
                                    fmt::join(expected, "x")));
    }

    [[nodiscard]] std::size_t count() const { return depths_.shape()[0]; }
    [[nodiscard]] bool has_colour() const { return images_.has_value(); }
    [[nodiscard]] cv::Mat image(Part part, std::size_t place) const override {
        return part == Part::depth ? cv::Mat(depth(place)) : cv::Mat(colour(place));
    }
    [[nodiscard]] cv::Size size(Part /*part*/, std::size_t /*place*/) const override { return size_; }

  private:
    [[nodiscard]] cv::Mat1f depth(std::size_t place) const {
        const std::size_t element = depths_.number().bytes;
        const std::string bytes = depths_.elements(place, 1);
        require_memory(size_.area() * sizeof(float), depths_.name());
        cv::Mat1f depth_m(size_);
        const char* at = bytes.data();
        for (int u = 0; u < size_.width; ++u)
            for (int v = 0; v < size_.height; ++v, at += element)
                depth_m(v, u) = static_cast<float>(depths_.number().at(at));
        return depth_m;
    }
    [[nodiscard]] cv::Mat3b colour(std::size_t place) const {
        const std::string bytes = images_->elements(place, 1);
        require_memory(size_.area() * sizeof(cv::Vec3b), images_->name());
        cv::Mat3b image(size_);
        const char* at = bytes.data();
        for (int channel = 2; channel >= 0; --channel) // red first
            for (int u = 0; u < size_.width; ++u)
                for (int v = 0; v < size_.height; ++v)
                    image(v, u)[channel] = static_cast<uchar>(*at++);
        return image;
    }

    Hdf5Dataset depths_;
    std::optional<Hdf5Dataset> images_;
    cv::Size size_;
};

} // namespace

bool is_matlab_hdf5(std::string_view start) { return start.starts_with("MATLAB") && is_hdf5(start); }

Listing list_nyu_labelled(const fs::path& file) {
    const Hdf5File opened(file);
    if (!opened.has("depths"))
        throw NoFrames(fmt::format("{}: MATLAB's variables {}, expected NYU depth v2's depths and images",
                                   file.string(), fmt::join(opened.names(), ", ")));
    const auto images = std::make_shared<LabelledImages>(opened);
    Listing listing;
    Capture& capture = listing.capture;
    capture.depth = usual_encoding("m", "NYU's depths are metres, with holes filled in");
    capture.registration = Registration::yes;
    capture.registration_reason = "NYU's labelled depths are those of the colour images' pixels";
    for (std::size_t i = 0; i < images->count(); ++i) {
        CaptureEntry entry;
        entry.name = fmt::format("{:06}", i + 1); // as MATLAB counts, and NYU's lists of splits
        entry.depth = file.string();
        if (images->has_colour())
            entry.colour = file.string();
        entry.container = images;
        entry.place = i;
        capture.entries.push_back(std::move(entry));
    }
    listing.find_camera = [](cv::Size size, std::vector<std::string>& warnings) -> std::optional<CameraFile> {
        if (size.empty() || 3 * size.width != 4 * size.height)
            return std::nullopt;
        CameraFile camera = camera_from_argument("nyu-colour");
        camera.camera.pinhole = scaled(camera.camera.pinhole, size);
        warnings.push_back(
            "no camera in the file; NYU's published colour camera is assumed, to whose images the depths "
            "belong.");
        return camera;
    };
    return listing;
}

} // namespace scanshade
