#include "projection/attach.h"

#include "projection/base/error.h"
#include "projection/project.h"
#include "projection/srgb.h"
#include "projection/undistort.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <span>

namespace scanshade {
namespace {

constexpr float unknown = std::numeric_limits<float>::quiet_NaN();

bool is_depth(float z_m) { return std::isfinite(z_m) && z_m > 0; }

/// Counts what was recorded and what received a value.
class Tally {
  public:
    void add(float visibility) {
        ++valid_;
        if (std::isnan(visibility))
            return;
        ++attached_;
        sum_ += visibility;
    }
    /// Pixels side by side. Eight sums at once: a processor adds them in one instruction.
    void add_row(const float* z_m, const float* visibility, int count) {
        constexpr int lanes = 8;
        std::array<float, lanes> sums{};
        std::array<int, lanes> valid{}, attached{};
        const auto take = [&](int x, int lane) {
            const bool is_valid = (z_m[x] > 0) & (z_m[x] <= std::numeric_limits<float>::max());
            const bool is_known = is_valid & (visibility[x] == visibility[x]);
            valid[lane] += is_valid;
            attached[lane] += is_known;
            sums[lane] += is_known ? visibility[x] : 0;
        };
        int x = 0;
        for (; x + lanes <= count; x += lanes)
            for (int lane = 0; lane < lanes; ++lane)
                take(x + lane, lane);
        for (; x < count; ++x)
            take(x, 0);
        for (int lane = 0; lane < lanes; ++lane) {
            valid_ += valid[lane];
            attached_ += attached[lane];
            sum_ += sums[lane];
        }
    }
    void write_to(Attached& result) const {
        result.coverage = valid_ > 0 ? attached_ / valid_ : 0;
        result.mean_visibility = attached_ > 0 ? sum_ / attached_ : std::numeric_limits<double>::quiet_NaN();
    }

  private:
    double valid_ = 0, attached_ = 0, sum_ = 0;
};

void check_sizes(const DepthImage& depth, const AoMap& ao) {
    if (ao.visibility.size() != depth.z_m.size())
        throw Error(fmt::format("visibility is {}x{}, its depth image {}x{}", ao.visibility.cols, ao.visibility.rows,
                                depth.z_m.cols, depth.z_m.rows));
}

void require_size(const DepthImage& depth, cv::Size wanted) {
    if (depth.z_m.size() != wanted)
        throw Error(fmt::format("the projected depth is {}x{}, that of this frame {}x{}", depth.z_m.cols,
                                depth.z_m.rows, wanted.width, wanted.height));
}

/// Visibility of a surface at depth z_m seen near `pixel`: of the 3x3 pixel on the same surface whose depth is closest,
/// the pixel itself winning ties. NaN where none of them shows that surface.
float visibility_near(const DepthImage& depth, const AoMap& ao, cv::Point pixel, double z_m) {
    double closest = same_surface_m(depth.camera, z_m);
    if (std::abs(depth.z_m(pixel) - z_m) <= closest && !std::isnan(ao.visibility(pixel)))
        return ao.visibility(pixel);
    float found = unknown;
    for (int v = std::max(pixel.y - 1, 0); v <= std::min(pixel.y + 1, depth.z_m.rows - 1); ++v)
        for (int u = std::max(pixel.x - 1, 0); u <= std::min(pixel.x + 1, depth.z_m.cols - 1); ++u)
            if (const double miss = std::abs(depth.z_m(v, u) - z_m);
                miss < closest && !std::isnan(ao.visibility(v, u))) {
                closest = miss;
                found = ao.visibility(v, u);
            }
    return found;
}

cv::Mat1f bent_back(const Frame& frame, const Camera& camera, const DepthImage& depth, const AoMap& ao) {
    const auto maps = Undistortion::of(camera);
    require_size(depth, maps->straight_camera().size);
    const int width = depth.z_m.cols;
    cv::Mat1f visibility(frame.depth_m.size(), unknown);
    for (int v = 0; v < visibility.rows; ++v)
        for (int u = 0; u < visibility.cols; ++u)
            if (const int index = maps->undistorted_pixel()(v, u); index >= 0 && is_depth(frame.depth_m(v, u)))
                visibility(v, u) = visibility_near(depth, ao, {index % width, index / width}, frame.depth_m(v, u));
    return visibility;
}

Attached attach_to_image(const Frame& frame, const DepthImage& depth, const AoMap& ao) {
    const Camera camera = camera_of(frame);
    Attached result;
    if (camera.distortion.any()) {
        result.visibility = bent_back(frame, camera, depth, ao);
    } else {
        require_size(depth, frame.depth_m.size());
        result.visibility = ao.visibility;
    }
    Tally tally;
    for (int v = 0; v < result.visibility.rows; ++v)
        tally.add_row(frame.depth_m[v], result.visibility[v], result.visibility.cols);
    tally.write_to(result);
    return result;
}

/// The value of the pixel a point falls on: its own where the pixel shows it, and that of a neighbour merged into the
/// same pixel where their depths agree.
float visibility_of_point(int index, const Eigen::Vector3d& point, const DepthImage& depth, const AoMap& ao) {
    if (!(point.allFinite() && point.z() > 0))
        return unknown;
    const Pinhole& camera = depth.camera;
    const double u = std::round(camera.fx * point.x() / point.z() + camera.cx);
    const double v = std::round(camera.fy * point.y() / point.z() + camera.cy);
    if (!(u >= 0 && u < camera.size.width && v >= 0 && v < camera.size.height))
        return unknown;
    const cv::Point pixel(static_cast<int>(u), static_cast<int>(v));
    const float z_m = depth.z_m(pixel);
    const bool shown = depth.source(pixel) == index;
    const bool agrees = z_m > 0 && std::abs(z_m - point.z()) <= same_surface_m(camera, point.z());
    return shown || agrees ? ao.visibility(pixel) : unknown;
}

Attached attach_to_cloud(const Cloud& cloud, const DepthImage& depth, const AoMap& ao) {
    if (depth.source.size() != depth.z_m.size())
        throw Error("the depth image does not say which points its pixels show");
    Attached result;
    result.per_point.resize(cloud.points.size());
    Tally tally;
    for (std::size_t i = 0; i < cloud.points.size(); ++i) {
        result.per_point[i] = visibility_of_point(static_cast<int>(i), cloud.points[i], depth, ao);
        if (cloud.points[i].allFinite())
            tally.add(result.per_point[i]);
    }
    result.visibility = cloud.organised()
                            ? cv::Mat1f(cloud.grid.height, cloud.grid.width, result.per_point.data()).clone()
                            : cv::Mat1f(ao.visibility);
    tally.write_to(result);
    return result;
}

} // namespace

Attached attach(const Frame& frame, const DepthImage& depth, const AoMap& ao) {
    check_sizes(depth, ao);
    return frame.cloud ? attach_to_cloud(*frame.cloud, depth, ao) : attach_to_image(frame, depth, ao);
}

cv::Mat3b shade(const cv::Mat3b& colour, const cv::Mat1f& visibility, double strength) {
    if (colour.size() != visibility.size())
        throw Error(fmt::format("colour is {}x{}, visibility {}x{}: nothing says which pixel belongs to which",
                                colour.cols, colour.rows, visibility.cols, visibility.rows));
    const SrgbTables& tables = srgb_tables();
    cv::Mat3b shaded(colour.size());
    const auto full = static_cast<float>(strength);
    for (int row = 0; row < colour.rows; ++row) {
        const cv::Vec3b* from = colour[row];
        const float* visible = visibility[row];
        cv::Vec3b* to = shaded[row];
        for (int column = 0; column < colour.cols; ++column) {
            const float light =
                std::isnan(visible[column]) ? 1 : std::clamp(1 - full + full * visible[column], 0.0F, 1.0F);
            for (int channel = 0; channel < 3; ++channel)
                to[column][channel] =
                    tables.stored[static_cast<int>(tables.linear[from[column][channel]] * light + 0.5F)];
        }
    }
    return shaded;
}

} // namespace scanshade
