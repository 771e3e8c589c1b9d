// A session computes frames by the steps of the walk, without its files: what the C interface's functions call.
#pragma once

#include "apps/library/settings.h"
#include "apps/run/workers.h"
#include "apps/walk/work.h"
#include "io/captures/capture.h"

#include <deque>
#include <functional>
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
    json about; ///< radius, noise
    /// As scanshade_result_info() has it.
    [[nodiscard]] std::string info() const;
};

/// A capture, and the noise of its depth, measured once.
class OpenedCapture {
  public:
    explicit OpenedCapture(Capture listed) : capture(std::move(listed)) {}
    [[nodiscard]] DepthNoise noise() const;
    const Capture capture;

  private:
    mutable std::mutex measuring_;
    mutable std::optional<DepthNoise> noise_;
};

/// Where frames come from: a capture, or the caller's arrays.
struct Source {
    std::shared_ptr<const void> owner;            ///< keeps `listing` alive
    const Capture& listing;                       ///< names and poses of all frames
    std::function<Frame(std::size_t index)> load; ///< safe from several threads
    std::function<DepthNoise()> measure_noise;
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
    [[nodiscard]] MethodPool& methods();
    [[nodiscard]] PointMethod& points();
    [[nodiscard]] BatchOptions options(const DepthNoise& noise, Wanted wanted) const;
    [[nodiscard]] DepthNoise noise_of(const Source& source) const;
    void compute_view(Computed& computed, FrameAo& method, const BatchOptions& options, Wanted wanted) const;
    void compute_of_points(Computed& computed);
    void load(Computed& computed, const Source& source, std::size_t index) const;
    void compute_one(Computed& computed, const Source& source, std::size_t index, const BatchOptions& options,
                     Wanted wanted);
    void compute_together(std::deque<Computed>& computed, const Source& source, std::span<const std::size_t> frames,
                          const BatchOptions& options, Wanted wanted);
    void finish_one(Computed& computed, const BatchOptions& options, Wanted wanted) const;
    [[nodiscard]] Result joined(std::deque<Computed>& computed, const DepthNoise* noise) const;

    RunSettings asked_;
    std::string settings_text_;
    bool by_rays_; ///< the method needs no view, so that clouds never get one
    std::mutex opening_, one_cloud_, one_sequence_;
    std::unique_ptr<Workers> workers_;
    std::shared_ptr<MethodPool> methods_;
    std::unique_ptr<PointMethod> points_;
    std::unique_ptr<Sequence> sequence_; ///< of the capture that was computed last
};

} // namespace scanshade::library
