// Captures of a run, each from its journal to its report. They share settings, devices and the way into the walk.
#pragma once

#include "apps/frame/point_clouds.h"
#include "apps/jobs/worker.h"
#include "apps/results/journal.h"
#include "apps/results/report.h"
#include "apps/run/capture_job.h"
#include "apps/session/settings.h"
#include "apps/session/workers.h"
#include "apps/walk/overlap.h"
#include "apps/walk/resume.h"

#include <atomic>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <semaphore>
#include <set>
#include <string>
#include <vector>

namespace scanshade {

class CaptureRuns {
  public:
    explicit CaptureRuns(RunSettings& asked) : asked_(asked) {}

    /// How many captures are open at once. Per sixteen cores there is one whose frames enter the walk, two are being
    /// opened before it, and two finished after it. On a GPU, 40 frames take no longer than opening their capture.
    /// With a budget it is one: nothing may disturb its measurements, and each capture gets other settings.
    /// `stored`: input is fetched for one task and results are delivered for another, both in bounded space.
    [[nodiscard]] std::size_t at_once(bool stored = false);

    /// One capture, from its journal to its report.
    /// `held`: its journal, where that is not in the folder of its results.
    std::vector<FrameRow> process(CaptureJob job, OrderedOutput& output, const WorkerProcess& worker = {},
                                  Journal* held = nullptr);
    /// Computes tiles of a job's large clouds for the process that holds it, until that one has ended.
    void help(CaptureJob job);

    /// The journal of a block whose capture has results in that folder.
    void add_block(const std::filesystem::path& folder, const std::string& block) {
        siblings_[folder].insert(journal_file("", block).string());
    }
    /// Names of the journals of a capture's blocks, by folder.
    [[nodiscard]] const std::map<std::filesystem::path, std::set<std::string>>& blocks() const { return siblings_; }
    /// What the frames' errors are expected to be; of all captures, each sentence once.
    [[nodiscard]] const std::vector<std::string>& expectations() const { return outlook_; }

  private:
    /// The right to send frames into the walk.
    class Entrance {
      public:
        explicit Entrance(std::counting_semaphore<>& free) : free_(free) { free_.acquire(); }
        ~Entrance() { leave(); }
        Entrance(const Entrance&) = delete;
        Entrance& operator=(const Entrance&) = delete;
        void leave() {
            if (!left_.exchange(true))
                free_.release();
        }

      private:
        std::counting_semaphore<>& free_;
        std::atomic<bool> left_ = false;
    };
    /// A capture's method, and its report before any frame is computed.
    struct Prepared {
        std::unique_ptr<MethodSetup> setup;  ///< as this capture is computed with; the report has its rows
        std::shared_ptr<MethodPool> methods; ///< null without a device
        RunReport report;
        std::string settings; ///< settings_key()
        std::unique_ptr<PointMethod> points;
        bool by_points;      ///< the capture's clouds are computed from their points, as far as can be told
        std::string at_work; ///< which method on which device, for people
    };
    /// Opens the devices when the first frame needs them, so a run with nothing left to do opens none.
    Workers& workers();
    [[nodiscard]] std::string task_of(const CaptureJob& job);
    /// The rows of a capture that an earlier run has finished.
    [[nodiscard]] std::optional<std::vector<FrameRow>> rows_if_done(const CaptureJob& job, const Journal& journal,
                                                                    const std::string& task, const ReportFiles& files);
    /// Measures noise and extent on frames spread over the whole capture, so that its blocks agree. Frames of this
    /// block stay in memory.
    void look_at(CaptureJob& job) const;
    /// Makes the methods, or keeps those of the last capture. Without a Vulkan device, clouds are computed from their
    /// points on the processor.
    [[nodiscard]] Prepared prepare(CaptureJob& job);
    /// `workers`: null without a Vulkan device.
    RunReport begun_report(const CaptureJob& job, Workers* workers, MethodSetup& setup);
    /// Picks method and settings for the capture, starting from the command line. Returns sentences about the choice.
    std::vector<std::string> keep_to_budget(const CaptureJob& job, gpu::Device& device);
    /// The light of the colours, where outputs need it. Returns the text of a direct light, which belongs to what
    /// results were made from.
    std::string take_light(CaptureJob& job, RunReport& report, bool by_points) const;
    /// Whether nothing but clouds' points remains to be computed. Clouds that are neither in memory nor large may turn
    /// out to be images.
    [[nodiscard]] bool all_by_points(const CaptureJob& job) const;
    /// The devices; null where there are none, and why.
    [[nodiscard]] Workers* workers_if_any(std::string& why_none);
    /// Computes the frames that the journal does not have.
    void walk(CaptureJob& job, Prepared& ready, const Recording& recording);
    /// A capture's blocks are joined by `merge`, which writes their page.
    [[nodiscard]] bool writes_page(const CaptureJob& job) const { return asked_.page && job.block.empty(); }
    /// `recorded`: a cloud of all frames is there for the page.
    void report_on(const CaptureJob& job, Prepared& ready, const Journal& journal, const ReportFiles& files,
                   bool recorded);

    RunSettings& asked_;
    std::map<std::filesystem::path, std::set<std::string>> siblings_;
    std::mutex alone_; ///< held while a capture uses settings and devices, but not while its frames are computed
    std::counting_semaphore<> entrance_{1};
    std::unique_ptr<Workers> workers_;
    std::vector<std::string> outlook_;
};

} // namespace scanshade
