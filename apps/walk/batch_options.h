// Options of the walk: which frames, how they are computed, and what is written.
#pragma once

#include "ao/base/method.h"
#include "ao/sequence/sequence_ao.h"
#include "apps/results/mcap_recording.h"
#include "apps/results/outputs.h"
#include "apps/results/recording_cloud.h"
#include "apps/walk/first_look.h"
#include "io/captures/capture.h"
#include "projection/project.h"
#include "projection/sensor/noise.h"

#include <atomic>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace scanshade {

/// How clouds are computed: rays from each point, one camera's view, or points unless one camera saw them all.
enum class CloudWalk { automatic, points, view };

/// Whether cloud files of one capture are tiles of one survey, whose points see each other: as their boxes tell, all of
/// them, or none.
enum class CloudTiles { automatic, join, separate };

struct BatchOptions {
    std::vector<std::size_t> frames; ///< indices into capture.entries; the report keeps this order
    Outputs outputs;
    ProjectOptions range;                     ///< depth outside counts as a hole
    double radius_m = 0;                      ///< the method's, and
    DepthNoise noise;                         ///< the depth's: what confidence depends on
    std::vector<std::string> doubts;          ///< about the capture as a whole: each of its images has them
    std::optional<Light> light;               ///< of the colour images, where outputs need it
    std::optional<Registration> registration; ///< as the user set it; none: as the capture says
    PointMethod* points = nullptr;            ///< computes clouds and meshes where `cloud_walk` asks for points
    CloudWalk cloud_walk = CloudWalk::automatic;
    CloudTiles cloud_tiles = CloudTiles::automatic;
    std::string no_method;              ///< why there is no method for views, if the pool is empty; clouds need none
    RecordingCloud* cloud = nullptr;    ///< receives the frames with a pose
    McapRecording* recording = nullptr; ///< receives all frames, in their order
    SequenceAo* sequence = nullptr;     ///< computes each frame with its neighbours, in place of the method;
                                        ///< neighbours are loaded even if `frames` does not list them
    LoadedFrames* loaded = nullptr;     ///< frames that are in memory already; the walk takes them from there
    std::filesystem::path dump;         ///< folder for the method's intermediates, frame by frame; empty = none
    bool short_rows = false;            ///< rows come back shortened, once on_frame has seen them
    int frames_in_memory = 0;           ///< 0 = cores, and two for each method
    const std::atomic<bool>* stop = nullptr;     ///< set = begin no further frame
    std::function<void(const std::string&)> say; ///< gets sentences for people while frames are computed
    std::function<void()> all_begun;             ///< called once no further frame will begin: another batch may
};

} // namespace scanshade
