// Loading: one depth image in metres, its camera, its confidence; checked against each other.
#include "io/captures/loading.h"

#include "io/captures/plausibility.h"
#include "projection/base/error.h"
#include "projection/base/memory.h"

#include <algorithm>
#include <fmt/format.h>
#include <opencv2/core.hpp>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

/// Camera, depth and colour must have the same size: nothing is scaled unasked.
void check_depth_size(const Frame& frame, cv::Size found, const fs::path& depth) {
    const cv::Size expected = frame.camera.pinhole.size;
    if (!expected.empty() && found != expected)
        throw Error(fmt::format("{}: depth is {}, but its camera is for {} ({})", depth.string(), size_text(found),
                                size_text(expected), frame.camera.origin));
}

/// Apple's 0 low, 1 medium, 2 high; also of what is spread over a byte: 0, 127 (or 54), 255.
int confidence_level(uchar value) {
    if (value <= 2)
        return value;
    return value == 255 ? 2 : 1;
}

/// Depth of too low a confidence becomes holes.
void leave_out_unsure(const CaptureEntry& entry, int lowest, Frame& frame) {
    cv::Mat1b levels;
    try {
        levels = confidence_of(entry);
    } catch (const Outage&) {
        throw;
    } catch (const Error& failure) {
        frame.warnings.push_back(fmt::format("{}; all depth is believed.", failure.what()));
        return;
    }
    if (levels.size() != frame.depth_m.size()) {
        frame.warnings.push_back(fmt::format("{}: confidence is {}, depth is {}; all depth is believed.",
                                             entry.confidence, size_text(levels.size()),
                                             size_text(frame.depth_m.size())));
        return;
    }
    std::transform(frame.depth_m.begin(), frame.depth_m.end(), levels.begin(), frame.depth_m.begin(),
                   [&](float z, uchar value) { return confidence_level(value) >= lowest ? z : 0.0F; });
}

} // namespace

void take_camera(const Capture& capture, const CaptureEntry& entry, cv::Size depth_size, Frame& frame) {
    frame.colour_camera = capture.colour_camera;
    if (entry.camera) {
        frame.camera = *entry.camera;
        check_depth_size(frame, depth_size, entry.depth);
        return;
    }
    if (!capture.camera) { // anything that needs the camera refuses this one, and says its origin
        frame.camera.origin = "none is known; give --camera FILE or --camera fx,fy,cx,cy";
        return;
    }
    frame.camera = *capture.camera;
    if (frame.camera.pinhole.size.empty())
        frame.camera.pinhole.size = depth_size;
    check_depth_size(frame, depth_size, entry.depth);
}

DepthEncoding encoding_of(const Capture& capture, const CaptureEntry& entry) {
    if (!(entry.depth_units_per_metre > 0))
        return capture.depth;
    return depth_encoding(fmt::format("{}", entry.depth_units_per_metre), capture.depth.origin);
}

void correct(cv::Mat1f& depth_m, const DepthCorrection& correction) {
    if (!correction.any())
        return;
    std::transform(depth_m.begin(), depth_m.end(), depth_m.begin(),
                   [&](float z) { return z > 0 ? std::max(0.0F, static_cast<float>(correction(z))) : z; });
}

void tell_guesses(const Capture& capture, double beyond, double all, Frame& frame) {
    constexpr double many = 0.05;
    if (beyond > many * all)
        frame.warnings.push_back(fmt::format("{:.0f} % of the depths lie beyond {:g} m, where they are the recorder's "
                                             "guesses.",
                                             100 * beyond / all, capture.guessed_beyond_m));
}

void load_depth(const Capture& capture, const CaptureEntry& entry, const cv::Mat& as_stored, Frame& frame,
                bool with_colour) {
    const cv::Mat stored = looking_along_z(as_stored, frame.warnings);
    require_memory(stored.total() * sizeof(float),
                   fmt::format("{}: a depth image of {} pixels", entry.depth, size_text(stored.size())));
    const DepthEncoding encoding = encoding_of(capture, entry);
    frame.depth_m = during(entry.depth, [&] { return depth_in_metres(stored, encoding); });
    take_camera(capture, entry, stored.size(), frame);
    frame.findings = findings_about(frame.depth_m, stored, encoding);
    if (!entry.confidence.empty())
        leave_out_unsure(entry, capture.confidence_min, frame);
    if (capture.guessed_beyond_m > 0)
        tell_guesses(capture, cv::countNonZero(frame.depth_m > capture.guessed_beyond_m),
                     cv::countNonZero(frame.depth_m), frame);
    correct(frame.depth_m, capture.depth_correction);
    if (with_colour && !entry.colour.empty())
        load_colour(capture, entry, stored.size(), frame);
}

} // namespace scanshade
