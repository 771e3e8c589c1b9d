// One frame on its way through the walk, with the results of each step for the next ones.
#pragma once

#include "ao/finish/finish.h"
#include "apps/doubts/doubts.h"
#include "apps/frame/frame_options.h"
#include "apps/frame/frame_row.h"
#include "projection/attach.h"

#include <memory>

namespace scanshade {

class LargeCloudRun;

struct Work {
    const CaptureEntry& entry;
    FrameRow& row;
    Frame frame = {};
    double loaded_in_ms = 0; ///< above 0: `frame` was in memory before the walk
    DepthImage depth = {};
    DepthImage looked_at = {}; ///< of a sequence: the depth that the method got in place of `depth`
    AoMap ao = {};
    Finishers* finishers = nullptr;                           ///< of the device that computed `ao`; null = none
    std::shared_ptr<const gpu::DeviceBytes> fitted = nullptr; ///< depth of plane fits, on that device; null = none
    std::shared_ptr<const gpu::DeviceBytes> fitted_normals = nullptr; ///< theirs
    cv::Mat1f confidence_in_view = {};                                ///< of `ao`, pixel by pixel
    cv::Mat1f error_in_view = {};                                     ///< expected; from it follows confidence
    shared::ErrorTable errors = {};                                   ///< of the method on this depth
    Attached attached = {}, confidence = {}, error = {};
    bool wanted = true;                             ///< false: loaded for the frames around it
    bool by_points = false;                         ///< no view: values come from rays at every point
    PointVisibility of_points = {};                 ///< those values
    std::shared_ptr<LargeCloudRun> large = nullptr; ///< computes the cloud from disk; null = `frame` has it
    std::size_t large_file = 0;                     ///< which of its files the frame is
    std::string messages = {};                      ///< frame_messages(), for run.mcap
};

using WorkPtr = std::shared_ptr<Work>;

} // namespace scanshade
