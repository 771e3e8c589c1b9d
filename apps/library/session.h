// A session computes frames by the steps of the walk, without its files, for the functions of the C interface.
#pragma once

#include "apps/frame/work.h"
#include "apps/library/settings.h"
#include "apps/session/capture_look.h"
#include "apps/session/workers.h"
#include "io/captures/capture.h"

#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace scanshade::library {

/// What is computed besides visibility.
struct Wanted {
    bool confidence = false, normals = false;
};

/// Values of frames of one size, one below the other, or of points.
struct Result {
    std::int64_t count = 0, height = 0, width = 0;
    cv::Mat1f visibility, confidence; ///< count x height rows; confidence empty = not asked for
    cv::Mat3f normals;                ///< NaN = none; empty = not asked for
    std::vector<FrameRow> rows;
    std::string settings, device;
    json about; ///< radius, noise, warnings about the capture
    /// As scanshade_result_info() has it.
    [[nodiscard]] std::string info() const;
};

/// What a capture shows before its first frame is computed.
struct Beforehand {
    CaptureLook look;
    CaptureFindings findings;
    bool by_points = false; ///< computes_points()
};

/// A capture, and what was found out about it, once for each choice of settings.
class OpenedCapture {
  public:
    explicit OpenedCapture(Capture listed) : capture(std::move(listed)) {}
    /// `key`: equal for equal settings.
    [[nodiscard]] const Beforehand& beforehand(const RunSettings& asked, const std::string& key) const;
    const Capture capture;

  private:
    mutable std::mutex looking_;
    mutable std::map<std::string, Beforehand> found_;
};

/// Where frames come from: a capture, or the caller's arrays.
struct Source {
    std::shared_ptr<const void> owner;            ///< keeps `listing` alive
    const Capture& listing;                       ///< names and poses of all frames
    std::function<Frame(std::size_t index)> load; ///< safe from several threads
    std::function<Beforehand(const RunSettings& asked, const std::string& key)> look;
};

/// Points in memory. Spans are read during the call only.
struct PointArrays {
    std::vector<Eigen::Vector3d> points, normals;
    std::span<const std::array<int, 3>> triangles;
    std::optional<Eigen::Vector3d> scanner;
    bool z_up = false;
};

/// Thread-safe. Opens devices and makes methods when they are first needed.
class Session {
  public:
    explicit Session(const Settings& given);
    ~Session();

    /// Throws Error naming the frame where its data are bad.
    [[nodiscard]] Result compute(const Source& source, std::span<const std::size_t> frames, Wanted wanted);
    [[nodiscard]] Result compute(PointArrays arrays, Wanted wanted);
    /// A JSON object of the settings as used.
    [[nodiscard]] const std::string& settings_text() const { return settings_text_; }

  private:
    class Sequence;
    struct Computed;
    [[nodiscard]] Workers& workers();
    /// Of the chosen method with that radius.
    [[nodiscard]] std::shared_ptr<MethodPool> methods(double radius_m);
    [[nodiscard]] PointMethod& points();
    [[nodiscard]] FrameOptions options(Wanted wanted) const;
    /// Of a capture.
    [[nodiscard]] FrameOptions options(const Beforehand& known, Wanted wanted) const;
    void compute_of_points(Computed& computed);
    void load(Computed& computed, const Source& source, std::size_t index, const FrameOptions& options) const;
    void compute_one(Computed& computed, const Source& source, std::size_t index, const FrameOptions& options,
                     Wanted wanted);
    void compute_together(std::deque<Computed>& computed, const Source& source, std::span<const std::size_t> frames,
                          const FrameOptions& options, Wanted wanted);
    void finish_one(Computed& computed, const FrameOptions& options, Wanted wanted) const;
    [[nodiscard]] Result joined(std::deque<Computed>& computed) const;
    [[nodiscard]] Result about_capture(Result result, const Capture& capture, const Beforehand& known,
                                       const FrameOptions& options) const;

    RunSettings asked_;
    std::string settings_text_;
    std::mutex opening_, one_cloud_, one_sequence_;
    std::unique_ptr<Workers> workers_;
    std::unique_ptr<PointMethod> points_;
    std::unique_ptr<Sequence> sequence_; ///< of the capture that was computed last
};

} // namespace scanshade::library
