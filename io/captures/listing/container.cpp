#include "io/captures/listing/container.h"

#include "io/captures/listing/capture_listing.h"
#include "io/content_hash.h"
#include "io/images/format.h"
#include "projection/base/error.h"

namespace scanshade {

using Part = FrameContainer::Part;

namespace {

std::string hash_of_pixels(const cv::Mat& image) {
    const cv::Mat whole = image.isContinuous() ? image : image.clone();
    return fmt::format("{}x{}:{}", whole.cols, whole.rows,
                       hash_of({reinterpret_cast<const char*>(whole.data), whole.total() * whole.elemSize()}));
}

} // namespace

std::string FrameContainer::content_hash(std::size_t place, bool with_colour, bool with_confidence) const {
    std::string all = hash_of_pixels(image(Part::depth, place));
    if (with_colour)
        all += "|" + hash_of_pixels(image(Part::colour, place));
    if (with_confidence)
        all += "|" + hash_of_pixels(image(Part::confidence, place));
    return all;
}

cv::Mat stored_depth_of(const CaptureEntry& entry) {
    return entry.container ? entry.container->image(Part::depth, entry.place) : read_stored_depth(entry.depth);
}

cv::Mat3b colour_of(const CaptureEntry& entry) {
    return entry.container ? cv::Mat3b(entry.container->image(Part::colour, entry.place)) : read_colour(entry.colour);
}

StoredColour stored_colour_of(const CaptureEntry& entry) {
    return entry.container ? StoredColour{colour_of(entry), {}} : read_stored_colour(entry.colour);
}

cv::Mat1b confidence_of(const CaptureEntry& entry) {
    if (entry.container)
        return entry.container->image(Part::confidence, entry.place);
    cv::Mat1b levels;
    cv::extractChannel(read_colour(entry.confidence), levels, 0);
    return levels;
}

cv::Size depth_size_of(const CaptureEntry& entry) {
    return entry.container ? entry.container->size(Part::depth, entry.place) : peek(entry.depth).size;
}

cv::Size colour_size_of(const CaptureEntry& entry) {
    return entry.container ? entry.container->size(Part::colour, entry.place) : peek(entry.colour).size;
}

std::string content_hash_of(const CaptureEntry& entry) {
    std::string all;
    const auto add = [&](const auto& hash) {
        try {
            all += hash() + "|";
        } catch (const Error&) {
            all += "unreadable|";
        }
    };
    if (entry.container) {
        add([&] {
            return entry.container->content_hash(entry.place, !entry.colour.empty(), !entry.confidence.empty());
        });
        return all;
    }
    for (const StoredPath* file : {&entry.colour, &entry.depth, &entry.cloud})
        if (!file->empty())
            add([&] { return hash_of_file(*file); });
    return all;
}

} // namespace scanshade
