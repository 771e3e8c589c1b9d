#include "apps/frame/first_look.h"

#include "apps/frame/point_clouds.h"
#include "apps/large/large_cloud_run.h"
#include "projection/base/error.h"
#include "projection/base/spread.h"
#include "projection/base/stopwatch.h"
#include "projection/project.h"

#include <algorithm>
#include <optional>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

namespace scanshade {

std::vector<DepthImage> first_look(const Capture& capture, const std::vector<std::size_t>& frames, LoadedFrames* kept,
                                   bool with_colour, std::size_t most_points, bool one_view) {
    constexpr std::size_t most = 5;
    const std::vector<std::size_t> chosen = spread(most, frames.size());
    std::vector<DepthImage> images(chosen.size());
    std::vector<std::optional<LoadedFrame>> loaded(chosen.size());
    tbb::this_task_arena::isolate([&] {
        tbb::parallel_for(std::size_t(0), chosen.size(), [&](std::size_t i) {
            try {
                if (const std::string& cloud = capture.entries[frames[chosen[i]]].cloud;
                    !cloud.empty() && is_large_cloud(cloud, most_points))
                    return;
                const Stopwatch stopwatch;
                Frame frame = capture.load(frames[chosen[i]], with_colour);
                const double ms = stopwatch.ms();
                const bool image = !frame.cloud || frame.cloud->organised() || frame.cloud->pixels_of_one_image;
                if (image || (one_view && is_one_view(frame)))
                    images[i] = project(frame);
                if (kept && (image || frames.size() == 1))
                    loaded[i] = {std::move(frame), ms};
            } catch (const Outage&) { // a sigma from fewer frames would change all results
                throw;
            } catch (const Error&) { // processing the frame reports the error
            }
        });
    });
    for (std::size_t i = 0; i < chosen.size(); ++i)
        if (loaded[i])
            kept->emplace(frames[chosen[i]], *std::move(loaded[i]));
    return images;
}

} // namespace scanshade
