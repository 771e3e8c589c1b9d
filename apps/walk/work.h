// One frame on its way through the walk: what each step found, for the steps behind it.
#pragma once

#include "apps/walk/batch_options.h"
#include "apps/walk/frame_row.h"
#include "projection/attach.h"

#include <memory>

namespace scanshade {

struct Work {
    const CaptureEntry& entry;
    FrameRow& row;
    Frame frame = {};
    double loaded_in_ms = 0; ///< above 0: `frame` was in memory before the walk
    DepthImage depth = {};
    DepthImage looked_at = {}; ///< of a sequence: what the methods saw in place of `depth`
    AoMap ao = {};
    cv::Mat1f confidence_in_view = {}; ///< of `ao`, pixel by pixel
    Attached attached = {}, confidence = {};
    bool wanted = true;             ///< false: loaded for the frames around it
    bool by_points = false;         ///< no view: values come from the points themselves
    PointVisibility of_points = {}; ///< what they are
};

using Token = std::shared_ptr<Work>;

} // namespace scanshade
