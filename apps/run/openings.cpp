#include "apps/run/openings.h"

#include "apps/run/interruption.h"
#include "apps/slice.h"
#include "apps/walk/progress.h"
#include "projection/base/error.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

void refuse_absent_view(const RunSettings& asked, const Capture& capture) {
    if (asked.outputs().colour_view && !capture.colour_camera)
        throw Error(capture.path.string() +
                    ": --view colour needs the pose of a secondary camera for colour; refine finds it");
}

/// Settings in metres mean nothing in a capture whose unit is arbitrary.
void refuse_metres(RunSettings& asked, Capture& capture) {
    if (!capture.unit.arbitrary()) {
        if (asked.relative_radius != RunSettings().relative_radius)
            capture.warnings.emplace_back("--relative-radius is not used: lengths are not in an arbitrary unit, so "
                                          "--radius sets the radius.");
        return;
    }
    if (const std::vector<std::string> given = asked.given_in_metres(); !given.empty())
        throw Error(fmt::format("{}: {} {} in metres, and its unit is arbitrary ({}): leave {} out (--relative-radius "
                                "sets the radius), or give the unit as --depth-scale UNITS_PER_METRE",
                                capture.path.string(), fmt::join(given, ", "), given.size() > 1 ? "are" : "is",
                                capture.depth.origin, given.size() > 1 ? "them" : "it"));
}

} // namespace

std::shared_ptr<OpenedCapture> Openings::opened(const fs::path& path) const {
    Capture capture = open_capture_at_or_below(path, {asked_.camera, asked_.depth_scale, asked_.association_limit_s,
                                                      asked_.poses, asked_.colour, asked_.topic, asked_.median_depth(),
                                                      asked_.confidence_min, asked_.copc});
    refuse_metres(asked_, capture);
    refuse_absent_view(asked_, capture);
    std::vector<std::size_t> frames = slice(asked_.frames, capture.entries.size());
    auto opened = std::make_shared<OpenedCapture>();
    opened->capture = std::move(capture);
    opened->of = std::move(frames);
    return opened;
}

std::shared_ptr<OpenedCapture> Openings::opened_for_blocks(const fs::path& path) {
    const std::lock_guard alone(opening_);
    if (last_opened_path_ != path || !last_opened_) {
        last_opened_.reset(); // before the next one takes its memory
        last_opened_ = opened(path);
        last_opened_path_ = path;
    }
    return last_opened_;
}

CaptureJob Openings::job_from(std::shared_ptr<OpenedCapture> capture, const fs::path& folder) const {
    CaptureJob job(std::move(capture));
    job.batch.frames = job.of;
    job.batch.outputs = asked_.outputs();
    job.batch.outputs.folder = folder;
    job.batch.outputs.unit = job.capture.unit;
    if (!asked_.dump.empty())
        job.batch.dump = fs::path(asked_.dump) / folder.lexically_relative(asked_.out);
    job.batch.registration = asked_.registration();
    job.batch.range = asked_.range();
    job.batch.stop = &interrupted;
    job.batch.say = [](const std::string& sentence) { say("  " + sentence); };
    return job;
}

} // namespace scanshade
