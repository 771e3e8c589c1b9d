// Depth in, visibility out: the one interface every AO method has, and the row type of the table of methods.
#pragma once

#include "projection/base/error.h"
#include "projection/base/finding.h"
#include "projection/base/parameters.h"
#include "projection/base/splat.h"
#include "projection/base/station.h"
#include "projection/found_frames.h"
#include "projection/maps.h"
#include "projection/sensor/noise.h"

#include <array>
#include <Eigen/Geometry>
#include <fmt/format.h>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace scanshade {

namespace gpu {
class Device;
class DeviceBytes;
} // namespace gpu

/// Depth and normals as shaders/lib/surfel.glsl packs them, two 32-bit words a pixel, on the device; depth 0 = hole.
struct PackedSurfaces {
    Pinhole camera;
    std::shared_ptr<const gpu::DeviceBytes> words;
};

/// Another view of the same scene, which saw what hides from this one.
struct Neighbour {
    const PackedSurfaces* surfaces;
    Eigen::Isometry3d here_from_there; ///< that camera's space to this one's
    double alignment_error_m = 0;      ///< by which the surfaces of both lie apart where they should not
};

/// Depth and normals of one view, on the host or already on the device. Normals may be missing: methods then derive
/// their own from depth.
struct Surfaces {
    /// On the host; shares the memory of both images.
    Surfaces(const DepthImage& depth) : camera(depth.camera), z_m(depth.z_m) {}
    Surfaces(const DepthImage& depth, const NormalImage& given)
        : camera(depth.camera), z_m(depth.z_m), normals(given.normals) {}
    /// On the device: one 32-bit float a pixel for depth, three for normals.
    Surfaces(const Pinhole& pinhole, std::shared_ptr<const gpu::DeviceBytes> depth_there,
             std::shared_ptr<const gpu::DeviceBytes> normals_there_)
        : camera(pinhole), z_there(std::move(depth_there)), normals_there(std::move(normals_there_)) {}

    Pinhole camera;
    cv::Mat1f z_m;                                                  ///< metres, 0 = hole
    cv::Mat3f normals;                                              ///< (0, 0, 0) where there is none
    std::shared_ptr<const gpu::DeviceBytes> z_there, normals_there; ///< the same on the device

    [[nodiscard]] bool on_device() const { return z_there != nullptr; }
    [[nodiscard]] bool has_normals() const { return normals_there || !normals.empty(); }
};

/// Throws Error where the images on the host differ in size from the camera.
inline void check_sizes(const Surfaces& surfaces) {
    if (surfaces.on_device())
        return;
    const cv::Size depth = surfaces.z_m.size(), camera = surfaces.camera.size, normals = surfaces.normals.size();
    if (depth.empty() || depth != camera)
        throw Error(fmt::format("depth image of {}x{} with a camera of {}x{}", depth.width, depth.height, camera.width,
                                camera.height));
    if (!surfaces.normals.empty() && normals != depth)
        throw Error(fmt::format("normals of {}x{} for a depth image of {}x{}", normals.width, normals.height,
                                depth.width, depth.height));
}

/// What a method looks at.
struct View {
    Surfaces surfaces;
    DepthNoise noise = {}; ///< sigma(z) of depth as recorded; none = clean. Methods may widen their tolerances by it
    bool smoothed = false; ///< the noise is gone from within surfaces; at their edges it is not
    std::span<const Neighbour> neighbours = {}; ///< of the same image size; most methods have no use for them
    int instant = 0; ///< another number gives another pattern of samples, so that frames of a recording can be averaged
};

/// Milliseconds per named pass or transfer, in execution order.
using Timings = std::vector<std::pair<std::string, double>>;
/// To the row of that name, or to a new one.
inline void add(Timings& timings, const std::string& name, double ms) {
    for (auto& [known, sum] : timings)
        if (known == name) {
            sum += ms;
            return;
        }
    timings.emplace_back(name, ms);
}

/// An intermediate result, for study: `shape` outermost first, little-endian elements of `type` ("f4", "u4").
struct Intermediate {
    std::string name, type;
    std::vector<int> shape;
    std::vector<std::byte> data;
    std::string meaning = {}; ///< units, and how to read packed words
};

/// Sentences about one result.
struct MethodRemarks {
    std::vector<std::string> warnings = {}; ///< what was done otherwise than asked
    Findings findings = {};                 ///< what speaks for and against the result
};

/// One AO method, made for one device. Not thread-safe: one frame at a time.
class Method {
  public:
    virtual ~Method() = default;
    /// Visibility of each pixel, of the camera's image size; NaN exactly where there is no surface.
    virtual AoMap compute(const View& view) = 0;
    /// Whether View::neighbours make a difference.
    [[nodiscard]] virtual bool looks_at_neighbours() const { return false; }
    /// Where the time of the last compute() went.
    [[nodiscard]] virtual const Timings& timings() const = 0;
    /// What the last compute() has to say, and what its result does not show.
    [[nodiscard]] virtual const MethodRemarks& remarks() const {
        static const MethodRemarks none;
        return none;
    }
    /// What lay between the passes of the last compute(), for study; most methods have nothing to show.
    [[nodiscard]] virtual std::vector<Intermediate> intermediates() { return {}; }
};

/// A cloud, or a mesh where there are triangles (indices of points), in metres. Normals, one per point, may be missing.
struct PointSet {
    std::span<const Eigen::Vector3d> points, normals = {};
    std::span<const std::array<int, 3>> triangles = {};
    bool z_up = false;         ///< whether z is known to point to the sky
    bool from_scanner = false; ///< whether all were surely seen from the scanner's position, as in a lidar's sweep
    std::span<const Eigen::Vector3d> seen_from = {}; ///< the camera of each, where cameras are known; else empty
    std::span<const Station> stations = {};          ///< as a file of several scans says; empty = it does not
    std::span<const Splat> splats = {};              ///< what is about each point; empty = they are points of surfaces
    std::span<const FoundFrame> frames =
        {}; ///< the depth frames of all as their file says, or splats' cameras, or none
};

/// Values of points, and what was chosen on the way.
struct PointVisibility {
    std::vector<float> visibility; ///< per point; NaN where it is not finite or its neighbours make no surface
    std::vector<float> error; ///< expected: RMS of visibility, 0 .. 1; NaN where that is. Empty where the method has
                              ///< none. confidence_from() it is the confidence
    std::vector<Eigen::Vector3f> normals; ///< as used; zero where there is none; empty for meshes
    double radius = 0, spacing = 0;       ///< as used, in the cloud's unit; spacing 0 = not measured
    std::optional<double> expected_error; ///< RMS of `error`; nothing where it was not estimated
    int tiles = 1;
    std::vector<std::string> notes; ///< sentences: what was chosen and why
    Findings findings;              ///< what speaks for and against them
    Timings timings;
};

class PointSource;
class TileStore;

/// Computes points without a view: it looks from the points themselves. Not thread-safe: one cloud at a time.
class PointMethod {
  public:
    virtual ~PointMethod() = default;
    /// `scanner`: where the file says that the cloud was seen from.
    virtual PointVisibility compute(const PointSet& points, const std::optional<Eigen::Vector3d>& scanner = {}) = 0;
    /// What the last compute() found besides, for study.
    [[nodiscard]] virtual std::vector<Intermediate> intermediates() { return {}; }

    /// Points that it computes at once. Where a cloud has more, compute_large() needs no more memory than for these.
    [[nodiscard]] virtual std::size_t most_at_once() const { return std::numeric_limits<std::size_t>::max(); }
    /// All settings and the device, as text: equal ones give equal values.
    [[nodiscard]] virtual std::string fingerprint() const { return {}; }
    /// A cloud that is never in memory as a whole (ao/cloud/large_cloud.h). `shown`: of so many points normals are
    /// kept. `stop`: asked now and then; true ends it with an Outage. The values are in the store.
    virtual PointVisibility compute_large(PointSource&, TileStore&, double /*shown*/,
                                          const std::function<bool()>& /*stop*/) {
        throw Error("this method needs all points at once");
    }
};

/// A method's settings before it is made: rows to fill, then make().
class MethodSetup {
  public:
    virtual ~MethodSetup() = default;
    /// Every setting, bound to this object. Names are plain ("radius"); the command line prefixes the method's name.
    virtual std::vector<Parameter> parameters() = 0;
    /// Takes the settings as they are now; throws Error naming the setting that is out of range.
    virtual std::unique_ptr<Method> make(gpu::Device& device) const = 0;
    /// The same for points; null where the method needs a view.
    [[nodiscard]] virtual std::unique_ptr<PointMethod> make_for_points() const { return nullptr; }
};

struct MethodRow {
    std::string_view name;    ///< as on the command line
    std::string_view summary; ///< one line
    std::string_view source;  ///< paper or documentation it follows
    std::unique_ptr<MethodSetup> (*setup)();
    /// How much wider the windows of plane fits are for it than the noise itself asks for: methods that do not widen
    /// their tolerances by View::noise want it gone.
    double smoothing = 1;
    /// Whether narrow holes of noisy depth are filled for it, so that what is behind them occludes: where that takes it
    /// nearer to truth. `surfel` fills them itself.
    bool fill_holes = true;
};

/// The table of methods, in the order shown to people.
[[nodiscard]] const std::vector<MethodRow>& methods();
/// The row of that name; throws Misuse listing the names there are.
[[nodiscard]] const MethodRow& method_named(std::string_view name);

} // namespace scanshade
