#include "projection/fit_pinhole.h"

#include "projection/base/error.h"
#include "projection/base/line_fit.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace scanshade {
namespace {

constexpr double worst_rms_px = 2.0;

/// Calls visit(x/z, y/z, column, row) for each point in front of the camera.
template <class Visit>
void for_each_ray(const Cloud& cloud, Visit&& visit) {
    for (int row = 0, i = 0; row < cloud.grid.height; ++row)
        for (int column = 0; column < cloud.grid.width; ++column, ++i)
            if (const Eigen::Vector3d& point = cloud.points[i]; point.allFinite() && point.z() > 0)
                visit(point.x() / point.z(), point.y() / point.z(), column, row);
}

struct AxisFits {
    Line u, v;
    double rms_px = 0;
    int points = 0;

    [[nodiscard]] double squared_error(double x, double y, int column, int row) const {
        const double du = u.residual(x, column), dv = v.residual(y, row);
        return du * du + dv * dv;
    }
};

/// One least-squares fit of the rays that `keep` accepts.
template <class Keep>
AxisFits fit_axes(const Cloud& cloud, Keep&& keep) {
    LineFit u_fit, v_fit;
    AxisFits fits;
    for_each_ray(cloud, [&](double x, double y, int column, int row) {
        if (!keep(x, y, column, row))
            return;
        u_fit.add(x, column);
        v_fit.add(y, row);
        ++fits.points;
    });
    if (fits.points < 3)
        throw Error(fmt::format("no camera can be recovered from the cloud: {} valid points, at least 3 expected",
                                fits.points));
    if (!u_fit.determined() || !v_fit.determined())
        throw Error("no camera can be recovered from the cloud: its valid points lie in one row or one column");
    fits.u = u_fit.line();
    fits.v = v_fit.line();
    double sum = 0;
    for_each_ray(cloud, [&](double x, double y, int column, int row) {
        if (keep(x, y, column, row))
            sum += fits.squared_error(x, y, column, row);
    });
    fits.rms_px = std::sqrt(sum / fits.points);
    return fits;
}

} // namespace

PinholeFit fit_pinhole(const Cloud& cloud) {
    if (!cloud.organised())
        throw Error("no camera can be recovered from the cloud: its points are not in a grid");
    const AxisFits first = fit_axes(cloud, [](auto...) { return true; });
    // Rounding alone must not count as an outlier, hence the floor.
    const double limit = std::max(3 * first.rms_px, 1e-3);
    const AxisFits fits = fit_axes(cloud, [&](double x, double y, int column, int row) {
        return first.squared_error(x, y, column, row) <= limit * limit;
    });
    if (!(fits.u.slope > 0 && fits.v.slope > 0))
        throw Error(
            fmt::format("no camera can be recovered from the cloud: fx {:.2f}, fy {:.2f}, positive values expected "
                        "(x right, y down, z forward)",
                        fits.u.slope, fits.v.slope));
    if (!(fits.rms_px <= worst_rms_px))
        throw Error(
            fmt::format("no camera can be recovered from the cloud: residual {:.2f} px rms, at most {:.0f} expected; "
                        "its grid is not a pinhole image",
                        fits.rms_px, worst_rms_px));
    return {{fits.u.slope, fits.v.slope, fits.u.offset, fits.v.offset, cloud.grid}, fits.rms_px, fits.points};
}

} // namespace scanshade
