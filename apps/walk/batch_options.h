// Options of the walk: which frames, how they are computed, and what is written.
#pragma once

#include "ao/base/method.h"
#include "ao/sequence/sequence_ao.h"
#include "apps/walk/measured_noise.h"
#include "apps/walk/recording_cloud.h"
#include "io/captures/capture.h"
#include "io/images/image_file.h"
#include "projection/project.h"

#include <array>
#include <atomic>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <vector>

namespace scanshade {

/// What becomes of a cloud's colours: they stay; they are multiplied by visibility; or so, and clouds without colours
/// of their own get visibility as grey.
enum class CloudColours { kept, shaded, grey };

/// The folders that Outputs fill.
inline constexpr std::array result_folders = {"ao", "confidence", "shaded", "panel", "clouds", "previews", "points"};

/// The files written for each frame, under `folder`: ao/NAME.png, confidence/NAME.png, shaded/NAME.png, panel/NAME.png,
/// clouds/NAME.pcd or .ply; for the page previews/NAME.js, or points/NAME.000.js and on of a cloud computed from its
/// points.
struct Outputs {
    std::filesystem::path folder;
    bool ao = true;         ///< the visibility map
    bool confidence = true; ///< how reliable the visibility is (confidence_of()), as 8 bits or floats
    bool shaded = true; ///< colour times visibility; clay times visibility where colour is not known to fit the depth
    bool panel = false; ///< colour | depth | AO | shaded
    bool cloud = true; ///< a cloud input with the fields ambient_occlusion and ao_confidence, everything else as it was
    bool depth_cloud = false; ///< a new PLY of a depth frame's points, in camera space
    AoFormat format = AoFormat::png16;
    double shade_strength = 1; ///< 0 leaves the colour, 1 multiplies by visibility
    bool colour_view = false;  ///< maps and pictures of frames with a secondary camera use its pixels
    CloudColours colour_cloud = CloudColours::kept;
    bool preview = false;              ///< what the page shows of the frame beside the other files
    std::size_t page_points = 1000000; ///< of a cloud, at most, on the page
};

/// What is written of a cloud computed from its points, which has no pixels: maps of visibility and confidence are its
/// fields, so each of them asks for the cloud.
[[nodiscard]] Outputs of_points(const Outputs& outputs);

/// The files that `outputs` makes of a frame. A cloud has both possible names, since only its content has the format.
[[nodiscard]] std::vector<std::filesystem::path> files_of(const CaptureEntry& entry, const Outputs& outputs);

/// Whether any output shows the colour images.
[[nodiscard]] inline bool shows_colour(const Outputs& outputs, bool recording_cloud) {
    return outputs.shaded || outputs.panel || outputs.depth_cloud || outputs.colour_view || recording_cloud;
}

/// How clouds are computed: rays from each point, one camera's view, or points unless one camera saw them all.
enum class CloudWalk { automatic, points, view };

struct BatchOptions {
    std::vector<std::size_t> frames; ///< indices into capture.entries; the report keeps this order
    Outputs outputs;
    ProjectOptions range;                     ///< depth outside counts as a hole
    double radius_m = 0;                      ///< the method's, and
    DepthNoise noise;                         ///< the depth's: what confidence depends on
    std::optional<Registration> registration; ///< as the user set it; none: as the capture says
    PointMethod* points = nullptr;            ///< computes clouds and meshes where `cloud_walk` asks for points
    CloudWalk cloud_walk = CloudWalk::automatic;
    std::string no_method;           ///< why there is no method for views, if the pool is empty; clouds need none
    RecordingCloud* cloud = nullptr; ///< receives the frames with a pose
    SequenceAo* sequence = nullptr;  ///< computes each frame with its neighbours, in place of the method;
                                     ///< neighbours are loaded even if `frames` does not list them
    LoadedFrames* loaded = nullptr;  ///< frames that are in memory already; the walk takes them from there
    std::filesystem::path dump;      ///< folder for the method's intermediates, frame by frame; empty = none
    bool short_rows = false;         ///< rows come back shortened, once on_frame has seen them
    int frames_in_memory = 0;        ///< 0 = cores, and two for each method
    const std::atomic<bool>* stop = nullptr; ///< set = begin no further frame
    std::function<void()> all_begun;         ///< called once no further frame will begin: another batch may
};

} // namespace scanshade
