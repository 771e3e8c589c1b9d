// Fuzz target: values of flags that are little languages of their own. The first byte chooses: a slice of frames, a
// camera, a shard, a list, a noise model, a unit of depth, a measured front.
#include "apps/budget/front.h"
#include "apps/jobs/job.h"
#include "apps/json.h"
#include "apps/lists.h"
#include "apps/slice.h"
#include "io/cameras/camera_file.h"
#include "io/images/image_file.h"
#include "projection/sensor/noise.h"
#include "tests/fuzz/fuzz.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

namespace {

using namespace scanshade;
using namespace scanshade::fuzz;

void take_slice(const std::string& text, std::size_t count) {
    const std::vector<std::size_t> chosen = slice(text, count);
    must_hold(!chosen.empty() && chosen.back() < count);
    must_hold(std::ranges::is_sorted(chosen, std::less_equal<>()));
}

void take_camera(const std::string& text) {
    if (text.find('/') != std::string::npos || text.find('.') == 0)
        return; // no file of the machine shall be read
    const Camera camera = camera_from_argument(text).camera;
    must_hold(camera.pinhole.fx > 0 && camera.pinhole.fy > 0);
    must_hold(std::isfinite(camera.pinhole.cx) && std::isfinite(camera.pinhole.cy));
}

void take_shard(const std::string& text) {
    const Shard shard = shard_from(text);
    must_hold(shard.index >= 1 && shard.index <= shard.of);
    must_hold(text.find_first_not_of("0123456789/") == std::string::npos);
}

void take_lists(const std::string& text) {
    for (const std::string& word : comma_separated(text))
        must_hold(!word.empty() && word.find(',') == std::string::npos);
    (void)accepted([&] {
        for (const int number : whole_numbers("flag", text, 3))
            must_hold(number >= 3);
    });
    for (const double number : numbers("flag", text, 0.5))
        must_hold(number >= 0.5);
}

void take_noise(const std::string& text) {
    const DepthNoise noise = noise_from_text(text);
    for (const double z_m : {0.1, 1.0, 30.0})
        must_hold(noise.at(z_m) >= 0);
}

} // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    if (size < 2)
        return 0;
    const std::string text(text_of(data + 2, size - 2));
    (void)accepted([&] {
        switch (data[0] % 7) {
        case 0:
            take_slice(text, data[1]);
            break;
        case 1:
            take_camera(text);
            break;
        case 2:
            take_shard(text);
            break;
        case 3:
            take_lists(text);
            break;
        case 4:
            take_noise(text);
            break;
        case 5:
            (void)depth_encoding(text, "--depth-scale");
            break;
        default:
            (void)front_from(parsed_or_discarded(text), "front.json");
        }
    });
    return 0;
}
