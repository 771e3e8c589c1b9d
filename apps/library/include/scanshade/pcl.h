// PCL clouds in, ambient occlusion as their fields out. Header-only; PCL is needed in the user's project alone.
// An organised cloud with a camera goes as a depth image, any other by rays from its points.
#pragma once

#include <scanshade/session.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <pcl/PCLPointCloud2.h>
#include <pcl/point_cloud.h>
#include <vector>

namespace scanshade {

namespace detail {
/// The byte offset of a float field; -1 where there is none of that name and type.
inline int float_offset(const pcl::PCLPointCloud2& cloud, const char* name) {
    for (const pcl::PCLPointField& field : cloud.fields)
        if (field.name == name && field.datatype == pcl::PCLPointField::FLOAT32)
            return static_cast<int>(field.offset);
    return -1;
}

inline std::vector<float> values_of(const cv::Mat1f& map) { return {map.begin(), map.end()}; }

/// Of points x, y, z in row order. `camera`: null = by rays.
inline std::vector<float> ambient_occlusion(const Session& session, const std::vector<Eigen::Vector3f>& points,
                                            std::uint32_t width, std::uint32_t height, const Camera* camera) {
    if (points.size() != std::size_t(width) * height)
        throw Error(SCANSHADE_MISUSE, "cloud: width times height is not the number of its points");
    if (!camera || height < 2)
        return values_of(session.compute(points).visibility());
    cv::Mat1f depth(static_cast<int>(height), static_cast<int>(width));
    auto point = points.begin();
    for (float& z : depth) {
        z = point->allFinite() ? point->z() : 0.0F;
        ++point;
    }
    return values_of(session.compute(depth, *camera, {}, visibility_only).visibility());
}
} // namespace detail

/// Visibility of every point, in the cloud's order; NaN = no surface. An organised cloud in camera space (x right, y
/// down, z forward, metres) with its `camera` is computed as a depth image. Throws Error.
template <class PointT>
[[nodiscard]] std::vector<float> ambient_occlusion(const Session& session, const pcl::PointCloud<PointT>& cloud,
                                                   const Camera* camera = nullptr) {
    std::vector<Eigen::Vector3f> points;
    points.reserve(cloud.size());
    for (const PointT& p : cloud)
        points.emplace_back(p.x, p.y, p.z);
    return detail::ambient_occlusion(session, points, cloud.width, cloud.height, camera);
}

/// Adds the field "ambient_occlusion" to the cloud, or replaces its values; all other fields keep their bytes. The
/// cloud needs float fields x, y and z. Throws Error.
inline void add_ambient_occlusion(const Session& session, pcl::PCLPointCloud2& cloud, const Camera* camera = nullptr) {
    const int x = detail::float_offset(cloud, "x"), y = detail::float_offset(cloud, "y"),
              z = detail::float_offset(cloud, "z");
    if (x < 0 || y < 0 || z < 0)
        throw Error(SCANSHADE_MISUSE, "cloud: expected fields x, y and z of 32-bit floats");
    const std::size_t count = std::size_t(cloud.width) * cloud.height, step = cloud.point_step;
    if (cloud.row_step != step * cloud.width || cloud.data.size() != step * count)
        throw Error(SCANSHADE_MISUSE, "cloud: expected packed rows and as many bytes as its points have");
    std::vector<Eigen::Vector3f> points(count);
    for (std::size_t i = 0; i < count; ++i) {
        const int offsets[] = {x, y, z};
        for (int axis = 0; axis < 3; ++axis)
            std::memcpy(&points[i][axis], &cloud.data[i * step + static_cast<std::size_t>(offsets[axis])], 4);
    }
    const std::vector<float> values = detail::ambient_occlusion(session, points, cloud.width, cloud.height, camera);
    int field = detail::float_offset(cloud, "ambient_occlusion");
    if (field < 0) {
        const std::size_t wider = step + sizeof(float);
        std::vector<std::uint8_t> data(wider * count);
        for (std::size_t i = 0; i < count; ++i)
            std::memcpy(&data[i * wider], &cloud.data[i * step], step);
        cloud.data = std::move(data);
        pcl::PCLPointField added;
        added.name = "ambient_occlusion";
        added.offset = static_cast<std::uint32_t>(step);
        added.datatype = pcl::PCLPointField::FLOAT32;
        added.count = 1;
        cloud.fields.push_back(added);
        cloud.point_step = static_cast<std::uint32_t>(wider);
        cloud.row_step = static_cast<std::uint32_t>(wider * cloud.width);
        field = static_cast<int>(step);
    }
    for (std::size_t i = 0; i < count; ++i)
        std::memcpy(&cloud.data[i * cloud.point_step + static_cast<std::size_t>(field)], &values[i], sizeof(float));
}

} // namespace scanshade
