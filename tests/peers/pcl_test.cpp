// Our files and normals against PCL's readers and estimators: equal where both mean the same.
#include "ao/raycast/depth_surface.h"
#include "io/clouds/cloud_file.h"
#include "tests/support/files.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <numbers>
#include <pcl/features/integral_image_normal.h>
#include <pcl/features/normal_3d.h>
#include <pcl/io/pcd_io.h>
#include <pcl/io/ply_io.h>
#include <pcl/point_types.h>
#include <pcl/search/kdtree.h>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using tests::TemporaryFolder;
using tests::write_file;

/// A field of PCL's cloud as floats.
std::vector<float> values_of(const pcl::PCLPointCloud2& cloud, const std::string& name) {
    std::vector<float> values;
    for (const pcl::PCLPointField& field : cloud.fields)
        if (field.name == name) {
            EXPECT_EQ(field.datatype, pcl::PCLPointField::FLOAT32);
            for (std::size_t at = field.offset; at < cloud.data.size(); at += cloud.point_step)
                std::memcpy(&values.emplace_back(), &cloud.data[at], sizeof(float));
        }
    return values;
}

std::string names_of(const pcl::PCLPointCloud2& cloud) {
    std::string names;
    for (const pcl::PCLPointField& field : cloud.fields)
        names += field.name + ' ';
    return names;
}

const std::vector<float> visibility{0.5F, 1, 0, 0.25F};

TEST(PclTest, reads_the_fields_values_and_order_of_pcd_files_that_we_write) {
    const TemporaryFolder folder;
    const std::string header =
        "VERSION 0.7\nFIELDS x y z intensity\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\nWIDTH 2\n"
        "HEIGHT 2\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 4\nDATA ascii\n";
    write_file(folder / "text.pcd", header + "1 2 3 9\n1.5 2 3 8\n-1 0.1 3 7\n4 5 6 6\n");
    pcl::PCLPointCloud2 original;
    ASSERT_EQ(pcl::PCDReader().read((folder / "text.pcd").string(), original), 0);
    ASSERT_EQ(pcl::PCDWriter().writeBinary((folder / "binary.pcd").string(), original), 0);
    ASSERT_EQ(pcl::PCDWriter().writeBinaryCompressed((folder / "packed.pcd").string(), original), 0);
    for (const char* name : {"text", "binary", "packed"}) {
        SCOPED_TRACE(name);
        std::vector<std::string> warnings;
        const Cloud cloud = read_cloud(folder / (std::string(name) + ".pcd"), warnings);
        const fs::path written = folder / (std::string(name) + "-ao.pcd");
        write_cloud(written, cloud, {{"ambient_occlusion", visibility}});
        pcl::PCLPointCloud2 theirs;
        ASSERT_EQ(pcl::PCDReader().read(written.string(), theirs), 0);
        EXPECT_EQ(names_of(theirs), "x y z intensity ambient_occlusion ");
        EXPECT_EQ(theirs.width, 2U);
        EXPECT_EQ(theirs.height, 2U);
        EXPECT_EQ(values_of(theirs, "x"), values_of(original, "x"));
        EXPECT_EQ(values_of(theirs, "intensity"), values_of(original, "intensity"));
        EXPECT_EQ(values_of(theirs, "ambient_occlusion"), visibility);
    }
}

TEST(PclTest, reads_the_points_colours_and_values_of_ply_files_that_we_write) {
    const TemporaryFolder folder;
    write_new_ply(folder / "new.ply", {{1, 2, 3}, {4, 5, 6}, {0.1, 0, 1}, {-1, 0, 1}},
                  {{1, 2, 3}, {4, 5, 6}, {7, 8, 9}, {250, 251, 252}}, {{"ambient_occlusion", visibility}});
    pcl::PCLPointCloud2 theirs;
    ASSERT_EQ(pcl::PLYReader().read((folder / "new.ply").string(), theirs), 0);
    EXPECT_EQ(values_of(theirs, "x"), (std::vector<float>{1, 4, 0.1F, -1}));
    EXPECT_EQ(values_of(theirs, "ambient_occlusion"), visibility);
}

// ---------------------------------------------------------------------------------------------------- normals

constexpr int width = 640, height = 480;
constexpr double focal = 600, cx = 319.5, cy = 239.5;

/// A sphere before a tilted plane, by a pinhole.
DepthImage sphere_before_a_plane() {
    DepthImage depth;
    depth.camera = {focal, focal, cx, cy, {width, height}};
    depth.z_m = cv::Mat1f(height, width);
    const Eigen::Vector3d centre(0.1, 0, 2), plane = Eigen::Vector3d(0.3, -0.5, -1).normalized();
    for (int v = 0; v < height; ++v)
        for (int u = 0; u < width; ++u) {
            const Eigen::Vector3d ray((u - cx) / focal, (v - cy) / focal, 1);
            const double b = ray.dot(centre), a = ray.squaredNorm(), root = b * b - a * (centre.squaredNorm() - 0.36);
            const double z = root > 0 ? (b - std::sqrt(root)) / a : -3 * std::abs(plane.z()) / plane.dot(ray);
            depth.z_m(v, u) = static_cast<float>(z);
        }
    return depth;
}

pcl::PointCloud<pcl::PointXYZ>::Ptr points_of(const DepthImage& depth) {
    auto cloud = pcl::make_shared<pcl::PointCloud<pcl::PointXYZ>>(width, height);
    for (int v = 0; v < height; ++v)
        for (int u = 0; u < width; ++u) {
            const float z = depth.z_m(v, u);
            cloud->at(u, v) = {static_cast<float>((u - cx) / focal) * z, static_cast<float>((v - cy) / focal) * z, z};
        }
    return cloud;
}

/// The median angle between their normals and ours, in degrees, over pixels of the sphere where both have one. On
/// purpose ours differ there: each axis takes the one neighbour towards which the surface bends less, so that no edge
/// is crossed, and the normal belongs to a point half a pixel away. At 160x120 that is 0.78 degrees on this sphere.
double median_angle_on_the_sphere(const DepthImage& depth, const pcl::PointCloud<pcl::Normal>& theirs) {
    const cv::Mat3f ours = normals_of(depth).normals;
    std::vector<double> angles;
    for (int v = 0; v < height; ++v)
        for (int u = 0; u < width; ++u) {
            const pcl::Normal& n = theirs.at(static_cast<std::size_t>(v * width + u));
            const double cosine = ours(v, u)[0] * n.normal_x + ours(v, u)[1] * n.normal_y + ours(v, u)[2] * n.normal_z;
            if (std::isfinite(cosine) && depth.z_m(v, u) < 2)
                angles.push_back(std::acos(std::clamp(cosine, -1.0, 1.0)) * 180 / std::numbers::pi);
        }
    EXPECT_GT(angles.size(), 20000U);
    std::ranges::nth_element(angles, angles.begin() + static_cast<std::ptrdiff_t>(angles.size() / 2));
    const double median = angles[angles.size() / 2];
    fmt::print("median angle {:.3f} degrees over {} pixels\n", median, angles.size());
    return median;
}

TEST(PclTest, normals_of_clean_depth_are_those_of_both_of_its_estimators) {
    const DepthImage depth = sphere_before_a_plane();
    const auto cloud = points_of(depth);
    pcl::PointCloud<pcl::Normal> theirs;
    pcl::IntegralImageNormalEstimation<pcl::PointXYZ, pcl::Normal> integral;
    integral.setNormalEstimationMethod(integral.AVERAGE_3D_GRADIENT);
    integral.setMaxDepthChangeFactor(0.02F);
    integral.setNormalSmoothingSize(3);
    integral.setInputCloud(cloud);
    integral.compute(theirs);
    EXPECT_LE(median_angle_on_the_sphere(depth, theirs), 0.5);
    pcl::NormalEstimation<pcl::PointXYZ, pcl::Normal> nearest;
    nearest.setSearchMethod(pcl::make_shared<pcl::search::KdTree<pcl::PointXYZ>>());
    nearest.setKSearch(9);
    nearest.setInputCloud(cloud);
    nearest.compute(theirs);
    EXPECT_LE(median_angle_on_the_sphere(depth, theirs), 0.5);
}

} // namespace
} // namespace scanshade
