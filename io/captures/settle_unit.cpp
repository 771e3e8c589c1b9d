// Opening, last step: lengths of a capture whose unit is arbitrary.
#include "io/captures/settle.h"

#include "projection/base/error.h"
#include "projection/base/statistics.h"

#include <cmath>
#include <fmt/format.h>

namespace scanshade {

namespace {

/// In stored units, of up to 15 frames spread over the whole capture: the middle of their median depths, so that it
/// does not depend on which frames a run takes. 0 where none of them can be read.
double median_depth_of(const Capture& capture) {
    constexpr std::size_t most_frames = 15, most_pixels_looked_at = 20000;
    std::vector<const CaptureEntry*> usable;
    for (const CaptureEntry& entry : capture.entries)
        if (entry.problem.empty() && !entry.depth.empty())
            usable.push_back(&entry);
    const std::size_t frames = std::min(most_frames, usable.size());
    std::vector<double> medians;
    for (std::size_t i = 0; i < frames; ++i) {
        try {
            const cv::Mat1f depth =
                depth_in_metres(stored_depth_of(*usable[i * usable.size() / frames]), arbitrary_encoding({}));
            const auto step =
                static_cast<int>(std::sqrt(static_cast<double>(depth.total()) / most_pixels_looked_at)) + 1;
            std::vector<float> known;
            for (int v = 0; v < depth.rows; v += step)
                for (int u = 0; u < depth.cols; u += step)
                    if (depth(v, u) > 0)
                        known.push_back(depth(v, u));
            if (!known.empty())
                medians.push_back(median(std::move(known)));
        } catch (const Outage&) {
            throw;
        } catch (const Error&) { // loading that frame reports the error
        }
    }
    return medians.empty() ? 0 : median(std::move(medians));
}

void divide_poses(Capture& capture, double by) {
    for (CaptureEntry& entry : capture.entries) {
        if (entry.world_from_camera)
            entry.world_from_camera->translation() /= by;
        if (entry.motion)
            entry.motion->translation_per_s /= by;
    }
}

} // namespace

void settle_unit(Capture& capture, bool listed_in_arbitrary_unit, const CaptureOptions& options) {
    DepthEncoding& depth = capture.depth;
    if (!depth.arbitrary) {
        if (listed_in_arbitrary_unit && depth.kind == DepthEncoding::Kind::linear)
            divide_poses(capture, depth.units_per_metre);
        return;
    }
    if (capture.depth_correction.any())
        throw Error(fmt::format("{}: the depth correction of {} is in metres, and the unit of this capture is "
                                "arbitrary: give --depth-scale UNITS_PER_METRE",
                                capture.path.string(), capture.camera ? capture.camera->origin : "its camera"));
    const double median_units = median_depth_of(capture);
    if (median_units > 0)
        capture.median_depth = options.median_depth;
    capture.unit.units_per_length = median_units > 0 ? median_units / options.median_depth : 1;
    depth = arbitrary_encoding(depth.origin, capture.unit.units_per_length);
    for (CaptureEntry& entry : capture.entries)
        entry.depth_units_per_metre = 0;
    divide_poses(capture, capture.unit.units_per_length);
}

void require_metres(const Capture& capture, const std::string& what) {
    if (capture.unit.arbitrary())
        throw Error(
            fmt::format("{}: {} needs lengths in metres, and the unit of this capture is arbitrary ({}): give it "
                        "as --depth-scale UNITS_PER_METRE",
                        capture.path.string(), what, capture.depth.origin));
}

} // namespace scanshade
