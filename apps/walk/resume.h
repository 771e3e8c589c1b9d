// A run with a journal: skips frames that are done already, and records each new one.
#pragma once

#include "apps/results/journal.h"
#include "apps/results/report.h"
#include "apps/results/result_tars.h"
#include "apps/walk/batch.h"

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace scanshade {

/// Everything that results depend on except the frames' own files, as used, not as typed. Leaves out settings that only
/// affect outputs that are not written.
[[nodiscard]] std::string settings_key(const RunReport& report, const Outputs& outputs, const DepthNoise& noise,
                                       const std::string& light = {});

/// Settings as typed, and stamps of every input. Equal keys mean that nothing has changed; no frame has to be decoded.
/// `together`: results depend on other frames and on poses, too.
[[nodiscard]] std::string task_key(const std::vector<Stage>& settings, const Capture& capture,
                                   const std::vector<std::size_t>& frames, bool together = false);

/// The rows of a task that is complete under this key, if all its files exist.
[[nodiscard]] std::optional<std::vector<FrameRow>> rows_if_complete(const Journal& journal, const std::string& task,
                                                                    const Capture& capture,
                                                                    const std::vector<std::size_t>& frames, bool retry);

/// What run_recorded() needs beyond run_batch().
struct Recording {
    Journal& journal;
    std::string settings, task; ///< settings_key(), task_key()
    std::string device;
    bool retry = false; ///< tries all failed frames again, whatever the cause
    /// A frame killed the process before this one. Frames run alone, and the frame that was begun and never ended is
    /// marked as a crash instead of being tried again.
    bool carefully = false;
    /// Goes up by one for each settled frame, computed or failed, but not for an outage.
    std::atomic<std::uint64_t>* finished = nullptr;
    ResultTars* tars = nullptr; ///< takes the frames' files; null = they stay
};

/// Calls run_batch() for the frames that the journal does not have. Rows of all frames come back shortened, in the
/// order of options.frames; Journal::whole() has the rest. `on_frame` is called only for frames that were run.
[[nodiscard]] std::vector<FrameRow> run_recorded(const Capture& capture, MethodPool& pool, const BatchOptions& options,
                                                 const Recording& recording,
                                                 const std::function<void(const FrameRow&)>& on_frame = {});

} // namespace scanshade
