// Depth in, visibility out: the one interface every AO method has, and the row type of the table of methods.
#pragma once

#include "projection/maps.h"
#include "projection/noise.h"
#include "projection/parameters.h"

#include <array>
#include <Eigen/Geometry>
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
    double misfit_m = 0;               ///< by which the surfaces of both lie apart where they should not
};

/// Depth and normals that are on the device already.
struct PreparedSurfaces {
    std::shared_ptr<const gpu::DeviceBytes> z_m;     ///< a 32-bit float a pixel, metres, 0 = hole
    std::shared_ptr<const gpu::DeviceBytes> normals; ///< three a pixel, (0, 0, 0) where there is none
};

/// What a method looks at. Normals are optional: without them the method derives its own from depth.
struct View {
    const DepthImage& depth;
    const NormalImage* normals = nullptr;
    DepthNoise noise = {}; ///< sigma(z) of `depth` as recorded; none = clean. Methods may widen their tolerances by it
    bool smoothed = false; ///< the noise is gone from within surfaces; at their edges it is not
    std::span<const Neighbour> neighbours = {}; ///< of the same image size; most methods have no use for them
    const PreparedSurfaces* prepared = nullptr; ///< in place of depth.z_m and normals, for methods that take them
    int instant = 0; ///< another number, another pattern of samples, so that frames of a recording can be averaged
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

/// One AO method, made for one device. Not thread-safe: one frame at a time.
class Method {
  public:
    virtual ~Method() = default;
    /// Visibility of each pixel: same size as view.depth.z_m; NaN exactly where there is no surface.
    virtual AoMap compute(const View& view) = 0;
    /// Whether View::neighbours make a difference.
    [[nodiscard]] virtual bool looks_at_neighbours() const { return false; }
    /// Whether it reads View::prepared where there is one: then nothing goes by the host.
    [[nodiscard]] virtual bool takes_prepared() const { return false; }
    /// Where the time of the last compute() went.
    [[nodiscard]] virtual const Timings& timings() const = 0;
    /// What lay between the passes of the last compute(), for study; most methods have nothing to show.
    [[nodiscard]] virtual std::vector<Intermediate> intermediates() { return {}; }
};

/// A cloud, or a mesh where there are triangles (indices of points), in metres. Normals, one per point, may be missing.
struct PointSet {
    std::span<const Eigen::Vector3d> points, normals = {};
    std::span<const std::array<int, 3>> triangles = {};
};

/// Values of points, and what was chosen on the way.
struct PointVisibility {
    std::vector<float> visibility; ///< per point; NaN where it is not finite or its neighbours make no surface
    std::vector<float> confidence; ///< 0 .. 1: how flat the surface is round the point, times how many discs span the
                                   ///< radius; empty where the method has none
    std::vector<Eigen::Vector3f> normals; ///< as used; zero where there is none; empty for meshes
    double radius = 0, spacing = 0;       ///< as used, in the cloud's unit; spacing 0 = not measured
    int tiles = 1;
    std::vector<std::string> notes; ///< sentences: what was chosen and why
    Timings timings;
};

/// Computes points without a view: it looks from the points themselves. Not thread-safe: one cloud at a time.
class PointMethod {
  public:
    virtual ~PointMethod() = default;
    /// `scanner`: where the file says that the cloud was seen from.
    virtual PointVisibility compute(const PointSet& points, const std::optional<Eigen::Vector3d>& scanner = {}) = 0;
    /// What the last compute() found besides, for study.
    [[nodiscard]] virtual std::vector<Intermediate> intermediates() { return {}; }
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
};

/// The table of methods, in the order shown to people.
[[nodiscard]] const std::vector<MethodRow>& methods();
/// The row of that name; throws Misuse listing the names there are.
[[nodiscard]] const MethodRow& method_named(std::string_view name);

} // namespace scanshade
