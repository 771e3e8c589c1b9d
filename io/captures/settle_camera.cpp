// Opening: the camera, depth encoding and registration, from the listing or the user; a single image's colour.
#include "io/captures/settle.h"

#include "io/captures/formats.h"
#include "io/captures/listing/container.h"
#include "io/files.h"
#include "projection/base/error.h"

#include <algorithm>
#include <fmt/format.h>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

/// The size of the first depth image that has a readable header; 0x0 where none of the first few has.
cv::Size depth_size(const std::vector<CaptureEntry>& entries) {
    int tries = 8;
    for (const CaptureEntry& entry : entries) {
        if (!entry.problem.empty() || entry.depth.empty())
            continue;
        if (tries-- == 0)
            break;
        try {
            return depth_size_of(entry);
        } catch (const Outage&) {
            throw;
        } catch (const Error&) {
            continue; // loading this frame will say why
        }
    }
    return {};
}

} // namespace

bool settle_camera(Listing& listing, const CaptureOptions& options) {
    Capture& capture = listing.capture;
    const bool depth_images = std::any_of(capture.entries.begin(), capture.entries.end(),
                                          [](const CaptureEntry& entry) { return !entry.depth.empty(); });
    const cv::Size size = depth_images ? depth_size(capture.entries) : cv::Size();
    const auto found = options.camera.empty() ? listing.find_camera(size, capture.warnings)
                                              : std::optional(camera_from_argument(options.camera));
    if (!found) {
        if (depth_images)
            capture.warnings.push_back("no camera: the capture has none; give --camera FILE or --camera fx,fy,cx,cy.");
        return false;
    }
    capture.warnings.insert(capture.warnings.end(), found->warnings.begin(), found->warnings.end());
    capture.camera = found->camera;
    if (capture.camera->pinhole.size.empty())
        capture.camera->pinhole.size = size;
    if (!capture.camera->pinhole.size.empty())
        check(*capture.camera);
    if (found->depth_units_per_metre)
        capture.depth = depth_encoding(fmt::format("{}", *found->depth_units_per_metre), found->camera.origin);
    capture.depth_correction = found->depth_correction;
    capture.pose_time_offset_s = found->pose_time_offset_s;
    capture.colour_camera = found->colour;
    if (found->colour && found->registration == Registration::unknown) {
        capture.registration = Registration::no;
        capture.registration_reason = "a camera of its own took the colour, according to " + found->camera.origin;
    }
    if (found->registration == Registration::unknown)
        return found->y_was_up;
    capture.registration = found->registration;
    capture.registration_reason =
        (found->registration == Registration::yes ? "registered, according to " : "unregistered, according to ") +
        found->camera.origin;
    return found->y_was_up;
}

void take_colour(Capture& capture, const fs::path& colour) {
    if (capture.kind != name_of(FormatKind::depth_image))
        throw Misuse(fmt::format("colour: {} is for a single depth image, and {} is a capture of the kind '{}', which "
                                 "has its own colour images",
                                 colour.string(), capture.path.string(), capture.kind));
    if (!is_file(colour))
        throw Error(
            fmt::format("{}: no such file, expected the colour image of {}", colour.string(), capture.path.string()));
    capture.entries.front().colour = colour;
    if (capture.registration != Registration::unknown)
        return;
    capture.registration = Registration::yes;
    capture.registration_reason = "--colour names the image of these pixels";
}

} // namespace scanshade
