// Loading: the colour image of a frame, on the pixels of depth or of its own camera.
#include "io/captures/loading.h"

#include "projection/base/error.h"

#include <cmath>
#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

namespace scanshade {

void load_colour(const Capture& capture, const CaptureEntry& entry, cv::Size depth_size, Frame& frame) {
    try {
        StoredColour stored = stored_colour_of(entry);
        frame.colour = stored.colour;
        frame.deep_colour = stored.deep;
    } catch (const Outage&) {
        throw;
    } catch (const Error& failure) {
        check_still_there(capture);
        frame.warnings.push_back(fmt::format("{}; processed without colour.", failure.what()));
        return;
    }
    const cv::Size colour = frame.colour.size(),
                   expected = frame.colour_camera ? frame.colour_camera->camera.pinhole.size : depth_size;
    if (colour == expected)
        return;
    const auto shape = [](cv::Size size) { return static_cast<double>(size.width) / size.height; };
    if (capture.colour_in_more_pixels && !frame.colour_camera && colour.width > expected.width &&
        std::abs(shape(colour) / shape(expected) - 1) < 0.02) {
        cv::resize(frame.colour, frame.colour, expected, 0, 0, cv::INTER_AREA);
        if (!frame.deep_colour.empty())
            cv::resize(frame.deep_colour, frame.deep_colour, expected, 0, 0, cv::INTER_AREA);
        return;
    }
    frame.warnings.push_back(fmt::format("{}: colour is {}, {} is {}; processed without colour.", entry.colour,
                                         size_text(colour), frame.colour_camera ? "its camera" : "depth",
                                         size_text(expected)));
    frame.colour = cv::Mat3b();
    frame.deep_colour = cv::Mat3w();
}

} // namespace scanshade
