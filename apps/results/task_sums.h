// What `status` tells about the frames of a task. A complete task's journal ends with these sums, so that a million
// frames are not read to be counted.
#pragma once

#include "apps/frame/frame_row.h"
#include "apps/json.h"

#include <cstddef>
#include <map>
#include <string>
#include <vector>

namespace scanshade {

/// Frames that share a reason.
struct ReasonGroup {
    std::size_t frames = 0;
    std::string example; ///< a frame's name
};
using ReasonGroups = std::map<std::string, ReasonGroup>;

struct TaskSums {
    std::size_t ok = 0, doubtful = 0, failed = 0;
    std::size_t outages = 0; ///< frames that the next run tries again
    StageTimes ms{};
    ReasonGroups reasons, doubts; ///< of failed frames, of doubtful ones

    [[nodiscard]] std::size_t settled() const { return ok + doubtful + failed; }
    [[nodiscard]] std::size_t rows() const { return settled() + outages; }
    /// `folders`: where the frame's files are; left out of reasons.
    void add(const FrameRow& row, const std::vector<std::string>& folders);
};

/// '#' for each row of digits, so that texts about many frames are one.
[[nodiscard]] std::string without_numbers(const std::string& text);

[[nodiscard]] json to_json(const TaskSums& sums);
/// Throws what JSON throws, or Error.
[[nodiscard]] TaskSums sums_from(const json& text);

} // namespace scanshade
