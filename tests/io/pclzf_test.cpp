// PCL's images and recordings: what PCL itself writes is read as PCL reads it, and what is damaged is refused.
#include "io/cameras/camera_file.h"
#include "io/captures/capture.h"
#include "io/images/image_file.h"
#include "tests/support/data.h"
#include "tests/support/files.h"

#include <cstdlib>
#include <cstring>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <pcl/io/lzf_image_io.h>
#include <pcl/point_types.h>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using tests::file_bytes;
using tests::refusal;
using tests::says;
using tests::TemporaryFolder;
using tests::warned;
using tests::write_file;

template <class Writer>
fs::path write_with_pcl(const fs::path& file, const cv::Mat& samples, cv::Size size) {
    EXPECT_TRUE(Writer().write(reinterpret_cast<const char*>(samples.data), static_cast<unsigned>(size.width),
                               static_cast<unsigned>(size.height), file.string()));
    return file;
}

template <class Reader>
cv::Mat3b read_with_pcl(const fs::path& file) {
    pcl::PointCloud<pcl::PointXYZRGB> cloud;
    EXPECT_TRUE(Reader().read(file.string(), cloud));
    cv::Mat3b image(static_cast<int>(cloud.height), static_cast<int>(cloud.width));
    std::transform(cloud.begin(), cloud.end(), image.begin(),
                   [](const pcl::PointXYZRGB& point) { return cv::Vec3b(point.b, point.g, point.r); });
    return image;
}

/// Every third value repeats, so that both literal runs and copies come about.
template <class Pixel>
cv::Mat_<Pixel> noise(cv::Size size) {
    cv::Mat_<Pixel> image(size);
    cv::theRNG().state = 7;
    cv::randu(image, cv::Scalar::all(0), cv::Scalar::all(sizeof(Pixel) == 2 ? 65536 : 256));
    image(cv::Rect(0, 0, size.width, size.height / 3)).setTo(cv::Scalar::all(17));
    return image;
}

constexpr int width = 38, height = 24;
const cv::Size small(width, height);

fs::path write_depth(const fs::path& file) {
    return write_with_pcl<pcl::io::LZFDepth16ImageWriter>(file, noise<ushort>(small), small);
}
fs::path write_rgb(const fs::path& file) {
    cv::Mat3b rgb;
    cv::cvtColor(noise<cv::Vec3b>(small), rgb, cv::COLOR_BGR2RGB);
    return write_with_pcl<pcl::io::LZFRGB24ImageWriter>(file, rgb, small);
}

double worst_difference(const cv::Mat& a, const cv::Mat& b) { return cv::norm(a, b, cv::NORM_INF); }

// --- images ---

TEST(pclzf, depth_and_rgb_come_back_bit_by_bit) {
    const TemporaryFolder folder;
    EXPECT_EQ(worst_difference(read_stored_depth(write_depth(folder / "d.any")), noise<ushort>(small)), 0);
    EXPECT_EQ(worst_difference(read_colour(write_rgb(folder / "c.any")), noise<cv::Vec3b>(small)), 0);
}

TEST(pclzf, yuv422_has_the_colours_that_pcl_gives_it) {
    const TemporaryFolder folder;
    const fs::path file =
        write_with_pcl<pcl::io::LZFYUV422ImageWriter>(folder / "c.pclzf", noise<cv::Vec2b>(small), small);
    EXPECT_LE(worst_difference(read_colour(file), read_with_pcl<pcl::io::LZFYUV422ImageReader>(file)), 1); // rounding
}

TEST(pclzf, bayer8_has_the_mosaic_that_pcl_takes_it_for) {
    const TemporaryFolder folder;
    const cv::Vec3b colour(30, 90, 200);
    cv::Mat1b mosaic(small, colour[1]);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
            if (x % 2 != y % 2)
                mosaic(y, x) = y % 2 == 0 ? colour[2] : colour[0];
    const fs::path file = write_with_pcl<pcl::io::LZFBayer8ImageWriter>(folder / "c.pclzf", mosaic, small);
    const cv::Rect inside(2, 2, width - 4, height - 4); // at the border PCL has its own ways
    const cv::Mat3b expected(inside.size(), colour);
    EXPECT_EQ(worst_difference(read_colour(file)(inside), expected), 0);
    EXPECT_EQ(worst_difference(read_with_pcl<pcl::io::LZFBayer8ImageReader>(file)(inside), expected), 0);
}

class DamagedPclzf : public ::testing::Test {
  protected:
    std::string refused(const std::string& bytes) {
        const fs::path file = write_file(folder_ / "d.pclzf", bytes);
        const std::string message = refusal([&] { (void)read_stored_depth(file); });
        EXPECT_TRUE(message.empty() || says(message, file.string()));
        return message;
    }
    /// The sound file with a number at that place of the header.
    std::string with(std::size_t at, std::uint32_t number) {
        std::string bytes = sound_;
        std::memcpy(bytes.data() + at, &number, sizeof number);
        return refused(bytes);
    }
    const TemporaryFolder folder_;
    const std::string sound_ = file_bytes(write_depth(folder_ / "sound"));
};

TEST_F(DamagedPclzf, is_refused_wherever_it_is_cut) {
    ASSERT_EQ(refused(sound_), "");
    for (std::size_t length = 0; length < sound_.size(); ++length)
        EXPECT_NE(refused(sound_.substr(0, length)), "") << length;
    EXPECT_TRUE(says(refused(""), "empty file"));
    EXPECT_TRUE(says(refused(sound_.substr(0, 36)), "36 bytes, expected a header of 37"));
    EXPECT_TRUE(says(refused(sound_.substr(0, sound_.size() - 1)), "packed data expected, found"));
    EXPECT_TRUE(says(refused(sound_ + "x"), "packed data expected, found"));
}

TEST_F(DamagedPclzf, is_refused_if_its_header_is_wrong) {
    for (std::size_t at = 0; at < 37; ++at) {
        std::string changed = sound_;
        changed[at] = static_cast<char>(changed[at] ^ 0x10);
        EXPECT_NE(refused(changed), "") << at;
    }
    EXPECT_TRUE(says(with(5, 0), "0x24"));
    EXPECT_TRUE(says(with(5, 0xffffffff), "2^28"));
    EXPECT_TRUE(says(with(9, 1 << 23), "2^28"));
    EXPECT_TRUE(says(with(9, 25), "38x25 pixels of depth16 are 1900 bytes, but the header says that 1824 are packed"));
    std::string foreign = sound_;
    foreign.replace(13, 16, "depth32         ");
    EXPECT_TRUE(says(refused(foreign), "expected depth16, rgb24, yuv422 or bayer8"));
    foreign.replace(13, 16, std::string("\x1b\x80", 2) + std::string(14, '\n'));
    EXPECT_TRUE(says(refused(foreign), "expected depth16"));
}

TEST_F(DamagedPclzf, asks_for_no_more_memory_than_its_bytes_can_fill) {
    const std::uint32_t numbers[] = {16000, 16000}, sizes[] = {0, 16000 * 16000 * 2};
    std::string bytes = sound_.substr(0, 37);
    std::memcpy(bytes.data() + 5, numbers, 8);
    std::memcpy(bytes.data() + 29, sizes, 8);
    EXPECT_TRUE(says(refused(bytes), "cannot become 16000x16000 pixels"));
    const std::uint32_t one[] = {1, 1}, nothing[] = {0, 2}; // so small that any number of bytes might be enough
    std::memcpy(bytes.data() + 5, one, 8);
    std::memcpy(bytes.data() + 29, nothing, 8);
    EXPECT_TRUE(says(refused(bytes), "do not become 2 bytes"));
}

TEST_F(DamagedPclzf, never_crashes_a_reader) {
    cv::RNG random(5);
    const fs::path file = folder_ / "any";
    for (const fs::path& sound : {write_depth(folder_ / "d"), write_rgb(folder_ / "c")})
        for (int i = 0; i < 300; ++i) {
            std::string changed = file_bytes(sound);
            for (int k = 0; k < 3; ++k) // LZF has no checksum: what comes out may be wrong, but is of the right size
                changed[static_cast<std::size_t>(random.uniform(37, static_cast<int>(changed.size())))] =
                    static_cast<char>(random.next());
            write_file(file, changed);
            const std::string said = refusal([&] { EXPECT_EQ(read_stored_depth(file).size(), small); });
            EXPECT_TRUE(said.empty() || says(said, file.string()));
            (void)refusal([&] { EXPECT_EQ(read_colour(file).size(), small); });
        }
}

TEST(pclzf, depth_is_no_colour_and_colour_no_depth) {
    const TemporaryFolder folder;
    EXPECT_TRUE(says(refusal([&] { (void)read_colour(write_depth(folder / "d.pclzf")); }), "expected a colour image"));
    EXPECT_TRUE(says(refusal([&] { (void)read_stored_depth(write_rgb(folder / "c.pclzf")); }), "3 channels"));
}

// --- recordings ---

const std::string first = "frame_20121214T235959.900000", second = "frame_20121215T000000";

void write_shot(const fs::path& folder, const std::string& name, double rgb_focal_length = 60) {
    write_depth(folder / (name + "_depth.pclzf"));
    write_rgb(folder / (name + "_rgb.pclzf"));
    const std::string xml = (folder / (name + ".xml")).string();
    EXPECT_TRUE(pcl::io::LZFRGB24ImageWriter().writeParameters({rgb_focal_length, 61, 18.5, 11.5}, xml));
    EXPECT_TRUE(pcl::io::LZFDepth16ImageWriter().writeParameters({60, 61, 18.5, 11.5}, xml));
}

TEST(pcl_recordings, are_captures_of_colour_depth_camera_unit_and_time) {
    const TemporaryFolder folder;
    write_shot(folder.path(), second);
    write_shot(folder.path(), first);
    const Capture capture = open_capture(folder.path());
    EXPECT_EQ(capture.kind, "PCL recording");
    EXPECT_EQ(capture.registration, Registration::unknown);
    EXPECT_TRUE(capture.warnings.empty()) << tests::joined(capture.warnings);
    EXPECT_EQ(capture.depth.units_per_metre, 1000);
    EXPECT_EQ(capture.depth.origin, (folder / (first + ".xml")).string());
    const Pinhole& pinhole = capture.camera->pinhole;
    EXPECT_EQ(std::tuple(pinhole.fx, pinhole.fy, pinhole.cx, pinhole.cy), std::tuple(60, 61, 18.5, 11.5));
    EXPECT_EQ(pinhole.size, small);
    ASSERT_EQ(capture.entries.size(), 2);
    EXPECT_EQ(capture.entries[0].name, first);
    EXPECT_EQ(capture.entries[1].name, second);
    EXPECT_NEAR(*capture.entries[0].stamp_s, 1355529599.9, 1e-6); // date -u -d 2012-12-14T23:59:59.9 +%s.%N
    EXPECT_EQ(*capture.entries[1].stamp_s, 1355529600);
    const Frame frame = capture.load(1);
    EXPECT_TRUE(frame.warnings.empty() || !warned(frame.warnings, "colour")) << tests::joined(frame.warnings);
    EXPECT_EQ(worst_difference(frame.colour, noise<cv::Vec3b>(small)), 0);
    EXPECT_FLOAT_EQ(frame.depth_m(0, 0), 0.017F);
}

TEST(pcl_recordings, two_cameras_are_not_registered) {
    const TemporaryFolder folder;
    write_shot(folder.path(), first, 70);
    const Capture capture = open_capture(folder.path());
    EXPECT_EQ(capture.registration, Registration::no);
    EXPECT_EQ(capture.camera->pinhole.fx, 60);
    EXPECT_FALSE(capture.colour_camera); // its pose is not known
}

TEST(pcl_recordings, name_what_is_missing_and_what_is_left_out) {
    const TemporaryFolder folder;
    write_shot(folder.path(), first);
    write_shot(folder.path(), second);
    fs::rename(folder / (first + "_depth.pclzf"), folder / "frame_depth.pclzf"); // without a time
    cv::imwrite((folder / (second + "_depth.tiff")).string(), noise<ushort>(small));
    cv::imwrite((folder / (second + "_rgb.tiff")).string(), noise<cv::Vec3b>(small));
    const Capture capture = open_capture(folder.path());
    EXPECT_TRUE(warned(capture.warnings, "2 images left out, beside TIME_depth.pclzf"));
    ASSERT_EQ(capture.entries.size(), 3);
    EXPECT_EQ(capture.entries[0].name, "frame");
    EXPECT_FALSE(capture.entries[0].stamp_s);
    EXPECT_TRUE(warned(capture.load(0).warnings, "no colour image"));
    EXPECT_TRUE(says(refusal([&] { (void)capture.load(1); }), first + "_depth.pclzf does not exist"));
    EXPECT_EQ(capture.load(2).depth_m.size(), small);
}

TEST(pcl_recordings, the_first_sound_xml_gives_the_camera_and_others_are_reported) {
    const TemporaryFolder folder;
    write_shot(folder.path(), first);
    write_shot(folder.path(), second);
    const std::string xml = file_bytes(folder / (first + ".xml"));
    write_file(folder / (first + ".xml"), xml.substr(0, 40));
    Capture capture = open_capture(folder.path());
    EXPECT_EQ(capture.camera->origin, (folder / (second + ".xml")).string());
    EXPECT_TRUE(warned(capture.warnings, first + ".xml line"));

    write_file(folder / (first + ".xml"), xml);
    EXPECT_TRUE(pcl::io::LZFDepth16ImageWriter().writeParameters({50, 61, 18.5, 11.5}, folder / (second + ".xml")));
    capture = open_capture(folder.path());
    EXPECT_EQ(capture.camera->pinhole.fx, 60);
    EXPECT_TRUE(warned(capture.warnings, second + ".xml has another camera than "));

    write_file(folder / "camera.json", R"({"fx":70,"fy":70,"cx":18,"cy":12,"width":38,"height":24})");
    EXPECT_EQ(open_capture(folder.path()).camera->pinhole.fx, 70);
}

TEST(pcl_recordings, a_single_depth_image_has_the_camera_beside_it) {
    const TemporaryFolder folder;
    write_shot(folder.path(), first);
    EXPECT_EQ(open_capture(folder / (first + "_depth.pclzf")).camera->pinhole.fy, 61);
    fs::remove(folder / (first + ".xml"));
    EXPECT_FALSE(open_capture(folder / (first + "_depth.pclzf")).camera);
    EXPECT_FALSE(open_capture(folder.path()).camera);
}

TEST(pcl_cameras, in_xml_of_the_wrong_shape_name_the_place) {
    const TemporaryFolder folder;
    const auto refused = [&](const std::string& text) {
        const fs::path file = write_file(folder / "camera.xml", text);
        const std::string message = refusal([&] { (void)read_camera_file(file); });
        EXPECT_TRUE(says(message, file.string()));
        return message;
    };
    const auto depth = [](const std::string& fx, const std::string& factor) {
        return fmt::format("<depth><focal_length_x>{}</focal_length_x><focal_length_y>61</focal_length_y>"
                           "<principal_point_x>18</principal_point_x><principal_point_y>12</principal_point_y>"
                           "<z_multiplication_factor>{}</z_multiplication_factor></depth>",
                           fx, factor);
    };
    EXPECT_EQ(read_camera_file(write_file(folder / "sound.xml", depth("60", "0.0002"))).depth_units_per_metre, 5000);
    EXPECT_TRUE(says(refused("<depth>"), "line 1"));
    EXPECT_TRUE(says(refused("<rgb/>"), "\"depth\" is missing"));
    EXPECT_TRUE(says(refused("<depth/>"), "\"depth.focal_length_x\" is missing"));
    EXPECT_TRUE(says(refused("\n\n<depth>\n<a></b>"), "line 4"));
    EXPECT_TRUE(says(refused(depth("wide", "0.001")), "\"depth.focal_length_x\" is \"wide\""));
    EXPECT_TRUE(says(refused(depth("-60", "0.001")), "depth.focal_length_x is -60"));
    EXPECT_TRUE(says(refused(depth("inf", "0.001")), "expected a finite number"));
    EXPECT_TRUE(says(refused(depth("60", "0")), "expected metres per stored unit"));
    EXPECT_TRUE(says(refused("<rgb/>" + depth("60", "0.001")), "\"rgb.focal_length_x\" is missing"));
    std::string deep;
    for (int i = 0; i < 100000; ++i)
        deep += "<a>";
    EXPECT_TRUE(says(refused(deep), "expected XML")); // and no stack overflows
}

TEST(pcl_recordings, of_a_kinect_are_the_same_as_its_tiffs) {
    const fs::path folder = tests::data_folder() / "pclzf";
    NEEDS(folder);
    const Capture capture = open_capture(folder);
    EXPECT_TRUE(warned(capture.warnings, "2 images left out"));
    EXPECT_EQ(capture.depth.units_per_metre, 1000);
    const Pinhole& pinhole = capture.camera->pinhole;
    EXPECT_EQ(std::tuple(pinhole.fx, pinhole.fy, pinhole.cx, pinhole.cy), std::tuple(525, 525, 320, 240));
    ASSERT_EQ(capture.entries.size(), 1);
    const Frame frame = capture.load(0);
    EXPECT_TRUE(frame.warnings.empty()) << tests::joined(frame.warnings);
    const std::string start = (folder / frame.name).string();
    const cv::Mat depth = read_stored_depth(start + "_depth.tiff"), colour = read_colour(start + "_rgb.tiff");
    EXPECT_EQ(worst_difference(frame.depth_m, depth_in_metres(depth, depth_encoding("mm", ""))), 0);
    EXPECT_EQ(worst_difference(frame.colour, colour), 0);
}

} // namespace
} // namespace scanshade
