// A configuration tried on captures whose truth is known. bench and error budgets use it.
#pragma once

#include "ao/compare.h"
#include "ao/frame.h"
#include "apps/method_settings.h"
#include "io/captures/capture.h"
#include "projection/sensor/noise.h"
#include "projection/sensor/sensor_class.h"

#include <array>
#include <filesystem>
#include <optional>

namespace scanshade {

/// A frame ready for the methods, and its true visibility.
struct TrialFrame {
    std::string name;
    Frame frame;
    DepthImage depth;
    cv::Mat1f truth;     ///< on the recorded pixels, NaN = no surface; empty where it is not known
    cv::Mat1f exact_z_m; ///< true depth of a generated capture, else the recorded one; 0 = hole
};

struct TrialCapture {
    std::string name;
    std::filesystem::path path;
    DepthNoise noise;
    std::string noise_origin;
    double radius_m = 0.5;
    SensorClass sensor = SensorClass::clean; ///< a generated capture's own, else class_of(noise)
    std::string reference;                   ///< what `truth` is, or empty
    std::vector<TrialFrame> frames;
    FitPlaneOptions preparation = {}; ///< as requested
};

struct TrialRequest {
    int frames = 4;        ///< spread evenly over the capture
    double radius_m = 0.5; ///< where the capture's truth does not say
    std::string depth_noise = "auto";
    CaptureOptions capture;
    std::vector<std::size_t> among;   ///< indices of the frames that may be taken; empty = all
    bool leave_bad_out = false;       ///< frames that cannot be loaded are left out instead of being an Error
    FitPlaneOptions preparation = {}; ///< of noisy depth; its smoothing multiplies each method's own
};

/// Loads the frames, with the truth of a generated capture. Throws Error naming the frame that fails, and where no
/// frame is left.
[[nodiscard]] TrialCapture load_trial(const std::filesystem::path& path, const TrialRequest& request);
/// The same of an open capture, with its noise and the noise's origin.
[[nodiscard]] TrialCapture load_trial(const Capture& capture, const DepthNoise& noise, const std::string& noise_origin,
                                      const TrialRequest& request);

/// A method's settings with the radius, which the configuration may override.
[[nodiscard]] std::unique_ptr<MethodSetup> set_up(const Configuration& configuration, double radius_m);

/// One configuration on one device, as `run` would use it on depth with that noise.
class Trial {
  public:
    /// `radius_m` goes into the method's radius, before the configuration's own settings; the preparation's smoothing
    /// is multiplied by the method's.
    Trial(gpu::Device& device, Configuration configuration, const DepthNoise& noise, double radius_m,
          FitPlaneOptions preparation = {});

    /// Sets the noise of depth from now on. Pipelines are kept: making them is most of a trial's time.
    void set_noise(const DepthNoise& noise) { noise_ = noise; }
    /// Visibility on the recorded pixels.
    [[nodiscard]] cv::Mat1f compute(const TrialFrame& frame);
    /// The same of `count` frames from `first` on, each computed together with those around it as `run --sequence on`
    /// does.
    [[nodiscard]] std::vector<cv::Mat1f> compute_together(const std::vector<TrialFrame>& frames, std::size_t first,
                                                          std::size_t count);

    [[nodiscard]] const Configuration& configuration() const { return configuration_; }
    /// Expected RMS error of a frame's visibility, as compute() gave it.
    [[nodiscard]] double expected_rms(const TrialFrame& frame, const cv::Mat1f& visibility) const;
    /// Of the last compute(): device time stamps without transfers, and the whole by the host's clock.
    [[nodiscard]] double device_ms() const { return device_ms_; }
    [[nodiscard]] double wall_ms() const { return wall_ms_; }
    /// Every setting as used.
    [[nodiscard]] std::vector<Parameter> settings() const { return setup_->parameters(); }

  private:
    Configuration configuration_;
    std::unique_ptr<MethodSetup> setup_;
    FrameAo method_;
    DepthNoise noise_;
    double radius_m_ = 0;
    double device_ms_ = 0, wall_ms_ = 0;
};

/// Milliseconds of the passes, transfers and the host's copying left out.
[[nodiscard]] double device_ms(const Timings& timings);

} // namespace scanshade
