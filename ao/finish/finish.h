// The last passes of a frame, on the device: expected errors, shading, and the bytes of maps and pictures, downloaded
// once and encoded as they are.
#pragma once

#include "ao/base/method.h"
#include "ao/finish/light.h"
#include "ao/gpu/program.h"
#include "projection/camera.h"
#include "projection/sensor/noise.h"
#include "shaders/shared/expected_error.h"

#include <array>
#include <memory>
#include <mutex>
#include <opencv2/core.hpp>
#include <optional>
#include <span>
#include <vector>

namespace scanshade {

/// How colour that was divided, split or gathered is given: 8 bits with sRGB's curve; or linear light as floats, 1 =
/// white, of which none exceeds white (what 16-bit integers hold), or whatever division makes of it.
enum class LightValues { bytes, to_white, unbounded };

/// What is made of a frame.
struct FinishOutputs {
    bool error = false;      ///< as floats: expected_error_of() of the view
    int confidence_bits = 0; ///< as a map of 8 bits: confidence_from() that error; 0 = no map
    int map_bits = 0;        ///< of visibility, 16 or 8; 0 = no map
    bool picture = false;    ///< colour, or clay where there is none, times visibility in linear light
    bool unshaded = false;   ///< colour divided by what the picture is multiplied by, where there is colour
    bool split = false;      ///< the ambient and the direct part of colour, where there is colour
    bool indirect = false;   ///< one bounce: what colour comes from neighbours within the radius, where there is colour
    LightValues light_values = LightValues::bytes; ///< of the last three

    [[nodiscard]] bool any() const { return error || confidence_bits > 0 || map_bits > 0 || pictures(); }
    [[nodiscard]] bool pictures() const { return picture || unshaded || split || indirect; }
    bool operator==(const FinishOutputs&) const = default;
};

/// What a picture shows: colour (clay where there is none) times visibility; colour of which visibility multiplies the
/// ambient part alone; clay times visibility.
enum class Shade { multiply, ambient, clay };

/// A frame with its visibility, all on one pixel grid. Images may share memory with others; they are only read.
struct FinishInput {
    Pinhole camera;
    cv::Mat1f z_m;                                            ///< metres; holes are 0 or not finite
    cv::Mat1f visibility;                                     ///< NaN = no surface
    std::shared_ptr<const gpu::DeviceBytes> fitted = nullptr; ///< z of plane fits on this device: clay shows it in
                                                              ///< place of z_m
    std::shared_ptr<const gpu::DeviceBytes> fitted_normals =
        nullptr;                        ///< of plane fits, where AO was computed from them
    cv::Mat3f fitted_normals_host = {}; ///< the same on the host; empty = none
    cv::Mat1f fitted_m = {};            ///< the same on the host; empty = none
    double radius_m = 1;                ///< the method's; the expected error depends on it, on
    DepthNoise noise = {};              ///< that of z_m, and on
    shared::ErrorTable errors = {};     ///< the method's errors (ao/expected_errors.h)
    cv::Mat3b colour = {};              ///< blue, green, red; empty = clay
    cv::Mat3w deep_colour = {};         ///< the same with 16 bits, where it was recorded so; floats are made from it
    cv::Mat1b colour_known = {};        ///< 0 where colour has none; empty = known everywhere
    double strength = 1;                ///< of the visibility in the picture
    Shade shade = Shade::multiply;
    std::optional<shared::LightConstants> light = {}; ///< in camera space; none = all light is ambient
};

/// Linear light, blue first, 1 = white.
struct LinearLight {
    cv::Mat3f unshaded = {}, ambient = {}, direct = {}, indirect = {};
};

/// Empty images were not asked for. Maps are empty, too, and errors are floats, where the host packs: on
/// processors, and where nothing but a map of visibility was asked for.
struct Finished {
    cv::Mat1f error = {};          ///< expected, RMS of visibility; NaN where there is no visibility
    cv::Mat1b confidence_map = {}; ///< 0 = none, 1 .. 255 = 0 .. 1
    cv::Mat map = {};              ///< of visibility: 0 = no surface, 1 .. 255 or 65535 = 0 .. 1
    cv::Mat3b picture = {};        ///< blue, green, red, as all pictures
    cv::Mat3b unshaded = {}, ambient = {}, direct = {}, indirect = {};
    LinearLight linear = {}; ///< in their place, where floats were asked for
};

/// Whether the device turns values into the bytes of maps and pictures. A GPU then has less to download. Where the
/// device is the processor, the host's own loops take half the time. Split and divided colours are always made on the
/// device.
enum class Packing { on_device, on_host };

/// Not thread-safe: one frame at a time.
class Finish {
  public:
    /// Packs on the device if that is no processor.
    explicit Finish(gpu::Device& device);
    Finish(gpu::Device& device, Packing packing) : device_(device), packing_(packing) {}
    /// Throws Error where the images' sizes differ.
    [[nodiscard]] Finished compute(const FinishInput& input, const FinishOutputs& outputs);
    /// Where the time of the last compute() went.
    [[nodiscard]] const Timings& timings() const { return timings_; }

  private:
    /// Everything that decides on the passes.
    struct Shape {
        cv::Size size;
        FinishOutputs outputs;
        int picture = 0;
        bool direct = false;                                    ///< there is direct light to tell apart
        bool ambient_alone = false;                             ///< visibility has a say in ambient light alone
        bool fitted = false, smoothed = false, normals = false; ///< of clay and light: which depth they show
        bool on_device = false;                                 ///< packs there
        bool known = false;                                     ///< which pixels' colour is known matters
        bool operator==(const Shape&) const = default;
        [[nodiscard]] bool clay() const;
        [[nodiscard]] bool looks_at_surface() const { return clay() || direct || outputs.indirect; }
        [[nodiscard]] bool colours() const; ///< as bytes
        [[nodiscard]] bool light() const { return outputs.unshaded || outputs.split || outputs.indirect; }
        [[nodiscard]] bool linear() const { return light() && outputs.light_values != LightValues::bytes; }
        [[nodiscard]] bool packed() const;
        [[nodiscard]] bool error() const { return outputs.error || outputs.confidence_bits > 0 || outputs.unshaded; }
    };
    [[nodiscard]] Shape shape_of(const FinishInput& input, const FinishOutputs& outputs) const;
    gpu::Program& program_for(const Shape& shape);
    [[nodiscard]] static std::vector<gpu::BufferRow> buffers_of(const Shape& shape);
    [[nodiscard]] static std::vector<gpu::PassRow> passes_of(const Shape& shape);
    static void upload(gpu::Program& program, const Shape& shape, const FinishInput& input);

    gpu::Device& device_;
    Packing packing_;
    std::vector<std::pair<Shape, std::unique_ptr<gpu::Program>>> programs_; ///< the last few shapes'
    Timings timings_;
};

/// As many as are used at once on one device, so that no frame waits for another one's.
class Finishers {
  public:
    explicit Finishers(gpu::Device& device) : device_(device) {}
    /// Thread-safe. Adds its passes' times to `timings`.
    [[nodiscard]] Finished compute(const FinishInput& input, const FinishOutputs& outputs, Timings& timings);

  private:
    gpu::Device& device_;
    std::mutex access_;
    std::vector<std::unique_ptr<Finish>> idle_;
};

/// Colour times visibility in linear light. `clay` is the base where `input` has no colour; empty = colour everywhere.
[[nodiscard]] cv::Mat3b picture_on_host(const FinishInput& input, const cv::Mat3b& clay);

/// Clay as grey: `cosine` as facing_camera() has it, `surface` is 0 where there is none.
[[nodiscard]] cv::Mat3b clay_of(const cv::Mat1f& cosine, const cv::Mat1f& surface);

} // namespace scanshade
