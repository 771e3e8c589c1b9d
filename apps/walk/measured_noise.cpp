#include "apps/walk/measured_noise.h"

#include "projection/error.h"
#include "projection/project.h"

#include <algorithm>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

namespace scanshade {

DepthNoise noise_of(const Capture& capture, const std::vector<std::size_t>& frames) {
    constexpr std::size_t most = 5;
    const std::vector<std::size_t> places = spread(most, frames.size());
    std::vector<DepthImage> images(places.size());
    tbb::this_task_arena::isolate([&] {
        tbb::parallel_for(std::size_t(0), places.size(), [&](std::size_t i) {
            try {
                const Frame frame = capture.load(frames[places[i]], false);
                if (!frame.cloud || frame.cloud->organised())
                    images[i] = project(frame);
            } catch (const Outage&) { // a sigma of fewer frames would shape all results
                throw;
            } catch (const Error&) { // whoever processes the frame says what is wrong with it
            }
        });
    });
    return measure_noise(images);
}

DepthNoise noise_of(const Capture& capture, const std::vector<std::size_t>& frames, const std::string& text) {
    return text == "auto" ? noise_of(capture, frames) : noise_from_text(text);
}

std::vector<std::size_t> spread(std::size_t count, std::size_t total) {
    count = std::min(count, total);
    std::vector<std::size_t> indices(count);
    for (std::size_t i = 0; i < count; ++i)
        indices[i] = i * total / count;
    return indices;
}

} // namespace scanshade
