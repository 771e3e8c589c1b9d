// Azure Kinect's recordings, made here byte by byte: what is read, and what damage costs.
#include "io/captures/capture.h"
#include "io/captures/recordings/matroska/matroska.h"
#include "tests/support/files.h"
#include "tests/support/small_capture.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

namespace scanshade {
namespace {

using Json = nlohmann::json;
namespace fs = std::filesystem;
using tests::refusal, tests::says, tests::warned, tests::write_file;

// ---------------------------------------------------------------------------------------------------- Matroska

/// The lowest `count` bytes of a number, the highest first.
std::string big(std::uint64_t value, int count) {
    std::string bytes;
    for (int i = count - 1; i >= 0; --i)
        bytes += static_cast<char>(value >> (8 * i));
    return bytes;
}
std::string bytes_of(std::uint32_t id) { return big(id, id > 0xFFFFFF ? 4 : id > 0xFFFF ? 3 : id > 0xFF ? 2 : 1); }
/// Always with 8 bytes of size: an odd way, but allowed.
std::string element(std::uint32_t id, const std::string& content) {
    return bytes_of(id) + big(content.size() | (std::uint64_t{1} << 56), 8) + content;
}
std::string element(std::uint32_t id, std::uint64_t number) { return element(id, big(number, 8)); }
std::string without_size(std::uint32_t id, const std::string& content) { return bytes_of(id) + '\xFF' + content; }

std::string head(const std::string& kind = "matroska") {
    return element(0x1A45DFA3, element(0x4286, 1) + element(0x4282, kind) + element(0x4287, 4) + element(0x4285, 2));
}
std::string segment(const std::string& content) { return element(0x18538067, content); }

std::string bitmap(const std::string& letters) { return std::string(16, '\0') + letters + std::string(20, '\0'); }

std::string track(unsigned number, const std::string& name, cv::Size size, const std::string& letters,
                  const std::string& more = "") {
    return element(0xAE, element(0xD7, number) + element(0x73C5, 1000 + number) + element(0x83, 1) +
                             element(0x536E, name) + element(0x86, "V_MS/VFW/FOURCC") +
                             element(0x63A2, bitmap(letters)) + element(0x23E383, 33'333'333) +
                             element(0xE0, element(0xB0, static_cast<std::uint64_t>(size.width)) +
                                               element(0xBA, static_cast<std::uint64_t>(size.height))) +
                             more);
}
std::string tag(const std::string& name, const std::string& value) {
    return element(0x7373, element(0x63C0, "") + element(0x67C8, element(0x45A3, name) + element(0x4487, value)));
}
std::string attached(const std::string& name, const std::string& data) {
    return element(0x1941A469, element(0x61A7, element(0x466E, name) + element(0x465C, data) + element(0x46AE, 77)));
}
std::string block_content(unsigned track, int time, const std::string& data, unsigned flags = 0x80) {
    return big(0x80 | track, 1) + big(static_cast<std::uint16_t>(time), 2) + big(flags, 1) + data;
}
std::string block(unsigned track, int time, const std::string& data, unsigned flags = 0x80) {
    return element(0xA3, block_content(track, time, data, flags));
}
std::string grouped(unsigned track, int time, const std::string& data) {
    return element(0xA0, element(0x9B, 33) + element(0xA1, block_content(track, time, data, 0)));
}
std::string cluster(std::uint64_t time, const std::string& blocks) {
    return element(0x1F43B675, element(0xE7, time) + blocks);
}

// ---------------------------------------------------------------------------------------------------- recordings

const cv::Size narrow{320, 288}, hd{1280, 720}, small{8, 6};

/// Big-endian: `first` at pixel (0, 0), a hole at (1, 0), 2 m elsewhere.
std::string depth(cv::Size size, unsigned first) {
    std::string bytes = big(first, 2) + big(0, 2);
    while (bytes.size() < static_cast<std::size_t>(size.area()) * 2)
        bytes += big(2000, 2);
    return bytes;
}
std::string jpeg(cv::Size size, const cv::Vec3b& bgr) {
    std::vector<uchar> bytes;
    cv::imencode(".jpg", cv::Mat3b(size, bgr), bytes);
    return {bytes.begin(), bytes.end()};
}

Json camera(const std::string& purpose, const std::vector<double>& parameters, cv::Size sensor,
            const std::vector<double>& rotation, const std::vector<double>& translation) {
    return {{"Purpose", "CALIBRATION_CameraPurpose" + purpose},
            {"SensorWidth", sensor.width},
            {"SensorHeight", sensor.height},
            {"MetricRadius", 1.74},
            {"Rt", {{"Rotation", rotation}, {"Translation", translation}}},
            {"Intrinsics",
             {{"ModelType", "CALIBRATION_LensDistortionModelBrownConrady"}, {"ModelParameters", parameters}}}};
}
const std::vector<double> depth_parameters{0.5,  0.49, 0.49,  0.5, 0.43, 0.02,  0.001,
                                           0.77, 0.12, 0.006, 0,   0,    -5e-5, -9e-5},
    colour_parameters{0.5, 0.499, 0.474, 0.632, 0.51, -2.66, 1.52, 0.39, -2.48, 1.45, 0, 0, -2e-4, 7e-4},
    turn{1, 0, 0, 0, 0, -1, 0, 1, 0};

/// Depth's own place is not the identity here, so that a mixed-up direction shows.
Json calibration() {
    return {{"CalibrationInformation",
             {{"Cameras",
               {camera("Depth", depth_parameters, {1024, 1024}, {1, 0, 0, 0, 1, 0, 0, 0, 1}, {0, 0, 0.5}),
                camera("PhotoVideo", colour_parameters, {4096, 3072}, turn, {-0.03, 0, 0})}}}}};
}

class AzureKinect : public testing::Test {
  protected:
    [[nodiscard]] fs::path file(const std::string& content) const {
        return write_file(folder / "output.mkv", head() + content);
    }
    [[nodiscard]] Capture opened(const std::string& content) const { return open_capture(file(content)); }

    static std::string tracks(const std::string& all) { return element(0x1654AE6B, all); }
    static std::string tags(const std::string& mode = "NFOV_2X2BINNED", const std::string& more = "") {
        return element(0x1254C367, tag("K4A_DEPTH_MODE", mode) + more);
    }
    /// Tracks, calibration and tags of a usual recording.
    static std::string start(const std::string& more_tags = "") {
        return tracks(track(1, "COLOR", hd, "MJPG") + track(2, "DEPTH", narrow, "b16g")) +
               attached("calibration.json", calibration().dump() + std::string(1, '\0')) +
               tags("NFOV_2X2BINNED", more_tags);
    }
    /// Of 8x6 pixels, which no mode has: small enough to cut everywhere. The first pixel is 1000 and up.
    static std::string small_start() { return tracks(track(2, "DEPTH", small, "b16g")) + tags(); }
    static std::string small_cluster(unsigned i) {
        return cluster(100 * i, block(2, 0, depth(small, 1000 + i)) + grouped(2, 50, depth(small, 2000 + i)));
    }
    tests::TemporaryFolder folder;
};

TEST_F(AzureKinect, depth_both_cameras_and_times_are_found) {
    const Capture capture = opened(
        segment(start(tag("K4A_START_OFFSET_NS", "5000000000") + tag("K4A_CALIBRATION_FILE", "calibration.json")) +
                cluster(100, block(1, 0, jpeg(hd, {9, 99, 199})) + block(2, 0, depth(narrow, 1234))) +
                cluster(133, block(2, 1, depth(narrow, 4321)))));
    EXPECT_EQ(capture.kind, "Azure Kinect");
    ASSERT_EQ(capture.entries.size(), 2U);
    EXPECT_TRUE(capture.warnings.empty()) << tests::joined(capture.warnings);
    const Frame frame = capture.load(0);
    EXPECT_EQ(frame.depth_m.size(), narrow);
    EXPECT_FLOAT_EQ(frame.depth_m(0, 0), 1.234F);
    EXPECT_EQ(frame.depth_m(0, 1), 0);
    EXPECT_EQ(frame.depth_m(287, 319), 2);
    EXPECT_NEAR(*capture.entries[0].stamp_s, 5.1, 1e-9) << "the device's clock";
    EXPECT_NEAR(*capture.entries[1].stamp_s, 5.134, 1e-9);
    const Pinhole& k = frame.camera.pinhole;
    EXPECT_EQ(k.size, narrow);
    EXPECT_NEAR(k.fx, 0.49 * 512, 1e-12);
    EXPECT_NEAR(k.fy, 0.5 * 512, 1e-12);
    EXPECT_NEAR(k.cx, 0.5 * 512 - 96 - 0.5, 1e-12);
    EXPECT_NEAR(k.cy, 0.49 * 512 - 90 - 0.5, 1e-12);
    EXPECT_EQ(frame.camera.distortion, (Distortion{0.43, 0.02, -9e-5, -5e-5, 0.001, 0.77, 0.12, 0.006}));
    EXPECT_EQ(frame.registration, Registration::no);
    ASSERT_TRUE(frame.colour_camera);
    const Pinhole& c = frame.colour_camera->camera.pinhole;
    EXPECT_EQ(c.size, hd);
    EXPECT_NEAR(c.fy, 0.632 * 960, 1e-12);
    EXPECT_NEAR(c.cy, 0.499 * 960 - 120 - 0.5, 1e-12);
    EXPECT_EQ(frame.colour_camera->camera.distortion.k6, 1.45);
    // Depth's camera is 0.5 m before the common origin; the turn takes that z to -y of the colour camera.
    const Eigen::Vector3d seen = frame.colour_camera->colour_from_depth * Eigen::Vector3d(1, 2, 3.5);
    EXPECT_LT((seen - Eigen::Vector3d(0.97, -3, 2)).norm(), 1e-12) << seen.transpose();
    EXPECT_EQ(frame.colour.size(), hd);
    EXPECT_LE(cv::norm(frame.colour(5, 5) - cv::Vec3b(9, 99, 199)), 4);
    EXPECT_TRUE(capture.load(1).colour.empty());
    EXPECT_TRUE(warned(capture.load(1).warnings, "no colour image of the same time"));
}

TEST_F(AzureKinect, infrared_is_never_depth) {
    for (const bool last : {false, true}) {
        const std::string infrared = track(3, "IR", narrow, "b16g"), depths = track(2, "DEPTH", narrow, "b16g");
        const std::string both = last ? depths + infrared : infrared + depths;
        const Capture capture = opened(segment(
            tracks(both) + tags() + cluster(0, block(3, 0, depth(narrow, 77)) + block(2, 0, depth(narrow, 1234)))));
        ASSERT_EQ(capture.entries.size(), 1U);
        EXPECT_FLOAT_EQ(capture.load(0).depth_m(0, 0), 1.234F);
    }
    EXPECT_TRUE(says(refusal([&] {
                         (void)opened(segment(tracks(track(3, "IR", {1024, 1024}, "b16g")) + tags("PASSIVE_IR")));
                     }),
                     "PASSIVE_IR: infrared without depth"));
    EXPECT_TRUE(
        says(refusal([&] { (void)opened(segment(tracks(track(3, "IR", narrow, "b16g")) + tags())); }), "\"IR\""));
}

TEST_F(AzureKinect, the_tag_names_the_depth_track_whatever_its_name) {
    const Capture capture = opened(segment(tracks(track(2, "Tiefe", small, "b16g") + track(3, "IR", small, "b16g")) +
                                           tags("NFOV_2X2BINNED", tag("K4A_DEPTH_TRACK", "1002")) +
                                           cluster(0, block(2, 0, depth(small, 1000)))));
    EXPECT_EQ(capture.load(0).depth_m(0, 0), 1);
}

TEST_F(AzureKinect, ordinary_videos_are_refused_by_name) {
    const fs::path video = file(segment(tracks(track(1, "film", hd, "H264")) + cluster(0, block(1, 0, "x"))));
    EXPECT_THROW((void)open_capture(video), NoFrames);
    EXPECT_TRUE(says(refusal([&] { (void)open_capture(video); }), "a video (\"film\" (V_MS/VFW/FOURCC))"));
    EXPECT_TRUE(says(refusal([&] { (void)open_capture(write_file(folder / "a.webm", head("other"))); }), "\"other\""));
    EXPECT_TRUE(says(refusal([&] { (void)open_capture(write_file(folder / "a.mkv", head())); }), "no Segment"));
    const std::string packed = element(0x6D80, element(0x6240, ""));
    EXPECT_TRUE(says(refusal([&] {
                         (void)opened(segment(tracks(track(2, "DEPTH", narrow, "b16g", packed)) + tags() +
                                              cluster(0, block(2, 0, depth(narrow, 1)))));
                     }),
                     "mkvmerge"));
    EXPECT_TRUE(says(refusal([&] {
                         (void)opened(segment(tracks(track(2, "DEPTH", narrow, "FFV1")) + tags() +
                                              cluster(0, block(2, 0, depth(narrow, 1)))));
                     }),
                     "\"FFV1\", expected V_MS/VFW/FOURCC with b16g"));
}

TEST_F(AzureKinect, early_recordings_call_their_depth_yuy2) {
    const Capture capture = opened(
        segment(tracks(track(2, "DEPTH", small, "YUY2")) + tags() +
                cluster(0, block(2, 0, std::string(6 * 8, '\0') + std::string(24, '\x01') + std::string(24, '\2')))));
    EXPECT_NEAR(capture.load(0).depth_m(5, 7), 0.514, 1e-6);
}

TEST_F(AzureKinect, every_mode_has_its_part_of_the_sensor) {
    struct Row {
        const char* mode;
        cv::Size size;
        double fx, cx, cy;
    };
    for (const Row& row : {Row{"NFOV_UNBINNED", {640, 576}, 0.49 * 1024, 512 - 192.5, 0.49 * 1024 - 180.5},
                           Row{"WFOV_2x2BINNED", {512, 512}, 0.49 * 512, 256 - 0.5, 0.49 * 512 - 0.5},
                           Row{"WFOV_UNBINNED", {1024, 1024}, 0.49 * 1024, 512 - 0.5, 0.49 * 1024 - 0.5}}) {
        const Capture capture = opened(segment(tracks(track(2, "DEPTH", row.size, "b16g")) +
                                               attached("calibration.json", calibration().dump()) + tags(row.mode) +
                                               cluster(0, block(2, 0, depth(row.size, 1)))));
        EXPECT_TRUE(capture.warnings.empty()) << row.mode << tests::joined(capture.warnings);
        ASSERT_TRUE(capture.camera) << row.mode;
        EXPECT_NEAR(capture.camera->pinhole.fx, row.fx, 1e-9) << row.mode;
        EXPECT_NEAR(capture.camera->pinhole.cx, row.cx, 1e-9) << row.mode;
        EXPECT_NEAR(capture.camera->pinhole.cy, row.cy, 1e-9) << row.mode;
    }
    for (const cv::Size size : {cv::Size(1920, 1080), {2560, 1440}, {2048, 1536}, {3840, 2160}, {4096, 3072}}) {
        const Capture capture =
            opened(segment(tracks(track(1, "COLOR", size, "MJPG") + track(2, "DEPTH", narrow, "b16g")) +
                           attached("calibration.json", calibration().dump()) + tags() +
                           cluster(0, block(1, 0, "x") + block(2, 0, depth(narrow, 1)))));
        ASSERT_TRUE(capture.colour_camera) << size;
        const Pinhole& k = capture.colour_camera->camera.pinhole;
        const double rows = size.width * 0.75;
        EXPECT_NEAR(k.fx, 0.474 * size.width, 1e-9) << size;
        EXPECT_NEAR(k.cx, 0.5 * size.width - 0.5, 1e-9) << size;
        EXPECT_NEAR(k.fy, 0.632 * rows, 1e-9) << size;
        EXPECT_NEAR(k.cy, 0.499 * rows - (rows - size.height) / 2 - 0.5, 1e-9) << size;
    }
}

TEST_F(AzureKinect, calibrations_for_the_middle_of_the_sensor_mean_the_same_camera) {
    Json early = calibration();
    Json& colour = early["CalibrationInformation"]["Cameras"][1];
    colour["SensorHeight"] = 2304;
    auto parameters = colour_parameters;
    parameters[1] = (0.499 * 3072 - 384) / 2304;
    parameters[3] = 0.632 * 3072 / 2304;
    colour["Intrinsics"]["ModelParameters"] = parameters;
    const std::string content = tracks(track(1, "COLOR", hd, "MJPG") + track(2, "DEPTH", narrow, "b16g")) + tags() +
                                cluster(0, block(1, 0, "x") + block(2, 0, depth(narrow, 1)));
    const Capture capture = opened(segment(attached("calibration.json", early.dump()) + content));
    ASSERT_TRUE(capture.colour_camera);
    EXPECT_NEAR(capture.colour_camera->camera.pinhole.fy, 0.632 * 960, 1e-9);
    EXPECT_NEAR(capture.colour_camera->camera.pinhole.cy, 0.499 * 960 - 120.5, 1e-9);
}

TEST_F(AzureKinect, colour_of_the_same_instant_belongs_to_depth_whatever_the_delay) {
    // Depth is taken 40 ms after colour: the images of 0 and 33 ms belong to depths of 40 and 73 ms; one comes late.
    std::string blocks;
    for (const int time : {0, 33, 66})
        blocks += block(1, time, jpeg(hd, cv::Vec3b(static_cast<uchar>(time), 0, 0)));
    for (const int time : {40, 73, 300})
        blocks += block(2, time, depth(narrow, 1000));
    const Capture capture = opened(segment(start(tag("K4A_DEPTH_DELAY_NS", "40000000")) + cluster(0, blocks)));
    ASSERT_EQ(capture.entries.size(), 3U);
    EXPECT_NEAR(*capture.entries[0].colour_stamp_s, 0, 1e-9);
    EXPECT_NEAR(*capture.entries[1].colour_stamp_s, 0.033, 1e-9);
    EXPECT_FALSE(capture.entries[2].colour_stamp_s);
    const Capture early = opened(segment(start(tag("K4A_DEPTH_DELAY_NS", "-26000000")) + cluster(0, blocks)));
    EXPECT_NEAR(*early.entries[0].colour_stamp_s, 0.066, 1e-9);
    EXPECT_FALSE(early.entries[1].colour_stamp_s) << "each image is used once";
    const Capture odd = opened(segment(start(tag("K4A_DEPTH_DELAY_NS", "soon")) + cluster(0, blocks)));
    EXPECT_TRUE(warned(odd.warnings, "K4A_DEPTH_DELAY_NS is \"soon\""));
}

TEST_F(AzureKinect, colour_may_be_plain_pixels) {
    const cv::Mat3b shown(hd, {30, 120, 210});
    cv::Mat bgra, planes;
    cv::cvtColor(shown, bgra, cv::COLOR_BGR2BGRA);
    cv::cvtColor(shown, planes, cv::COLOR_BGR2YUV_I420);
    const uchar y = planes.at<uchar>(0, 0), u = planes.at<uchar>(720, 0), v = planes.at<uchar>(720 + 180, 0);
    std::string nv12(static_cast<std::size_t>(hd.area()), static_cast<char>(y)), yuy2;
    for (int i = 0; i < hd.area() / 4; ++i)
        nv12 += {static_cast<char>(u), static_cast<char>(v)};
    for (int i = 0; i < hd.area() / 2; ++i)
        yuy2 += {static_cast<char>(y), static_cast<char>(u), static_cast<char>(y), static_cast<char>(v)};
    const std::string plain(reinterpret_cast<const char*>(bgra.data), bgra.total() * 4);
    for (const auto& [letters, bytes] : {std::pair{"BGRA", plain}, {"NV12", nv12}, {"YUY2", yuy2}}) {
        const Capture capture =
            opened(segment(tracks(track(1, "COLOR", hd, letters) + track(2, "DEPTH", narrow, "b16g")) +
                           attached("calibration.json", calibration().dump()) + tags() +
                           cluster(0, block(1, 0, bytes) + block(2, 0, depth(narrow, 1))) +
                           cluster(33, block(1, 0, "short") + block(2, 0, depth(narrow, 1)))));
        const Frame frame = capture.load(0);
        ASSERT_EQ(frame.colour.size(), hd) << letters;
        EXPECT_LE(cv::norm(frame.colour(719, 1279) - cv::Vec3b(30, 120, 210)), 6) << letters;
        const Frame second = capture.load(1);
        EXPECT_TRUE(second.colour.empty());
        EXPECT_TRUE(warned(second.warnings, "5 bytes of colour"));
    }
    const Capture unknown = opened(segment(tracks(track(1, "COLOR", hd, "H264") + track(2, "DEPTH", narrow, "b16g")) +
                                           tags() + cluster(0, block(2, 0, depth(narrow, 1)))));
    EXPECT_TRUE(warned(unknown.warnings, "\"H264\", expected MJPG, NV12, YUY2 or BGRA"));
}

TEST_F(AzureKinect, without_a_usable_calibration_depth_is_still_read) {
    const auto with = [&](const Json& json) {
        return opened(segment(tracks(track(1, "COLOR", hd, "MJPG") + track(2, "DEPTH", narrow, "b16g")) + tags() +
                              attached("calibration.json", json.is_string() ? json.get<std::string>() : json.dump()) +
                              cluster(0, block(2, 0, depth(narrow, 1500)))));
    };
    const auto changed = [](const char* pointer, const Json& value) {
        Json json = calibration();
        json[Json::json_pointer(std::string("/CalibrationInformation/Cameras/") + pointer)] = value;
        return json;
    };
    struct Row {
        Json json;
        const char* says;
        bool camera = false;
    };
    const std::string model = "CALIBRATION_LensDistortionModelRational6KT";
    auto moved = depth_parameters;
    moved[10] = 0.1;
    for (const Row& row :
         {Row{Json("{"), "calibration.json line 1"}, Row{Json::object(), "\"CalibrationInformation\" is missing"},
          Row{changed("0/Purpose", "other"), "no camera with the \"Purpose\" ...Depth"},
          Row{changed("0/Intrinsics/ModelType", model), "Rational6KT"},
          Row{changed("0/Intrinsics/ModelParameters", {1, 2}), "\"ModelParameters\" is not a list of 14 numbers"},
          Row{changed("0/Intrinsics/ModelParameters", moved), "centre of distortion"},
          Row{changed("0/SensorWidth", 640), "640x1024"},
          Row{changed("1/SensorWidth", 999), "no camera for colour: a colour sensor of 999x3072", true},
          Row{changed("1/Rt/Rotation", {1, 1, 1, 1, 1, 1, 1, 1, 1}), "no camera for colour: \"Rt\"", true},
          Row{changed("1/Rt", "none"), "no camera for colour: \"Rotation\"", true}}) {
        const Capture capture = with(row.json);
        EXPECT_TRUE(warned(capture.warnings, row.says));
        EXPECT_EQ(capture.camera.has_value(), row.camera) << row.says;
        EXPECT_FLOAT_EQ(capture.load(0).depth_m(0, 0), 1.5F);
    }
    const Capture none = opened(segment(small_start() + small_cluster(0)));
    EXPECT_TRUE(warned(none.warnings, "depth of 8x6 pixels in the mode \"NFOV_2X2BINNED\""));
    EXPECT_TRUE(warned(none.warnings, "which no mode has"));
}

// ---------------------------------------------------------------------------------------------------- the container

TEST_F(AzureKinect, clusters_may_be_of_unknown_size_and_blocks_in_groups) {
    std::string all = small_start();
    for (unsigned i = 0; i < 3; ++i)
        all += without_size(0x1F43B675, element(0xE7, 100 * i) + block(2, 0, depth(small, 1000 + i)) +
                                            grouped(2, 50, depth(small, 2000 + i)));
    const std::string late = element(0x1C53BB6B, "cues") + element(0xEC, std::string(9, '\0'));
    const Capture capture = opened(without_size(0x18538067, all + late));
    ASSERT_EQ(capture.entries.size(), 6U);
    for (std::size_t i = 0; i < 6; ++i) {
        EXPECT_FLOAT_EQ(capture.load(i).depth_m(0, 0),
                        static_cast<float>(i % 2 + 1) + 0.001F * static_cast<float>(i / 2));
        EXPECT_NEAR(*capture.entries[i].stamp_s, 0.05 * static_cast<double>(i), 1e-9);
    }
    EXPECT_FALSE(warned(capture.warnings, "byte"));
}

TEST_F(AzureKinect, descriptions_may_follow_the_clusters_and_time_has_a_scale) {
    const Capture capture =
        opened(segment(small_cluster(1) + element(0x1549A966, element(0x2AD7B1, 100'000)) + small_start()));
    ASSERT_EQ(capture.entries.size(), 2U);
    EXPECT_NEAR(*capture.entries[0].stamp_s, 0.01, 1e-12);
}

TEST_F(AzureKinect, several_frames_in_one_block_are_refused_but_for_other_tracks) {
    const std::string imu = element(0xAE, element(0xD7, 4) + element(0x83, 17) + element(0x536E, "IMU"));
    const Capture capture = opened(segment(tracks(imu + track(2, "DEPTH", small, "b16g")) + tags() +
                                           cluster(0, block(4, 0, "laced", 0x86) + block(2, 0, depth(small, 1000)) +
                                                          block(2, 50, depth(small, 1000), 0x86))));
    ASSERT_EQ(capture.entries.size(), 2U);
    EXPECT_EQ(capture.load(0).depth_m(0, 0), 1);
    EXPECT_TRUE(says(refusal([&] { (void)capture.load(1); }), "lacing"));
}

TEST_F(AzureKinect, a_cut_recording_keeps_what_was_whole) {
    std::string whole = small_start();
    const std::size_t clusters_at = head().size() + 12 + whole.size();
    for (unsigned i = 0; i < 3; ++i)
        whole += small_cluster(i);
    for (const bool sized : {true, false}) {
        const std::string all = head() + (sized ? segment(whole) : without_size(0x18538067, whole));
        std::size_t last = 0;
        for (std::size_t end = 0; end < all.size(); end += 7) {
            const fs::path cut = write_file(folder / "cut.mkv", all.substr(0, end));
            try {
                const Capture capture = open_capture(cut);
                EXPECT_GE(capture.entries.size(), last) << end;
                last = capture.entries.size();
                EXPECT_FLOAT_EQ(capture.load(last - 1).depth_m(0, 0),
                                static_cast<float>((last - 1) % 2 + 1) + 0.001F * static_cast<float>((last - 1) / 2));
                EXPECT_GT(end, clusters_at);
            } catch (const Error& failure) {
                EXPECT_EQ(last, 0U) << end << failure.what();
            }
        }
        EXPECT_EQ(last, 5U) << "all but the one that was cut";
    }
    const Capture capture =
        open_capture(write_file(folder / "cut.mkv", (head() + segment(whole)).substr(0, clusters_at + 400)));
    EXPECT_TRUE(warned(capture.warnings, "cut.mkv: the file ends at byte"));
}

TEST_F(AzureKinect, damage_costs_its_cluster_alone) {
    std::string all = head() + segment(small_start() + small_cluster(0) + small_cluster(1) + small_cluster(2));
    const std::size_t second = all.rfind("\x1F\x43\xB6\x75", all.rfind("\x1F\x43\xB6\x75") - 1);
    const auto spoilt = [&](std::size_t at, const std::string& bytes) {
        return open_capture(write_file(folder / "spoilt.mkv", std::string(all).replace(at, bytes.size(), bytes)));
    };
    // Its name, its size (too large, beyond the file, too small), its first child's name.
    for (const auto& [at, bytes] : {std::pair<std::size_t, std::string>{second, "\x1F\x43\xB6\x76"},
                                    {second + 10, "\x05"},
                                    {second + 5, "\x05"},
                                    {second + 11, std::string(1, '\x20')},
                                    {second + 12, std::string(1, '\0')}}) {
        SCOPED_TRACE(at - second);
        const Capture capture = spoilt(at, bytes);
        EXPECT_TRUE(warned(capture.warnings, "spoilt.mkv byte"));
        ASSERT_GE(capture.entries.size(), 4U);
        EXPECT_FLOAT_EQ(capture.load(0).depth_m(0, 0), 1);
        EXPECT_FLOAT_EQ(capture.load(capture.entries.size() - 1).depth_m(0, 0), 2.002F);
    }
    // A block that ends beyond its cluster: the one before it stays.
    const std::size_t group = all.find("\xA0", second);
    const Capture capture = spoilt(group + 6, "\x77");
    ASSERT_EQ(capture.entries.size(), 5U);
    EXPECT_FLOAT_EQ(capture.load(2).depth_m(0, 0), 1.001F);
}

TEST_F(AzureKinect, hostile_numbers_are_refused_or_skipped) {
    // A cluster without a time, one with an impossible one, and blocks too short for their head.
    const Capture capture = opened(segment(small_start() + element(0x1F43B675, block(2, 0, depth(small, 7))) +
                                           cluster(std::uint64_t{1} << 63, block(2, 0, depth(small, 7))) +
                                           cluster(std::uint64_t{1} << 61, block(2, 0, depth(small, 7))) +
                                           cluster(0, element(0xA3, "\x82")) + small_cluster(1)));
    EXPECT_EQ(capture.entries.size(), 2U);
    EXPECT_TRUE(warned(capture.warnings, "a cluster without a time; its 1 block"));
    EXPECT_TRUE(warned(capture.warnings, "1 block with impossible times"));
    EXPECT_TRUE(
        says(refusal([&] {
                 (void)opened(segment(tracks(track(2, "DEPTH", {1 << 30, 6}, "b16g")) + tags() + small_cluster(0)));
             }),
             "depth: a size of 1073741824x6"));
    EXPECT_TRUE(says(refusal([&] { (void)opened(segment(tracks(track(2, "DEPTH", small, "b16g")) + tags())); }),
                     "no whole depth image"));
    // Numbers and texts that are too long spoil their description, and say so.
    const Capture numbers = opened(
        segment(small_start() + element(0x1549A966, element(0x2AD7B1, std::string(9, '\1'))) + small_cluster(0)));
    EXPECT_TRUE(warned(numbers.warnings, "a number of 9 bytes"));
    const std::string wide = element(0x1A45DFA3, element(0x42F3, 9));
    EXPECT_TRUE(says(refusal([&] { (void)open_capture(write_file(folder / "wide.mkv", wide)); }), "sizes of up to 9"));
    EXPECT_TRUE(says(refusal([&] {
                         std::string many;
                         for (int i = 0; i < 5000; ++i)
                             many += element(0xAE, element(0xD7, 9));
                         (void)opened(segment(tracks(many) + small_start()));
                     }),
                     "more than 4096 tracks"));
}

} // namespace
} // namespace scanshade
