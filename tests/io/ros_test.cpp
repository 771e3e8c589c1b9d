// Recordings of ROS, made here byte by byte: bags of ROS 1, MCAP and rosbag2's SQLite files.
#include "io/captures/capture.h"
#include "io/captures/listing/layouts.h"
#include "tests/support/files.h"
#include "tests/support/ros_files.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using namespace tests;

struct Container {
    const char* name;
    bool cdr;
    std::string (*file)(const std::vector<TestMessage>& messages, const std::string& compression, const fs::path& path);
    const char* compression;
    friend std::ostream& operator<<(std::ostream& stream, const Container& container) {
        return stream << container.name;
    }
};

constexpr std::array containers{
    Container{"bag", false, bag_of_ros1, "none"},    Container{"bag_bz2", false, bag_of_ros1, "bz2"},
    Container{"bag_lz4", false, bag_of_ros1, "lz4"}, Container{"mcap", true, mcap, ""},
    Container{"mcap_zstd", true, mcap, "zstd"},      Container{"mcap_lz4", true, mcap, "lz4"},
    Container{"sqlite", true, sqlite, ""},           Container{"sqlite_zstd", true, sqlite, "zstd"}};

class Ros : public testing::TestWithParam<Container>, protected RosMessages {
  protected:
    Ros() : RosMessages(GetParam().cdr) {}
    [[nodiscard]] fs::path recording(const std::vector<TestMessage>& all) const {
        const fs::path file = folder / "a.recording";
        const std::string bytes = GetParam().file(all, GetParam().compression, file);
        return write_file(file, bytes);
    }
    tests::TemporaryFolder folder;
};

TEST_P(Ros, depth_camera_colour_and_poses_are_found) {
    const Capture capture = open_capture(recording(messages()));
    EXPECT_EQ(capture.kind, "ROS recording");
    ASSERT_EQ(capture.entries.size(), 3U);
    for (std::size_t i = 0; i < 3; ++i) {
        SCOPED_TRACE(i);
        const Frame frame = capture.load(i);
        const double stamp = 1 + 0.125 * static_cast<double>(i);
        EXPECT_EQ(capture.entries[i].stamp_s, stamp) << "of the header, not of the recorder";
        EXPECT_EQ(frame.depth_m.size(), cv::Size(8, 6));
        EXPECT_EQ(frame.depth_m(0, 0), 0);
        EXPECT_EQ(frame.depth_m(1, 1), 3);
        EXPECT_EQ(frame.depth_m(5, 7), 2) << "rows are padded";
        EXPECT_EQ(frame.camera.pinhole, (Pinhole{10, 11, 3.5, 2.5, {8, 6}}));
        EXPECT_EQ(frame.camera.distortion.k1, 0.1);
        ASSERT_TRUE(frame.world_from_camera);
        EXPECT_NEAR(frame.world_from_camera->translation().x(), stamp + 0.25, 1e-9);
        EXPECT_EQ(frame.registration, Registration::no);
        ASSERT_TRUE(frame.colour_camera);
        EXPECT_NEAR(frame.colour_camera->colour_from_depth.translation().x(), -0.25, 1e-9);
        EXPECT_EQ(frame.colour.empty(), i == 2);
        if (i < 2) {
            EXPECT_EQ(frame.colour(5, 5), cv::Vec3b(9, 99, 199));
        }
    }
    EXPECT_TRUE(warned(capture.load(2).warnings, "no colour image within 0.02 s"));
}

TEST_P(Ros, a_topic_can_be_named_and_what_is_there_is_listed) {
    std::vector<TestMessage> all = messages();
    for (TestMessage& message : all)
        if (message.topic == "/depth/image_raw")
            message.topic = "/tof/image_raw";
    const fs::path file = recording(all);
    EXPECT_TRUE(says(refusal([&] { (void)open_capture(file); }),
                     "no topic of depth images; --topic names one. It has /tf_static (tf2_msgs/TFMessage, 2)"));
    CaptureOptions options;
    options.topic = "/tof/image_raw";
    const Capture capture = open_capture(file, options);
    EXPECT_EQ(capture.load(1).depth_m(1, 1), 3);
    EXPECT_TRUE(warned(capture.warnings, "there is no topic /tof/camera_info"));
    options.topic = "/not";
    EXPECT_THROW((void)open_capture(file, options), Misuse);
}

TEST_P(Ros, recordings_of_clouds_are_refused_as_such) {
    const std::vector<TestMessage> clouds{{"/ouster/points", "sensor_msgs/PointCloud2", 1, "xyz"},
                                          {"/ouster/points", "sensor_msgs/PointCloud2", 2, "xyz"}};
    const std::string expected = "clouds and no depth images: /ouster/points (sensor_msgs/PointCloud2, 2). Clouds of "
                                 "recordings are not read: export them as PCD or PLY";
    EXPECT_TRUE(says(refusal([&] { (void)open_capture(recording(clouds)); }), expected));
    std::vector<TestMessage> with_colour = clouds;
    for (const TestMessage& message : messages())
        if (message.topic.find("depth") == std::string::npos)
            with_colour.push_back(message);
    EXPECT_TRUE(says(refusal([&] { (void)open_capture(recording(with_colour)); }), expected)) << "colour is no depth";
    CaptureOptions options;
    options.topic = "/ouster/points";
    EXPECT_TRUE(says(refusal([&] { (void)open_capture(recording(clouds), options); }),
                     "its messages are sensor_msgs/PointCloud2, expected images of depth"));
}

TEST_P(Ros, several_recordings_in_a_folder_are_several_captures) {
    const fs::path first = recording(messages());
    const fs::path set = folder / "set";
    fs::create_directories(set);
    const std::string kind = GetParam().name, extension = kind.starts_with("bag")    ? ".bag"
                                                          : kind.starts_with("mcap") ? ".mcap"
                                                                                     : ".db3";
    for (const char* name : {"monday", "tuesday"})
        fs::copy_file(first, set / (name + extension));
    try {
        (void)open_capture_at_or_below(set);
        ADD_FAILURE() << "one of two was opened";
    } catch (const SeveralCaptures& several) {
        EXPECT_EQ(several.captures,
                  (std::vector<fs::path>{set / ("monday" + extension), set / ("tuesday" + extension)}));
    }
    EXPECT_EQ(captures_below(set).size(), 2U);
    write_file(set / ("empty" + extension), file_bytes(recording({{"/log", "rosgraph_msgs/Log", 1, "none"}})));
    EXPECT_EQ(captures_below(set).size(), 3U) << "what cannot be opened is told, not passed over";
}

TEST_P(Ros, floats_are_metres_and_images_without_times_take_the_recorders) {
    const Capture capture = open_capture(recording({{"/depth/image", image_type, 4.25, depth(0, "32FC1")},
                                                    {"/depth/camera_info", info_type, 4.25, camera({8, 6}, 10, "x")}}));
    EXPECT_EQ(capture.load(0).depth_m(1, 1), 3);
    EXPECT_EQ(capture.entries[0].stamp_s, 4.25);
    EXPECT_TRUE(warned(capture.warnings, "no header has a time"));
}

TEST_P(Ros, rational_lenses_have_eight_numbers) {
    const auto opened = [&](const std::vector<double>& lens) {
        return open_capture(
            recording({{"/depth/image", image_type, 4, depth(1)},
                       {"/depth/camera_info", info_type, 4, camera({8, 6}, 10, "x", "rational_polynomial", lens)}}));
    };
    const Capture capture = opened({0.4, 0.02, 0.001, -0.002, 0.003, 0.7, 0.1, 0.006});
    ASSERT_TRUE(capture.camera);
    EXPECT_EQ(capture.camera->distortion, (Distortion{0.4, 0.02, 0.001, -0.002, 0.003, 0.7, 0.1, 0.006}));
    EXPECT_TRUE(says(refusal([&] {
                         (void)opened({0.4, 0, 0, 0, 0, 0.7, 0.1, 0.006, 0.5, 0, 0, 0});
                     }),
                     "\"rational_polynomial\" with 12 coefficients"));
}

/// RVL's groups of 4 bits, from the top of each word.
std::string words_of(std::initializer_list<unsigned> groups) {
    std::string bytes;
    std::uint32_t word = 0;
    unsigned filled = 0;
    for (const unsigned group : groups) {
        word |= group << (28 - 4 * filled);
        if (++filled == 8) {
            bytes += raw(word);
            word = filled = 0;
        }
    }
    return filled > 0 ? bytes + raw(word) : bytes;
}

TEST_P(Ros, compressed_depth_is_png_or_rvl_and_inverse_depth_becomes_metres) {
    cv::Mat1w millimetres(2, 3, ushort(2000));
    millimetres(0, 0) = 0;
    std::vector<uchar> encoded;
    ASSERT_TRUE(cv::imencode(".png", millimetres, encoded));
    const std::string png(encoded.begin(), encoded.end()), size = raw(3U) + raw(2U);
    const std::string settings = raw(0) + raw(4000.0F) + raw(0.0F); // inverse depth: metres = 4000 / (v - 0)
    // One zero and five values: 2000, whose zigzag is 4000, octal 7640, then four differences of 0.
    const std::string rvl = size + words_of({1, 5, 8, 12, 14, 7, 0, 0, 0, 0});
    const auto message = [&](double stamp, const std::string& format, const std::string& data) {
        return TestMessage{"/depth/image_raw/compressedDepth", "sensor_msgs/CompressedImage", stamp,
                           fields().header(stamp, "depth_optical").add(format).bytes(data).text()};
    };
    std::vector<TestMessage> all{message(1, "16UC1; compressedDepth", settings + png),
                                 message(2, "16UC1; compressedDepth rvl", settings + rvl),
                                 message(3, "16UC1; compressedDepth png", png)};
    const Capture capture = open_capture(recording(all));
    for (std::size_t i = 0; i < 3; ++i) {
        const cv::Mat1f depth_m = capture.load(i).depth_m;
        EXPECT_EQ(depth_m(0, 0), 0) << i;
        EXPECT_EQ(depth_m(0, 1), 2) << i;
        EXPECT_EQ(depth_m(1, 2), 2) << i;
    }
    all.push_back(message(4, "32FC1; compressedDepth png", settings + png));
    const Capture mixed = open_capture(recording(all));
    EXPECT_EQ(mixed.load(0).depth_m(0, 1), 2);
    EXPECT_EQ(mixed.load(3).depth_m(1, 2), 2) << "4000 / 2000";
    EXPECT_EQ(mixed.load(3).depth_m(0, 0), 0);

    all[0] = message(1, "16UC1; compressedDepth rvl", settings + size + words_of({1, 5, 15, 15, 15, 15, 15, 15}));
    const Capture cut = open_capture(recording(all));
    EXPECT_TRUE(says(refusal([&] { (void)cut.load(0); }), "RVL data"));
    for (const auto& [groups, said] :
         {std::pair(words_of({0, 15, 7}), "0 zeros and 63 values at pixel 0 of 6"), // none may go behind the image
          {words_of({15, 7, 0}), "63 zeros and 0 values at pixel 0 of 6"},
          {words_of({0, 0}), "0 zeros and 0 values at pixel 0 of 6"}}) {
        std::string packed_depth = settings;
        packed_depth.append(size).append(groups);
        all[0] = message(1, "16UC1; compressedDepth rvl", packed_depth);
        const Capture wrong = open_capture(recording(all));
        EXPECT_TRUE(says(refusal([&] { (void)wrong.load(0); }), said));
    }
    EXPECT_EQ(cut.load(1).depth_m(1, 2), 2);
}

TEST_P(Ros, rvl_codes_steps_of_either_sign_and_inverse_depth_has_an_offset) {
    // Runs of zeros and of values in turn; a value is its step from the value before, doubled, and -1 less if it falls:
    // in groups of three bits, the lowest first, with a fourth bit where more follow (Wilson 2017).
    std::vector<unsigned> groups;
    const auto number = [&](unsigned value) {
        for (; value > 7; value >>= 3)
            groups.push_back((value & 7) | 8);
        groups.push_back(value);
    };
    for (const unsigned value : {1U, 3U, 2U * 2000, 2U * 1, 2U * 2 - 1, 1U, 1U, 2U * 1699 - 1})
        number(value);
    std::string rvl = raw(3U) + raw(2U);
    for (std::size_t at = 0; at < groups.size(); at += 8) {
        std::uint32_t word = 0;
        for (std::size_t i = at; i < std::min(at + 8, groups.size()); ++i)
            word |= groups[i] << (28 - 4 * (i - at));
        rvl += raw(word);
    }
    std::vector<uchar> encoded;
    ASSERT_TRUE(cv::imencode(".png", cv::Mat1w(2, 3, ushort(2000)), encoded));
    const std::string inverse = raw(0) + raw(4000.0F) + raw(1000.0F); // metres = 4000 / (v - 1000)
    const auto message = [&](double stamp, const std::string& format, const std::string& data) {
        return TestMessage{"/depth/image_raw/compressedDepth", "sensor_msgs/CompressedImage", stamp,
                           fields().header(stamp, "depth_optical").add(format).bytes(data).text()};
    };
    const Capture capture = open_capture(
        recording({message(1, "16UC1; compressedDepth rvl", inverse + rvl),
                   message(2, "32FC1; compressedDepth png", inverse + std::string(encoded.begin(), encoded.end()))}));
    const cv::Mat1f stepped = capture.load(0).depth_m;
    const float expected[] = {0, 2, 2.001F, 1.999F, 0, 0.3F};
    for (int i = 0; i < 6; ++i)
        EXPECT_FLOAT_EQ(stepped(i / 3, i % 3), expected[i]) << i;
    EXPECT_FLOAT_EQ(capture.load(1).depth_m(1, 1), 4);
}

TEST(RosMcap, a_damaged_chunk_loses_its_own_frames_and_no_other) {
    // Three chunks hold a depth image each. In the middle one a pixel is changed: its checksum tells.
    for (const std::string compression : {"", "lz4"}) {
        const tests::TemporaryFolder folder;
        std::vector<TestMessage> all;
        for (const double stamp : {1.0, 2.0, 3.0}) {
            Fields image =
                Fields(true).header(stamp, "x").add(1U).add(2U).add(std::string("16UC1")).add(std::uint8_t(0));
            const std::string pixels = raw(static_cast<std::uint16_t>(1000 * stamp)) + "!?";
            all.push_back({"/depth/image_raw", image_type, stamp, image.add(4U).bytes(pixels).text()});
            for (int i = 0; i < 2; ++i)
                all.push_back({"/other", "std_msgs/String", stamp, Fields(true).add(std::string("x")).text()});
        }
        std::string bytes = mcap(all, compression, {});
        const std::size_t pixel = bytes.find(raw(std::uint16_t(2000)) + "!?");
        ASSERT_NE(pixel, std::string::npos);
        bytes[pixel] = static_cast<char>(bytes[pixel] ^ 1);
        const Capture capture = open_capture(write_file(folder / "a.mcap", bytes));
        ASSERT_EQ(capture.entries.size(), 2U) << compression;
        EXPECT_EQ(capture.load(0).depth_m(0, 0), 1);
        EXPECT_EQ(capture.load(1).depth_m(0, 0), 3);
        EXPECT_TRUE(warned(capture.warnings, "its messages are left out"));
    }
}

TEST_P(Ros, damage_is_refused_or_leaves_what_is_whole) {
    const fs::path file = recording(messages());
    const std::string sound = tests::file_bytes(file);
    std::size_t opened = 0;
    const auto try_it = [&](const std::string& bytes, const std::string& what) {
        write_file(file, bytes);
        try {
            const Capture capture = open_capture(file);
            EXPECT_LE(capture.entries.size(), 3U) << what;
            for (std::size_t i = 0; i < capture.entries.size(); ++i)
                if (const std::string why = refusal([&] { (void)capture.load(i); }); !why.empty()) {
                    EXPECT_TRUE(says(why, "a.recording")) << what;
                }
            ++opened;
        } catch (const Error& failure) {
            EXPECT_TRUE(says(failure.what(), "a.recording")) << what;
        }
    };
    for (std::size_t size = 0; size < sound.size(); size += 1 + sound.size() / 60)
        try_it(sound.substr(0, size), fmt::format("cut at {}", size));
    for (std::size_t at = 0; at < sound.size(); at += 1 + sound.size() / 150)
        for (const char value : {'\xff', '\0', '\x7f'}) {
            std::string damaged = sound;
            damaged[at] = value;
            try_it(damaged, fmt::format("byte {} is {}", at, int(value)));
        }
    EXPECT_GT(opened, 20U);
}

INSTANTIATE_TEST_SUITE_P(in, Ros, testing::ValuesIn(containers),
                         [](const auto& container) { return container.param.name; });

TEST(RosFolder, the_list_of_rosbag2_leads_only_into_its_folder) {
    const tests::TemporaryFolder folder;
    write_file(folder / "a/metadata.yaml", "rosbag2_bagfile_information:\n  relative_file_paths:\n    - ../b.db3\n");
    write_file(folder / "b.db3", "x");
    EXPECT_TRUE(says(refusal([&] { (void)open_capture(folder / "a"); }), "metadata.yaml line 3"));
    write_file(folder / "a/metadata.yaml", "rosbag2_bagfile_information:\n  relative_file_paths:\n    - c.db3.zstd\n");
    write_file(folder / "a/c.db3.zstd", "x");
    EXPECT_TRUE(says(refusal([&] { (void)open_capture(folder / "a"); }), "packed as a whole"));
}

TEST(RosFolder, earlier_bags_are_refused_by_name) {
    const tests::TemporaryFolder folder;
    write_file(folder / "a.bag", "#ROSBAG V1.2\n");
    EXPECT_TRUE(says(refusal([&] { (void)open_capture(folder / "a.bag"); }), "rosbag migrate"));
}

} // namespace
} // namespace scanshade
