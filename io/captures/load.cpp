// Capture::load and examine: one frame's files, decoded and checked against each other.
#include "io/captures/loading.h"

#include "io/files.h"
#include "projection/base/error.h"

#include <fmt/format.h>

namespace scanshade {

void check_still_there(const Capture& capture) {
    if (!is_there(capture.path))
        throw Outage(capture.path.string() + ": not there any more");
}

namespace {

/// The frame with the listing's facts, to which `read` adds the files' content.
template <class Read>
void read_frame(const Capture& capture, std::size_t index, Frame& frame, const Read& read) {
    if (index >= capture.entries.size())
        throw Error(fmt::format("{}: frame {} of {}", capture.path.string(), index, capture.entries.size()));
    const CaptureEntry& entry = capture.entries[index];
    if (!entry.problem.empty())
        throw Error(entry.problem);
    frame.name = entry.name;
    frame.warnings = entry.warnings;
    frame.world_from_camera = entry.world_from_camera;
    frame.registration = capture.registration;
    try {
        read(entry);
    } catch (const std::exception&) {
        check_still_there(capture);
        throw;
    }
}

} // namespace

Frame Capture::load(std::size_t index, bool with_colour) const {
    Frame frame;
    read_frame(*this, index, frame, [&](const CaptureEntry& entry) {
        entry.cloud.empty() ? load_depth(*this, entry, stored_depth_of(entry), frame, with_colour)
                            : load_cloud(*this, entry, frame);
    });
    return frame;
}

ExaminedFrame Capture::examine(std::size_t index) const {
    ExaminedFrame examined;
    read_frame(*this, index, examined.frame, [&](const CaptureEntry& entry) {
        entry.cloud.empty() ? examine_depth(*this, entry, examined) : load_cloud(*this, entry, examined.frame);
    });
    return examined;
}

} // namespace scanshade
