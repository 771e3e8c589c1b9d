// MCAP files and messages of ROS 2 as they are written: read back by the reader, and against the specification.
#include "io/captures/recordings/ros/bag.h"
#include "io/captures/recordings/ros/mcap_output.h"
#include "io/captures/recordings/ros/message_output.h"
#include "projection/base/error.h"
#include "tests/support/files.h"

#include <bit>
#include <cstring>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <zlib.h>

namespace scanshade::ros {
namespace {

namespace fs = std::filesystem;
using tests::file_bytes;
using tests::TemporaryFolder;
using tests::write_file;

template <class Number>
Number number_at(const std::string& bytes, std::uint64_t at) {
    Number value{};
    std::memcpy(&value, bytes.data() + at, sizeof value);
    return value;
}

std::uint32_t crc(const std::string& bytes, std::uint64_t begin, std::uint64_t end) {
    return static_cast<std::uint32_t>(
        crc32(0, reinterpret_cast<const Bytef*>(bytes.data() + begin), static_cast<uInt>(end - begin)));
}

std::vector<Channel> channels() {
    std::vector<Channel> rows;
    for (const auto& [topic, type] : {std::pair{"/a", "std_msgs/msg/String"},
                                      {"/never", "sensor_msgs/msg/Image"},
                                      {"/b", "std_msgs/msg/String"},
                                      {"/camera_info", "sensor_msgs/msg/CameraInfo"}})
        rows.push_back({topic, type, definition_of(type)});
    return rows;
}

/// One group: a short message on /a and one of `size` bytes on /b.
std::string group(int number, std::size_t size) {
    const auto at = static_cast<std::uint32_t>(number);
    return packed_group(fmt::format("frame {}", number),
                        {{1, at, 1000ULL * at, text_message(fmt::format("first {}", number))},
                         {3, at, 1000ULL * at + 1, text_message(std::string(size, static_cast<char>('a' + number)))}});
}

fs::path written(const fs::path& file, const std::vector<std::string>& groups) {
    McapOutput output(file, "scanshade test", channels());
    for (const std::string& each : groups)
        output.add(each);
    output.finish();
    return file;
}

TEST(McapOutputTest, messages_come_back_as_they_were_written) {
    const TemporaryFolder folder;
    const auto bag = open_mcap(written(folder / "a.mcap", {group(1, 10), group(2, 5 << 20), group(3, 30)}));
    EXPECT_TRUE(bag->warnings.empty()) << tests::joined(bag->warnings);
    ASSERT_EQ(bag->topics.size(), 2u) << "a topic without messages is not declared";
    EXPECT_EQ(bag->topics[0].name, "/a");
    EXPECT_EQ(bag->topics[1].name, "/b");
    EXPECT_EQ(bag->topics[1].type, "std_msgs/String");
    EXPECT_EQ(bag->topics[1].encoding, Encoding::cdr);
    ASSERT_EQ(bag->messages.size(), 6u);
    for (int i = 0; i < 3; ++i) {
        const Message &first = bag->messages[2 * static_cast<std::size_t>(i)],
                      &second = bag->messages[2 * static_cast<std::size_t>(i) + 1];
        EXPECT_EQ(first.recorded_ns, 1000 * (i + 1));
        EXPECT_EQ(bag->bytes(first), text_message(fmt::format("first {}", i + 1)));
        EXPECT_EQ(second.recorded_ns, 1000 * (i + 1) + 1);
        const std::size_t size = i == 0 ? 10 : i == 1 ? 5 << 20 : 30;
        EXPECT_EQ(bag->bytes(second), text_message(std::string(size, static_cast<char>('b' + i))));
    }
}

// The specification (mcap.dev/spec) says what each number is; players seek by them.
TEST(McapOutputTest, checksums_and_offsets_of_the_summary_are_right) {
    const TemporaryFolder folder;
    const std::string bytes = file_bytes(written(folder / "a.mcap", {group(1, 10), group(2, 5 << 20)}));
    const std::uint64_t footer = bytes.size() - 8 - 29;
    ASSERT_EQ(bytes.substr(0, 8), "\x89MCAP0\r\n");
    ASSERT_EQ(bytes.substr(bytes.size() - 8), "\x89MCAP0\r\n");
    ASSERT_EQ(bytes[footer], 2);
    const auto summary = number_at<std::uint64_t>(bytes, footer + 9),
               offsets = number_at<std::uint64_t>(bytes, footer + 17);
    EXPECT_EQ(number_at<std::uint32_t>(bytes, footer + 25), crc(bytes, summary, footer + 25));
    const std::uint64_t data_end = summary - 13;
    ASSERT_EQ(bytes[data_end], 15);
    EXPECT_EQ(number_at<std::uint32_t>(bytes, data_end + 9), crc(bytes, 0, data_end));

    int chunks = 0, metadata = 0;
    std::uint64_t messages = 0;
    for (std::uint64_t at = summary; at < offsets; at += 9 + number_at<std::uint64_t>(bytes, at + 1)) {
        const std::uint64_t content = at + 9;
        if (bytes[at] == 8) {
            ++chunks;
            const auto chunk = number_at<std::uint64_t>(bytes, content + 16),
                       length = number_at<std::uint64_t>(bytes, content + 24);
            ASSERT_EQ(bytes[chunk], 6);
            EXPECT_EQ(length, 9 + number_at<std::uint64_t>(bytes, chunk + 1));
            EXPECT_EQ(bytes.substr(content, 16), bytes.substr(chunk + 9, 16)) << "first and last time";
            const auto map = number_at<std::uint32_t>(bytes, content + 32);
            std::uint64_t indexes = 0;
            for (std::uint64_t row = content + 36; row < content + 36 + map; row += 10) {
                const auto index = number_at<std::uint64_t>(bytes, row + 2);
                ASSERT_EQ(bytes[index], 7);
                EXPECT_GE(index, chunk + length);
                EXPECT_EQ(number_at<std::uint16_t>(bytes, index + 9), number_at<std::uint16_t>(bytes, row));
                indexes += 9 + number_at<std::uint64_t>(bytes, index + 1);
                messages += number_at<std::uint32_t>(bytes, index + 11) / 16;
            }
            EXPECT_EQ(number_at<std::uint64_t>(bytes, content + 36 + map), indexes);
        } else if (bytes[at] == 13) {
            ++metadata;
            EXPECT_EQ(bytes[number_at<std::uint64_t>(bytes, content)], 12);
        } else if (bytes[at] == 11) {
            EXPECT_EQ(number_at<std::uint64_t>(bytes, content), 4u) << "messages";
            EXPECT_EQ(number_at<std::uint16_t>(bytes, content + 8), 1u) << "schemas";
            EXPECT_EQ(number_at<std::uint32_t>(bytes, content + 10), 2u) << "channels";
        }
    }
    EXPECT_EQ(chunks, 3) << "five megabytes have a chunk of their own";
    EXPECT_EQ(metadata, 2);
    EXPECT_EQ(messages, 4u);
    for (std::uint64_t at = offsets; at < footer; at += 9 + number_at<std::uint64_t>(bytes, at + 1)) {
        ASSERT_EQ(bytes[at], 14);
        EXPECT_EQ(bytes[number_at<std::uint64_t>(bytes, at + 10)], bytes[at + 9]);
    }
}

TEST(McapOutputTest, a_file_cut_anywhere_keeps_its_whole_groups) {
    const TemporaryFolder folder;
    const std::vector<std::string> groups{group(1, 40), group(2, 50), group(3, 60)};
    const std::string bytes = file_bytes(written(folder / "a.mcap", groups));
    const auto all = groups_in(folder / "a.mcap");
    ASSERT_EQ(all.size(), 3u);
    for (std::size_t i = 0; i < 3; ++i) {
        EXPECT_EQ(all[i].name, fmt::format("frame {}", i + 1));
        EXPECT_EQ(bytes.substr(all[i].at, all[i].size), groups[i]);
    }
    for (std::size_t size = 0; size < bytes.size(); size += 7) {
        write_file(folder / "cut.mcap", bytes.substr(0, size));
        const auto whole = static_cast<std::size_t>(
            std::ranges::count_if(all, [&](const GroupPlace& each) { return each.at + each.size <= size; }));
        EXPECT_EQ(groups_in(folder / "cut.mcap").size(), whole) << size;
    }
}

TEST(McapOutputTest, a_damaged_group_is_left_out_and_the_others_stay) {
    const TemporaryFolder folder;
    std::string bytes = file_bytes(written(folder / "a.mcap", {group(1, 40), group(2, 50), group(3, 60)}));
    const auto all = groups_in(folder / "a.mcap");
    bytes[all[1].at + all[1].size - 3] ^= 1;
    const auto left = groups_in(write_file(folder / "b.mcap", bytes));
    ASSERT_EQ(left.size(), 2u);
    EXPECT_EQ(left[0].name, "frame 1");
    EXPECT_EQ(left[1].name, "frame 3");
}

// A resumed run takes groups from the file before it.
TEST(McapOutputTest, copied_groups_make_the_same_file) {
    const TemporaryFolder folder;
    const std::string whole = file_bytes(written(folder / "a.mcap", {group(1, 40), group(2, 50)}));
    const std::string part = file_bytes(written(folder / "b.mcap", {group(2, 50)}));
    const auto place = groups_in(folder / "b.mcap").at(0);
    written(folder / "c.mcap", {group(1, 40), part.substr(place.at, place.size)});
    EXPECT_EQ(file_bytes(folder / "c.mcap"), whole);
}

TEST(McapOutputTest, a_run_without_frames_is_a_file_all_the_same) {
    const TemporaryFolder folder;
    const auto bag = open_mcap(written(folder / "a.mcap", {}));
    EXPECT_TRUE(bag->messages.empty());
    EXPECT_TRUE(bag->topics.empty());
}

TEST(McapOutputTest, a_full_disk_is_an_outage_that_names_the_file) {
    if (!fs::exists("/dev/full"))
        GTEST_SKIP() << "no /dev/full";
    EXPECT_THROW(
        {
            McapOutput output("/dev/full", "scanshade test", channels());
            output.add(group(1, 1 << 20));
            output.finish();
        },
        Outage);
}

// ---------------------------------------------------------------------------------------------------- messages

constexpr Header header_at(std::int64_t ns) { return {ns, {}}; }

TEST(MessageOutputTest, cameras_come_back) {
    Camera camera;
    camera.pinhole = {525.5, 526.25, 319.5, 239.75, {640, 480}};
    camera.distortion = {.k1 = 0.1, .k2 = -0.2, .p1 = 0.003, .p2 = -0.004, .k3 = 0.05};
    Header header = header_at(1'700'000'000'123'456'789);
    header.frame = "camera_optical";
    const CameraInfo info = camera_info_in(message_of(info_of(camera, header)), Encoding::cdr);
    EXPECT_EQ(info.header.stamp_ns, header.stamp_ns);
    EXPECT_EQ(info.header.frame, "camera_optical");
    const auto back = camera_of(info, false, {640, 480});
    ASSERT_TRUE(back);
    EXPECT_EQ(back->pinhole, camera.pinhole);
    EXPECT_EQ(back->distortion, camera.distortion);
    const auto rectified = camera_of(info, true, {640, 480});
    EXPECT_EQ(rectified->pinhole, camera.pinhole);

    camera.distortion = {.k1 = 0.1, .k2 = 0.2, .k3 = 0.3, .k4 = 0.4, .model = LensModel::kannala_brandt};
    const auto fisheye =
        camera_of(camera_info_in(message_of(info_of(camera, header)), Encoding::cdr), false, {640, 480});
    EXPECT_EQ(fisheye->distortion, camera.distortion);
}

TEST(MessageOutputTest, a_region_whose_area_is_no_int_is_a_camera_of_that_size) {
    Camera camera;
    camera.pinhole = {525.5, 526.25, 319.5, 239.75, {640, 480}};
    CameraInfo info = camera_info_in(message_of(info_of(camera, header_at(5))), Encoding::cdr);
    info.region = {0, 0, 1 << 20, 1 << 20};
    const auto found = camera_of(info, false, {512, 512});
    ASSERT_TRUE(found);
    EXPECT_EQ(found->pinhole.size, cv::Size(512, 512));
    EXPECT_DOUBLE_EQ(found->pinhole.fx, 525.5 / 2048);
}

TEST(MessageOutputTest, images_and_poses_come_back) {
    cv::Mat1w depth(3, 5);
    for (int i = 0; i < 15; ++i)
        depth(i / 5, i % 5) = static_cast<ushort>(i * 4000);
    const ImageMessage image = image_in(image_message({5, "camera"}, depth, "16UC1"), Encoding::cdr);
    EXPECT_EQ(image.header.stamp_ns, 5);
    EXPECT_EQ(cv::norm(depth_in(image), depth, cv::NORM_INF), 0);
    cv::Mat1f floats(3, 5);
    depth.convertTo(floats, CV_32F, 0.001);
    // A part of a wider image: its rows do not follow each other in memory.
    const cv::Mat1f part = floats.colRange(1, 4);
    EXPECT_EQ(
        cv::norm(depth_in(image_in(image_message({5, "camera"}, part, "32FC1"), Encoding::cdr)), part, cv::NORM_INF),
        0);

    const CompressedImage png = compressed_image_in(
        message_of(CompressedImage{{7, "camera"}, "mono16; png compressed mono16", "bytes"}), Encoding::cdr);
    EXPECT_EQ(png.format, "mono16; png compressed mono16");
    EXPECT_EQ(png.data, "bytes");

    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.linear() = Eigen::AngleAxisd(2.5, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
    pose.translation() = Eigen::Vector3d(1.5, -2.5, 1e6);
    const auto back =
        transforms_in(message_of({{11, "world", "camera", pose}, {12, "camera", "colour", pose}}), Encoding::cdr);
    ASSERT_EQ(back.size(), 2u);
    EXPECT_EQ(back[1].stamp_ns, 12);
    EXPECT_EQ(back[0].parent, "world");
    EXPECT_EQ(back[0].child, "camera");
    EXPECT_LT((back[0].parent_from_child.matrix() - pose.matrix()).norm(), 1e-12);
}

TEST(MessageOutputTest, points_are_floats_about_their_origin_with_colour_as_bits) {
    const std::vector<Eigen::Vector3d> points{{5e6 + 0.25, 1, 2}, {5e6 + 0.5, 3, std::nan("")}};
    const std::vector<cv::Vec3b> colours{{1, 2, 250}, {0, 0, 0}};
    const std::vector<float> open{0.5F, 1};
    PointCloud cloud{.header = {3, "map"}, .points = points};
    cloud.origin = {5e6, 0, 0};
    cloud.grid = {1, 2};
    cloud.colours = colours;
    cloud.fields = {{"ambient_occlusion", open}};
    const std::string message = message_of(cloud);
    ASSERT_EQ(bytes_of(cloud), 40u);
    ASSERT_EQ(message.back(), 0) << "not dense: a coordinate is NaN";
    const std::uint64_t at = message.size() - 1 - 40;
    EXPECT_EQ(number_at<std::uint32_t>(message, at - 4), 40u);
    EXPECT_EQ(number_at<float>(message, at), 0.25F);
    EXPECT_EQ(number_at<float>(message, at + 8), 2);
    EXPECT_EQ(number_at<std::uint32_t>(message, at + 12), 0xfa0201u);
    EXPECT_EQ(number_at<float>(message, at + 16), 0.5F);
    EXPECT_EQ(number_at<float>(message, at + 20), 0.5F);
    EXPECT_TRUE(std::isnan(number_at<float>(message, at + 28)));
    EXPECT_NE(message.find("ambient_occlusion"), std::string::npos);
}

TEST(MessageOutputTest, every_type_of_a_definition_is_defined_in_it) {
    for (const char* type : {"sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/CameraInfo",
                             "sensor_msgs/msg/PointCloud2", "tf2_msgs/msg/TFMessage", "std_msgs/msg/String"}) {
        const std::string text = definition_of(type);
        for (std::size_t slash = text.find('/'); slash != std::string::npos; slash = text.find('/', slash + 1)) {
            const std::size_t begin = text.find_last_of(" \n", slash) + 1;
            const std::string used =
                text.substr(begin == std::string::npos ? 0 : begin, text.find_first_of("[ \n", slash) - begin);
            EXPECT_NE(text.find("MSG: " + used + "\n"), std::string::npos) << type << " uses " << used;
        }
    }
    EXPECT_THROW((void)definition_of("nav_msgs/msg/Odometry"), Error);
}

} // namespace
} // namespace scanshade::ros
