// Which clouds of a capture are computed without being in memory as a whole, and their steps of the walk.
#pragma once

#include "apps/frame/work.h"
#include "apps/large/large_cloud_run.h"
#include "apps/walk/batch_options.h"

#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

namespace scanshade {

/// Of one capture. Safe to use from several threads.
class LargeFrames {
  public:
    /// `helps`: another process computes them, and this one some of their tiles.
    LargeFrames(const Capture& capture, const BatchOptions& options, bool helps = false)
        : capture_(capture), options_(options), helps_(helps) {}

    /// What computes a frame's cloud from disk, alone or with the others of its survey.
    struct Part {
        std::shared_ptr<LargeCloudRun> run; ///< null: the frame is computed in memory
        std::size_t file = 0;               ///< which of the run's files it is
    };
    /// `warnings` are about the frame's file, `notes` say why. What an earlier run left for a frame that is computed in
    /// memory is removed.
    [[nodiscard]] Part part_of(std::size_t index, std::vector<std::string>& warnings, std::vector<std::string>& notes);

  private:
    [[nodiscard]] LargeSettings settings(const std::string& name) const;
    [[nodiscard]] bool by_points() const;
    void find_surveys();

    const Capture& capture_;
    const BatchOptions& options_;
    bool helps_;
    std::once_flag looked_;
    std::map<std::size_t, Part> parts_; ///< of surveys, by frame
    std::map<std::size_t, std::string> notes_;
};

/// Computes tiles of the large clouds among options.frames for the process that computes these, while it is `at_work`.
/// Nothing where none of them is large.
void help_with_large_clouds(const Capture& capture, const BatchOptions& options, const std::function<bool()>& at_work);

/// Computes the values, which stay on disk.
void compute_large(Work& work, PointMethod& method);
/// Writes the frame's file, and fills in the work with some of its points for pictures and pages, and with figures of
/// all. After LargeCloudRun::compute().
void write_large(Work& work, const Outputs& outputs);

} // namespace scanshade
