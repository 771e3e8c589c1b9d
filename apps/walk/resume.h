// A run that keeps a journal: what is done already is left alone, what is done now is recorded, frame by frame.
#pragma once

#include "apps/walk/batch.h"
#include "apps/walk/journal.h"
#include "apps/walk/report.h"

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace scanshade {

/// Everything the results of a run depend on but the frames' own files: as used, not as typed. What is not written is
/// left out, with all that shapes only it.
[[nodiscard]] std::string settings_key(const RunReport& report, const Outputs& outputs, const DepthNoise& noise);

/// Settings as typed, and stamps of every input: equal only where nothing at all has changed, and found without
/// decoding a frame. `together`: results depend on other frames and on poses, too.
[[nodiscard]] std::string task_key(const std::vector<Stage>& settings, const Capture& capture,
                                   const std::vector<std::size_t>& frames, bool together = false);

/// The rows of a task that is complete under this key, all its files in place; else nothing.
[[nodiscard]] std::optional<std::vector<FrameRow>> rows_if_complete(const Journal& journal, const std::string& task,
                                                                    const Capture& capture,
                                                                    const std::vector<std::size_t>& frames, bool retry);

/// What run_recorded() needs beyond run_batch().
struct Recording {
    Journal& journal;
    std::string settings, task; ///< settings_key(), task_key()
    std::string device;
    bool retry = false; ///< failed frames are tried again whatever failed them
    /// A process before this one died of a frame: each frame goes alone, and the one that was begun and never ended is
    /// marked as a crash instead of being tried again.
    bool carefully = false;
    /// Counted up with each frame that is settled, well or badly, but by no outage.
    std::atomic<std::uint64_t>* finished = nullptr;
};

/// run_batch() over the frames that the journal does not have; rows of all come back shortened, in the order of
/// options.frames; Journal::whole() has the rest.
/// `on_frame` is told of those that were run.
[[nodiscard]] std::vector<FrameRow> run_recorded(const Capture& capture, MethodPool& pool, const BatchOptions& options,
                                                 const Recording& recording,
                                                 const std::function<void(const FrameRow&)>& on_frame = {});

} // namespace scanshade
