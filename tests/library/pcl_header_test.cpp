// scanshade/pcl.h: clouds as depth images and by rays, as a list and as a field.
#include <scanshade/pcl.h>

#include <cmath>
#include <gtest/gtest.h>
#include <pcl/conversions.h>
#include <pcl/point_types.h>

namespace {

const scanshade::Camera camera{50, 50, 31.5, 23.5};

/// Two walls that meet in an edge, as 64x48 pixels see them; the first point is missing.
pcl::PointCloud<pcl::PointXYZI> corner() {
    pcl::PointCloud<pcl::PointXYZI> cloud(64, 48);
    for (int v = 0; v < 48; ++v)
        for (int u = 0; u < 64; ++u) {
            const float z = 2.0F - 0.02F * static_cast<float>(std::abs(u - 32));
            pcl::PointXYZI& p = cloud.at(u, v);
            p.x = (static_cast<float>(u) - 31.5F) / 50 * z;
            p.y = (static_cast<float>(v) - 23.5F) / 50 * z;
            p.z = z;
            p.intensity = static_cast<float>(u);
        }
    cloud.at(0, 0).x = cloud.at(0, 0).y = cloud.at(0, 0).z = NAN;
    return cloud;
}

TEST(PclHeader, organised_clouds_with_a_camera_are_depth_images) {
    const scanshade::Session session({{"depth-noise", "none"}});
    const auto cloud = corner();
    const std::vector<float> values = scanshade::ambient_occlusion(session, cloud, &camera);
    cv::Mat1f depth(48, 64);
    for (int v = 0; v < 48; ++v)
        for (int u = 0; u < 64; ++u)
            depth(v, u) = std::isfinite(cloud.at(u, v).z) ? cloud.at(u, v).z : 0;
    const cv::Mat1f expected = session.compute(depth, camera).visibility();
    ASSERT_EQ(values.size(), expected.total());
    EXPECT_TRUE(std::isnan(values[0]));
    for (std::size_t i = 1; i < values.size(); ++i)
        ASSERT_EQ(values[i], expected(static_cast<int>(i) / 64, static_cast<int>(i) % 64));
}

TEST(PclHeader, a_field_is_added_once_and_the_others_keep_their_bytes) {
    const scanshade::Session session;
    pcl::PCLPointCloud2 cloud;
    pcl::toPCLPointCloud2(corner(), cloud);
    const pcl::PCLPointCloud2 before = cloud;
    scanshade::add_ambient_occlusion(session, cloud);
    scanshade::add_ambient_occlusion(session, cloud); // replaces
    ASSERT_EQ(cloud.fields.size(), before.fields.size() + 1);
    ASSERT_EQ(cloud.point_step, before.point_step + 4);
    const std::vector<float> values = scanshade::ambient_occlusion(session, corner());
    for (std::size_t i = 0; i < values.size(); ++i) {
        EXPECT_EQ(
            std::memcmp(&cloud.data[i * cloud.point_step], &before.data[i * before.point_step], before.point_step), 0);
        EXPECT_EQ(std::memcmp(&cloud.data[i * cloud.point_step + before.point_step], &values[i], 4), 0);
    }
}

TEST(PclHeader, clouds_without_coordinates_are_refused) {
    pcl::PCLPointCloud2 cloud;
    EXPECT_THROW(scanshade::add_ambient_occlusion(scanshade::Session(), cloud), scanshade::Error);
}

} // namespace
