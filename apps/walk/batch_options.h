// Options of the walk: which frames, how they are computed, and what is written.
#pragma once

#include "ao/sequence/sequence_ao.h"
#include "apps/frame/frame_options.h"
#include "apps/results/mcap_recording.h"
#include "apps/results/recording_cloud.h"

#include <atomic>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace scanshade {

struct BatchOptions : FrameOptions {
    std::vector<std::size_t> frames;          ///< indices into capture.entries; the report keeps this order
    std::optional<Registration> registration; ///< as the user set it; none: as the capture says
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
