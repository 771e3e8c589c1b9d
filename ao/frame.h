// The one door to ambient occlusion: a depth image or points, with settings, become visibility. Preparation of noisy
// depth, frames of a recording and the method are wired here once; the walk, `bench` and budgets all come in this way.
#pragma once

#include "ao/base/method.h"
#include "ao/cloud/cloud_ao.h"
#include "ao/expected_errors.h"
#include "ao/finish/finish.h"
#include "ao/fit_plane/fit_plane.h"
#include "ao/merged_cloud.h"
#include "ao/sequence/sequence_ao.h"
#include "projection/base/finding.h"

#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace scanshade {

/// One method on one device, with the preparation of depth that it asks for. Not thread-safe: one frame at a time.
class FrameAo {
  public:
    /// Keeps a reference to the device. `preparation.smoothing` is multiplied by the method's own. Methods of one
    /// device may share `finishers`, of that device. Throws Misuse naming a setting out of its range.
    FrameAo(gpu::Device& device, const MethodRow& row, MethodSetup& setup, FitPlaneOptions preparation = {},
            std::shared_ptr<Finishers> finishers = nullptr);
    /// A method made elsewhere, which must outlive this one. It sees depth as recorded, whatever its noise.
    explicit FrameAo(Method& method) : method_(method) {}
    /// The same with preparation, just as said.
    FrameAo(gpu::Device& device, Method& method, const FitPlaneOptions& preparation)
        : device_(&device), method_(method), preparation_(preparation) {}
    FrameAo(const FrameAo&) = delete;
    FrameAo& operator=(const FrameAo&) = delete;

    /// Visibility of each pixel of `depth`; NaN exactly where there is no surface. Depth with noise or flying pixels is
    /// prepared first.
    [[nodiscard]] AoMap compute(const DepthImage& depth, const DepthNoise& noise);
    /// Normals of `depth` as methods see it: of the fitted planes where noise asks for them, else of adjacent pixels.
    /// Unit length, facing the camera; (0, 0, 0) in holes.
    [[nodiscard]] NormalImage normals(const DepthImage& depth, const DepthNoise& noise);
    /// For the frames of one recording, each computed together with those around it. Must not outlive this one.
    [[nodiscard]] SequenceAo sequence(double radius_m, const DepthNoise& noise,
                                      const SequenceAoOptions& options = alone());

    /// Plane fits' depth of the last compute(), on the device; null where none were made.
    [[nodiscard]] const std::shared_ptr<const gpu::DeviceBytes>& fitted_depth() const { return fitted_depth_; }
    /// The normals of these fits, likewise.
    [[nodiscard]] const std::shared_ptr<const gpu::DeviceBytes>& fitted_normals() const { return fitted_normals_; }
    /// What makes confidence and pictures of frames on this device; null where there is none.
    [[nodiscard]] Finishers* finishers() const { return finishers_.get(); }

    /// What to expect of the method's errors on depth with that noise; `together`: as in errors_of().
    [[nodiscard]] shared::ErrorTable errors(const DepthNoise& noise, double together = 0) const {
        return errors_of(shipped_error_tables(), name_, settings_, class_of(noise), together);
    }

    /// What speaks for and against the result of the last compute().
    [[nodiscard]] const Findings& findings() const { return method_.remarks().findings; }
    /// Sentences: what the last compute() did otherwise than asked.
    [[nodiscard]] const std::vector<std::string>& warnings() const { return method_.remarks().warnings; }
    /// Where the time of the last compute() went, in order of execution.
    [[nodiscard]] const Timings& timings() const { return timings_; }
    /// What lay between the method's passes in the last compute().
    [[nodiscard]] std::vector<Intermediate> intermediates() { return method_.intermediates(); }

  private:
    /// Made on first use.
    [[nodiscard]] FitPlane& fit_for(const DepthNoise& noise);
    [[nodiscard]] AoMap compute_prepared(const DepthImage& depth, const DepthNoise& noise);

    gpu::Device* device_ = nullptr; ///< none: depth is never prepared
    std::unique_ptr<Method> owned_;
    Method& method_;
    FitPlaneOptions preparation_;
    std::string name_;        ///< of the method; empty = made elsewhere
    ChosenSettings settings_; ///< all of them
    std::shared_ptr<Finishers> finishers_;
    std::shared_ptr<const gpu::DeviceBytes> fitted_depth_, fitted_normals_;
    std::optional<FitPlane> fit_; ///< made when noise first asks for it; its pipelines stay for other noise
    Timings timings_;
};

/// How points are computed: by the method itself where it needs no view, else by rays from every point, and by images
/// where depth frames are found in the cloud. `device` = null casts rays on the processor.
[[nodiscard]] std::unique_ptr<PointMethod> point_method(const MethodSetup& setup, const CloudAoOptions& options,
                                                        gpu::Device* device, const MergedImages& images);

} // namespace scanshade
