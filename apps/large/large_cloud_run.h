// Cloud files that are computed without being in memory as a whole: one large file, or all files of a survey together.
#pragma once

#include "ao/base/method.h"
#include "io/clouds/cloud_stream.h"
#include "projection/frame.h"

#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

namespace scanshade {

class CloudFiles;
class TilesOnDisk;

/// What is needed of a run to compute a large cloud.
struct LargeSettings {
    std::filesystem::path folder = {}; ///< of the temporary files; made, and removed afterwards
    std::size_t shown = 1000000;       ///< points of each file that pictures and pages show, about
    std::size_t buffers = 64 << 20;
    std::function<bool()> stop = {};                  ///< asked now and then
    std::function<void(const std::string&)> say = {}; ///< what is about to be done
    bool helps = false; ///< another process computes the files: compute() computes tiles for it, and no more
};

/// Made once for files that belong together. Temporary files are removed with it, unless keep() was called.
class LargeCloudRun {
  public:
    /// Files that stream, in the order of their frames.
    LargeCloudRun(std::vector<CloudStream> files, LargeSettings settings);
    ~LargeCloudRun();
    LargeCloudRun(const LargeCloudRun&) = delete;
    LargeCloudRun& operator=(const LargeCloudRun&) = delete;

    [[nodiscard]] std::size_t files() const;
    [[nodiscard]] const CloudStream& file(std::size_t index) const;
    /// Whether tiles are there to compute.
    [[nodiscard]] bool has_tiles() const;
    /// Computes all files; the second time there is nothing to do.
    void compute(PointMethod& method);
    /// Notes, doubts, radius; no values. After compute().
    [[nodiscard]] const PointVisibility& found() const { return found_; }

    /// Colours of written points, by their own (empty = none) and their visibility; empty = as they were.
    using Colours =
        std::function<std::vector<cv::Vec3b>(const std::vector<cv::Vec3b>& own, const std::vector<float>& visibility)>;
    /// One file after it was computed: some of its points with their values, and figures of all.
    struct Result {
        Cloud shown;
        PointVisibility of_shown; ///< with found()'s figures
        std::size_t points = 0, valid = 0, known = 0;
        double mean = 0; ///< visibility; NaN where none is known
        std::vector<std::string> warnings;
    };
    /// Points, block by block, with their own colours (empty = none) and values.
    using Each = std::function<void(const std::vector<Eigen::Vector3d>& points, const std::vector<cv::Vec3b>& own,
                                    const std::vector<float>& visibility, const std::vector<float>& error)>;
    /// Passes over the file once more; `each` gets all points. Writes it with values to `target`, where one is given,
    /// `with_errors` or without ao_error.
    [[nodiscard]] Result result(std::size_t file, const std::optional<std::filesystem::path>& target,
                                const Colours& colours, bool with_errors, const Each& each = {}) const;

    /// The temporary files stay: another run goes on.
    void keep() { kept_ = true; }

  private:
    std::unique_ptr<CloudFiles> source_;
    LargeSettings settings_;
    std::unique_ptr<TilesOnDisk> tiles_;
    PointVisibility found_;
    bool computed_ = false, kept_;
    std::mutex mutex_;
};

/// The shape of a cloud that has more points than `most_at_once` and can be read in blocks; nothing for all others, and
/// for a file that cannot be read: loading it says why. `why_not`: set where a large cloud cannot be read in blocks.
[[nodiscard]] std::optional<CloudShape> large_shape(const std::filesystem::path& file, std::size_t most_at_once,
                                                    std::vector<std::string>& warnings, std::string& why_not);
[[nodiscard]] bool is_large_cloud(const std::filesystem::path& file, std::size_t most_at_once);

/// Removes what an earlier run left in the folder of temporary files.
void remove_left_tiles(const std::filesystem::path& folder);
/// The folder of a frame's, or of a survey's, temporary files below that of its results.
[[nodiscard]] std::filesystem::path tiles_folder(const std::filesystem::path& results, const std::string& name);

} // namespace scanshade
