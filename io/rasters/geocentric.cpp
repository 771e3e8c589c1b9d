#include "io/rasters/geocentric.h"

#include "io/rasters/well_known_text.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <array>
#include <charconv>
#include <cmath>
#include <dlfcn.h>
#include <fmt/format.h>
#include <limits>
#include <proj.h>

namespace scanshade::rasters {

namespace {

/// The functions of libproj that are used. It stays open.
struct Library {
    decltype(&proj_context_create) context_create = nullptr;
    decltype(&proj_context_destroy) context_destroy = nullptr;
    decltype(&proj_log_level) log_level = nullptr;
    decltype(&proj_context_set_enable_network) set_enable_network = nullptr;
    decltype(&proj_create) create = nullptr;
    decltype(&proj_create_crs_to_crs_from_pj) create_between = nullptr;
    decltype(&proj_normalize_for_visualization) with_x_first = nullptr;
    decltype(&proj_trans_generic) trans_generic = nullptr;
    decltype(&proj_destroy) destroy = nullptr;
};

Library opened() {
    static_assert(PROJ_VERSION_MAJOR == 9, "the library's name has the number of its binary interface");
    const std::string name = "libproj.so.25";
    void* const handle = dlopen(name.c_str(), RTLD_NOW | RTLD_LOCAL);
    if (!handle)
        throw Error(name + " is not there (Debian has it in libproj25)");
    const auto find = [&]<class Function>(Function& function, const char* symbol) {
        function = reinterpret_cast<Function>(dlsym(handle, symbol));
        if (!function)
            throw Error(fmt::format("{} has no {}", name, symbol));
    };
    Library library;
    find(library.context_create, "proj_context_create");
    find(library.context_destroy, "proj_context_destroy");
    find(library.log_level, "proj_log_level");
    find(library.set_enable_network, "proj_context_set_enable_network");
    find(library.create, "proj_create");
    find(library.create_between, "proj_create_crs_to_crs_from_pj");
    find(library.with_x_first, "proj_normalize_for_visualization");
    find(library.trans_generic, "proj_trans_generic");
    find(library.destroy, "proj_destroy");
    return library;
}

const Library& library() {
    static const Library once = opened();
    return once;
}

struct Destroy {
    void operator()(PJ* part) const { library().destroy(part); }
    void operator()(PJ_CONTEXT* context) const { library().context_destroy(context); }
};
using Part = std::unique_ptr<PJ, Destroy>;

} // namespace

struct Geocentric::Parts {
    std::unique_ptr<PJ_CONTEXT, Destroy> context;
    Part way;
    std::string system, heights;
    double height_unit_m = 1; ///< that PROJ does not know of

    /// The way from a system; none where PROJ has none. `exactly`: not where it would have to leave out a step, such
    /// as a geoid whose grid is not installed.
    [[nodiscard]] Part way_from(const std::string& words, bool exactly) const {
        const Part from(library().create(context.get(), words.c_str())),
            earth(library().create(context.get(), "EPSG:4978"));
        if (!from || !earth)
            return nullptr;
        const std::array<const char*, 2> options{"ALLOW_BALLPARK=NO", nullptr};
        const Part between(library().create_between(context.get(), from.get(), earth.get(), nullptr,
                                                    exactly ? options.data() : nullptr));
        return between ? Part(library().with_x_first(context.get(), between.get())) : nullptr;
    }
};

Geocentric::Geocentric(const Crs& crs) : parts_(std::make_unique<Parts>()) {
    Parts& parts = *parts_;
    parts.context.reset(library().context_create());
    library().log_level(parts.context.get(), PJ_LOG_NONE);
    library().set_enable_network(parts.context.get(), 0);
    constexpr int vertical_key = 4096, first_private = 32767;
    const int vertical = value_of(crs.keys, vertical_key, 0);
    parts.system = crs.epsg > 0 ? fmt::format("EPSG:{}", crs.epsg) : crs.name;
    const std::string plane = crs.epsg > 0 ? parts.system : crs.text;
    const bool has_vertical = vertical > 0 && vertical < first_private;
    if (crs.epsg > 0 && has_vertical)
        parts.way = parts.way_from(fmt::format("{}+{}", plane, vertical), true);
    if (parts.way) {
        parts.system += fmt::format("+{}", vertical);
        return;
    }
    parts.way = parts.way_from(plane, false);
    if (!parts.way)
        throw Error(fmt::format("PROJ knows no way from the coordinate system {} to the Earth",
                                in_quotes(parts.system.empty() ? plane : parts.system)));
    if (crs.epsg == 0 && wkt::vertical_part(wkt::parsed(plane))) // of which PROJ makes what it can
        return;
    parts.height_unit_m = crs.height_unit_m;
    parts.heights = has_vertical ? fmt::format("the geoid of the heights (EPSG:{}) is not installed: heights are taken "
                                               "as ellipsoidal, up to 100 m off.",
                                               vertical)
                                 : "heights are taken as ellipsoidal: up to 100 m off where they are above the sea.";
}

Geocentric::~Geocentric() = default;
Geocentric::Geocentric(Geocentric&&) noexcept = default;

void Geocentric::place(std::span<Eigen::Vector3d> points) const {
    if (points.empty())
        return;
    for (Eigen::Vector3d& point : points)
        point.z() *= parts_->height_unit_m;
    double* const first = points.front().data();
    constexpr std::size_t stride = sizeof(Eigen::Vector3d);
    library().trans_generic(parts_->way.get(), PJ_FWD, first, stride, points.size(), first + 1, stride, points.size(),
                            first + 2, stride, points.size(), nullptr, 0, 0);
    for (Eigen::Vector3d& point : points)
        if (!point.allFinite()) // HUGE_VAL is PROJ's word
            point.setConstant(std::numeric_limits<double>::quiet_NaN());
}

const std::string& Geocentric::system() const { return parts_->system; }
const std::string& Geocentric::heights() const { return parts_->heights; }

Crs crs_of_code(const std::string& words) {
    constexpr std::string_view authority = "EPSG:";
    Crs crs;
    const char* const end = words.data() + words.size();
    if (!words.starts_with(authority) || std::from_chars(words.data() + authority.size(), end, crs.epsg).ptr != end ||
        crs.epsg <= 0)
        throw Error(fmt::format("{} given, expected a code such as EPSG:25832", in_quotes(words)));
    crs.known = true;
    return crs;
}

Eigen::Isometry3d east_north_up(const Eigen::Vector3d& place) {
    constexpr double equator = 6378137, flattening = 1 / 298.257223563, pole = equator * (1 - flattening);
    const Eigen::Vector3d up =
        (place.array() / Eigen::Array3d(equator * equator, equator * equator, pole * pole)).matrix().normalized();
    const Eigen::Vector3d across(-up.y(), up.x(), 0);
    const Eigen::Vector3d east = across.norm() > 1e-9 ? across.normalized() : Eigen::Vector3d(0, 1, 0);
    Eigen::Isometry3d axes = Eigen::Isometry3d::Identity();
    axes.linear() << east, up.cross(east), up;
    axes.translation() = place;
    return axes;
}

} // namespace scanshade::rasters
