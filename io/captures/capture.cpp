// open_capture: the steps from a path to a capture, in order.
#include "io/captures/capture.h"

#include "io/captures/recognise.h"
#include "io/captures/settle.h"
#include "io/files.h"
#include "projection/base/error.h"

#include <algorithm>
#include <iterator>

namespace scanshade {

namespace fs = std::filesystem;

Capture open_capture(const fs::path& path, const CaptureOptions& options) {
    if (!is_there(path))
        throw Error(path.string() + ": no such file or folder");
    Listing listing = list_capture(path, options);
    Capture& capture = listing.capture;
    capture.path = path;
    capture.confidence_min = options.confidence_min;
    capture.copc = options.copc;
    std::ranges::move(oddities_of_tar(path), std::back_inserter(capture.warnings));
    settle_names(capture.entries);
    const bool arbitrary = capture.depth.arbitrary;
    const bool y_was_up = settle_camera(listing, options);
    if (listing.find_poses)
        listing.find_poses(capture, capture.pose_time_offset_s);
    if (options.poses.empty() && !listing.may_stand_still)
        leave_out_equal_poses(capture);
    if (y_was_up)
        turn_poses_y_down(capture);
    if (!options.colour.empty())
        take_colour(capture, options.colour);
    if (!options.depth_scale.empty()) {
        capture.depth = depth_encoding(options.depth_scale, "--depth-scale");
        capture.depth.by_hand = true;
        for (CaptureEntry& entry : capture.entries)
            entry.depth_units_per_metre = 0;
    }
    if (!options.camera.empty())
        for (CaptureEntry& entry : capture.entries)
            entry.camera = nullptr;
    if (!options.poses.empty())
        take_poses(capture, options);
    else if (listing.generic)
        tell_unused(path, listing);
    settle_unit(capture, arbitrary, options);
    return std::move(capture);
}

} // namespace scanshade
