// Camera files of every format come back as they were written, and damage is refused by the name of its key. Focal
// lengths from EXIF.
#include "io/cameras/camera_file.h"
#include "io/images/exif.h"
#include "projection/base/error.h"
#include "tests/support/files.h"

#include <array>
#include <filesystem>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using namespace tests;

TEST(camera_files, our_json_comes_back_bit_for_bit) {
    const TemporaryFolder folder;
    CameraFile written;
    written.camera = {{525.1234567890123, 524.9, 319.5, 239.25, {640, 480}}, {0.1, -0.2, 1e-4, 2e-5, 0.03}, ""};
    written.depth_units_per_metre = 5000;
    written.registration = Registration::yes;
    write_camera_file(folder / "camera.json", written);
    const CameraFile read = read_camera_file(folder / "camera.json");
    EXPECT_EQ(read.camera.pinhole.fx, written.camera.pinhole.fx);
    EXPECT_EQ(read.camera.pinhole.cy, written.camera.pinhole.cy);
    EXPECT_EQ(read.camera.pinhole.size, cv::Size(640, 480));
    EXPECT_EQ(read.camera.distortion.p2, 2e-5);
    EXPECT_EQ(read.depth_units_per_metre, 5000);
    EXPECT_EQ(read.registration, Registration::yes);
    EXPECT_TRUE(says(read.camera.origin, "camera.json"));
}

CameraFile two_cameras() {
    CameraFile file;
    file.camera = {{585, 585, 320, 240, {640, 480}}, {}, ""};
    ColourCamera colour{{{525.25, 524.75, 319.5, 239.25, {1280, 960}}, {-0.06, 0.01, 1e-3, -2e-3, 0}, ""}, {}};
    colour.colour_from_depth = Eigen::Isometry3d::Identity();
    colour.colour_from_depth.linear() = Eigen::AngleAxisd(0.03, Eigen::Vector3d(1, 2, -2) / 3).toRotationMatrix();
    colour.colour_from_depth.translation() = Eigen::Vector3d(0.025, -0.001, 0.002);
    file.colour = colour;
    return file;
}

TEST(camera_files, a_colour_camera_a_depth_correction_and_a_clock_come_back) {
    const TemporaryFolder folder;
    CameraFile written = two_cameras();
    written.depth_correction = {1.01, -0.004, 0.002};
    written.pose_time_offset_s = -0.0125;
    write_camera_file(folder / "camera.json", written);
    const CameraFile read = read_camera_file(folder / "camera.json");
    EXPECT_EQ(read.depth_correction, written.depth_correction);
    EXPECT_EQ(read.pose_time_offset_s, -0.0125);
    ASSERT_TRUE(read.colour);
    EXPECT_EQ(read.colour->camera.pinhole.size, cv::Size(1280, 960));
    EXPECT_EQ(read.colour->camera.pinhole.fx, 525.25);
    EXPECT_EQ(read.colour->camera.distortion, written.colour->camera.distortion);
    EXPECT_TRUE(read.colour->colour_from_depth.isApprox(written.colour->colour_from_depth, 1e-12));

    write_camera_file(folder / "chain.yaml", two_cameras(), CameraFormat::kalibr);
    const CameraFile chain = read_camera_file(folder / "chain.yaml");
    EXPECT_EQ(chain.camera.pinhole.fx, 585);
    ASSERT_TRUE(chain.colour);
    EXPECT_EQ(chain.colour->camera.distortion, written.colour->camera.distortion);
    EXPECT_TRUE(chain.colour->colour_from_depth.isApprox(written.colour->colour_from_depth, 1e-12));
    EXPECT_TRUE(warned(chain.warnings, "cam1 as the colour camera"));
}

TEST(camera_files, what_only_ours_can_hold_is_refused_elsewhere) {
    const TemporaryFolder folder;
    CameraFile corrected, late;
    corrected.camera = late.camera = two_cameras().camera;
    corrected.depth_correction.scale = 1.02;
    late.pose_time_offset_s = 0.01;
    for (const CameraFormat format :
         {CameraFormat::open3d, CameraFormat::opencv, CameraFormat::ros, CameraFormat::colmap})
        EXPECT_TRUE(says(refusal([&] { write_camera_file(folder / "c", two_cameras(), format); }), "holds one camera"));
    EXPECT_TRUE(says(refusal([&] { write_camera_file(folder / "c", corrected, CameraFormat::kalibr); }),
                     "no depth correction, and there is one (1.02 z"));
    EXPECT_TRUE(says(refusal([&] { write_camera_file(folder / "c", late, CameraFormat::ros); }), "no time offset"));
    EXPECT_FALSE(fs::exists(folder / "c"));
}

TEST(camera_files, damage_to_the_secondary_camera_names_the_key) {
    const TemporaryFolder folder;
    const std::string main = R"({"fx":5,"fy":5,"cx":1,"cy":1,"width":4,"height":4)";
    const auto message = [&](const std::string& more) {
        return refusal([&] { (void)read_camera_file(write_file(folder / "c.json", main + "," + more + "}")); });
    };
    const std::string numbers = R"("fx":5,"fy":5,"cx":1,"cy":1,"width":4,"height":4)";
    EXPECT_TRUE(says(message(R"("colour":3)"), "not an object that describes a camera"));
    EXPECT_TRUE(says(message(R"("colour":{)" + numbers + "}"), "\"colour_from_depth\" is missing"));
    EXPECT_TRUE(
        says(message(R"("colour":{)" + numbers + R"(,"colour_from_depth":[[1,0,0,0]]})"), "not a list of 4 rows"));
    EXPECT_TRUE(
        says(message(R"("colour":{)" + numbers + R"(,"colour_from_depth":[[2,0,0,0],[0,2,0,0],[0,0,2,0],[0,0,0,1]]})"),
             "not a rotation and a shift"));
    EXPECT_TRUE(says(message(R"("depth_correction":1)"), "\"depth_correction\""));
    EXPECT_TRUE(says(message(R"("depth_correction":{"scale":0})"), "\"scale\" is 0"));
    EXPECT_TRUE(says(message(R"("depth_correction":{"offset_m":"far"})"), "\"offset_m\""));
    EXPECT_TRUE(says(message(R"("pose_time_offset_s":[])"), "\"pose_time_offset_s\""));
}

TEST(camera_files, known_cameras_go_by_name) {
    const CameraFile known = camera_from_argument("tum-fr1");
    EXPECT_EQ(known.camera.pinhole.fx, 517.3);
    EXPECT_EQ(known.camera.distortion.k1, 0.2624);
    EXPECT_TRUE(says(known.camera.origin, "freiburg1"));
    EXPECT_TRUE(says(refusal([] { (void)camera_from_argument("tum-fr9"); }), "primesense"));
}

TEST(camera_files, a_text_matrix_is_read_by_rows_and_names_no_size) {
    const TemporaryFolder folder;
    const auto read = read_camera_file(write_file(folder / "k.txt", "\xEF\xBB\xBF"
                                                                    "585 0 320\r\n0 586 240\r\n0 0 1\r\n"));
    EXPECT_EQ(read.camera.pinhole.fy, 586);
    EXPECT_EQ(read.camera.pinhole.cx, 320);
    EXPECT_TRUE(read.camera.pinhole.size.empty());
}

TEST(camera_files, bundle_fusion_info_gives_size_and_depth_unit) {
    const TemporaryFolder folder;
    const auto read = read_camera_file(write_file(
        folder / "info.txt", "m_versionNumber = 4\nm_depthWidth = 640\nm_depthHeight = 480\nm_depthShift = 1000\n"
                             "m_calibrationDepthIntrinsic = 582 0 320 0 0 583 240 0 0 0 1 0 0 0 0 1\n"));
    EXPECT_EQ(read.camera.pinhole.fx, 582);
    EXPECT_EQ(read.camera.pinhole.fy, 583);
    EXPECT_EQ(read.camera.pinhole.cy, 240);
    EXPECT_EQ(read.camera.pinhole.size, cv::Size(640, 480));
    EXPECT_EQ(read.depth_units_per_metre, 1000);
}

TEST(camera_files, depth_scales_of_others_are_used_and_said_or_named_as_unused) {
    const TemporaryFolder folder;
    struct Row {
        const char* keys;
        std::optional<double> units_per_metre;
        const char* said;
    };
    for (const Row& row :
         {Row{R"("depth_scale":0.1)", 10000, "millimetres per unit"}, // BOP
          {R"("depth_scale":1.0)", 1000, "millimetres per unit"},
          {R"("depth_scale":0.001)", 1000, "metres per unit"}, // librealsense
          {R"("depth_scale":0.00025)", 4000, "metres per unit"},
          {R"("integer_depth_scale":0.0002)", 5000, "metres per unit"},
          {R"("depth_scale":5000)", 5000, "units per metre"}, // Open3D
          {R"("png_depth_scale":6553.5)", 6553.5, "units per metre"},
          {R"("depth_scale":50)", std::nullopt, "\"depth_scale\" 50 is not used"},
          {R"("depth_scale":-1)", std::nullopt, "\"depth_scale\" -1 is not used"},
          {R"("depth_units_per_metre":1000,"depth_scale":0.1)", 1000, "\"depth_scale\" 0.1 is not used"},
          {R"("depth_max":4,"baseline":[0.05,0,0])", std::nullopt, "not used: \"baseline\", \"depth_max\""},
          {R"("name":"left","k1":0.1)", std::nullopt, nullptr}}) {
        SCOPED_TRACE(row.keys);
        const auto read = read_camera_file(
            write_file(folder / "camera.json",
                       fmt::format(R"({{"fx":140,"fy":141,"ppx":79.5,"ppy":59.5,"w":160,"h":120,{}}})", row.keys)));
        EXPECT_EQ(read.camera.pinhole.cx, 79.5);
        EXPECT_EQ(read.camera.pinhole.size, cv::Size(160, 120));
        ASSERT_EQ(read.depth_units_per_metre.has_value(), row.units_per_metre.has_value());
        EXPECT_NEAR(read.depth_units_per_metre.value_or(0), row.units_per_metre.value_or(0), 1e-6);
        EXPECT_EQ(read.warnings.empty(), !row.said) << tests::joined(read.warnings);
        EXPECT_TRUE(says(tests::joined(read.warnings), row.said ? row.said : "")) << tests::joined(read.warnings);
    }
}

TEST(camera_files, matrices_as_others_write_them) {
    const TemporaryFolder folder;
    for (const char* text : {"140 0 79.5\n0 140 59.5\n0 0 1\n", "140,0,79.5,0,140,59.5,0,0,1", "140 140 79.5 59.5\n",
                             "[[140. 0. 79.5]\n [0. 140. 59.5]\n [0. 0. 1.]]\n", "# fx fy cx cy\n140, 140, 79.5, 59.5",
                             "140 0 79.5 0\n0 140 59.5 0\n0 0 1 0\n0 0 0 1\n", "140 0 79.5 0 0 140 59.5 0 0 0 1 0"}) {
        const Pinhole read = read_camera_file(write_file(folder / "K.txt", text)).camera.pinhole;
        EXPECT_EQ(std::tuple(read.fx, read.fy, read.cx, read.cy), std::tuple(140, 140, 79.5, 59.5)) << text;
    }
    const auto refused = [&](const char* text) {
        return refusal([&] { (void)read_camera_file(write_file(folder / "K.txt", text)); });
    };
    EXPECT_TRUE(says(refused("140 0 79.5\n0 140 59.5\n0 0 1\n0 0 0\n"), "stored by rows"));
    EXPECT_TRUE(says(refused("1 2 3 4 5\n"), "5 numbers"));
    EXPECT_TRUE(says(refused("140 0 79.5\n0 wide 59.5\n0 0 1\n"), "line 2"));
    EXPECT_TRUE(says(refused("140 0 79.5 3\n0 140 59.5 0\n0 0 1 0\n0 0 0 1\n"), "stored by rows"));
    EXPECT_TRUE(says(refused("140 2 79.5\n0 140 59.5\n0 0 1\n"), "skew 2"));
}

TEST(camera_files, every_format_comes_back_as_it_was_written) {
    const TemporaryFolder folder;
    const Pinhole pinhole{525.1234567890123, 524.9, 319.5, 239.25, {640, 480}};
    const Distortion none{}, brown{0.1, -0.2, 1e-4, 2e-5, 0.03}, four{0.1, -0.2, 1e-4, 2e-5, 0};
    const Distortion fisheye = kannala_brandt({0.1, -0.2, 0.03, -0.004});
    const Distortion rational{0.4321, 0.0187, -8.9e-5, -5.2e-5, 0, 0.7718, 0.1184, 0.0064};
    struct Row {
        CameraFormat format;
        const char* name;
        std::vector<Distortion> lenses;
    };
    for (const Row& row : {Row{CameraFormat::scanshade, "a.json", {none, brown, rational, fisheye}},
                           Row{CameraFormat::open3d, "b.json", {none}},
                           Row{CameraFormat::opencv, "c.yml", {none, brown, rational, fisheye}},
                           Row{CameraFormat::ros, "d.yaml", {none, brown, rational, fisheye}},
                           Row{CameraFormat::kalibr, "e.yaml", {none, four, fisheye}},
                           Row{CameraFormat::colmap, "f.txt", {none, four, brown, rational, fisheye}}})
        for (const Distortion& lens : row.lenses) {
            const fs::path file = folder / row.name;
            write_camera_file(file, {.camera = {pinhole, lens, ""}, .depth_units_per_metre = {}, .warnings = {}},
                              row.format);
            const Camera read = read_camera_file(file).camera;
            EXPECT_NEAR(read.pinhole.fx, pinhole.fx, 1e-9) << row.name;
            EXPECT_NEAR(read.pinhole.fy, pinhole.fy, 1e-9) << row.name;
            EXPECT_NEAR(read.pinhole.cx, pinhole.cx, 1e-9) << row.name << ": pixel centres are integers for us";
            EXPECT_NEAR(read.pinhole.cy, pinhole.cy, 1e-9) << row.name;
            EXPECT_EQ(read.pinhole.size, pinhole.size) << row.name;
            EXPECT_EQ(read.distortion, lens) << row.name;
        }
}

TEST(camera_files, what_a_format_cannot_say_is_refused_not_dropped) {
    const TemporaryFolder folder;
    const CameraFile bent{.camera = {{525, 525, 319.5, 239.5, {640, 480}}, {0.1, 0, 0, 0, 0.2}, ""},
                          .depth_units_per_metre = {},
                          .warnings = {}};
    EXPECT_TRUE(
        says(refusal([&] { write_camera_file(folder / "a.json", bent, CameraFormat::open3d); }), "no lens distortion"));
    EXPECT_TRUE(says(refusal([&] { write_camera_file(folder / "a.yaml", bent, CameraFormat::kalibr); }), "k3"));
    EXPECT_FALSE(fs::exists(folder / "a.json"));
    CameraFile rational = bent;
    rational.camera.distortion = {.k1 = 0.1, .k6 = 0.2};
    EXPECT_TRUE(says(refusal([&] { write_camera_file(folder / "a.yaml", rational, CameraFormat::kalibr); }), "k6 0.2"));
}

TEST(camera_files, yaml_and_colmap_of_the_wrong_shape_name_the_place) {
    const TemporaryFolder folder;
    const auto message = [&](const std::string& text) {
        return refusal([&] { (void)read_camera_file(write_file(folder / "c.yaml", text)); });
    };
    EXPECT_TRUE(
        says(message("camera_matrix:\n  rows: 3\n  cols: 3\n  data: [1, 0, 0, 0, 1]\n"), "has 5 numbers, expected 9"));
    EXPECT_TRUE(says(message("cam0:\n  camera_model: omni\n"), "\"omni\", expected pinhole"));
    EXPECT_TRUE(says(message("image_width: 640\n"), "\"camera_matrix\""));
    const std::string fine = "camera_matrix:\n  rows: 3\n  cols: 3\n  data: [5., 0., 1., 0., 5., 1., 0., 0., 1.]\n";
    EXPECT_TRUE(says(message(fine + "distortion_coefficients: [1., 2.]\n"), "has 2 numbers"));
    EXPECT_TRUE(says(message(fine + "distortion_coefficients: [1., 0., 0., 0., 0., 2., 0.]\n"), "4, 5 or 8"));
    EXPECT_TRUE(says(message(fine + "distortion_coefficients: [1., 0., 0., 0., 0., 2., 0., 0., 3., 0., 0., 0.]\n"),
                     "number 9 is 3: thin-prism"));
    EXPECT_TRUE(says(message("%YAML:1.0\n---\na: [1, 2\nb: 3\n"), "line"));
    EXPECT_TRUE(says(message("1 PINHOLE 640 480 500 500 320\n"), "line 1: PINHOLE has 3 numbers, expected 4"));
    EXPECT_TRUE(says(message("1 FOV 640 480 500 500 320 240 1\n"), "line 1: the camera model \"FOV\""));
    EXPECT_TRUE(says(message("1 PINHOLE 640 480 -500 500 320 240\n"), "fx is -500"));
}

TEST(camera_files, the_command_line_takes_numbers_or_a_file) {
    const CameraFile numbers = camera_from_argument("500, 501, 320, 240");
    EXPECT_EQ(numbers.camera.pinhole.fy, 501);
    EXPECT_TRUE(says(numbers.camera.origin, "--camera"));
    for (const char* text :
         {"500,501,320", "500,501,320,x", "-500,501,320,240", "0,501,320,240", "nowhere.json", "500,nan,1,1"})
        EXPECT_THROW((void)camera_from_argument(text), Misuse) << text;
}

TEST(camera_files, a_negative_fy_is_a_y_axis_upwards) {
    const TemporaryFolder folder;
    for (const CameraFile& read :
         {camera_from_argument("481.2,-480,319.5,239.5"),
          read_camera_file(write_file(folder / "k.txt", "481.2 0 319.5\n0 -480 239.5\n0 0 1\n"))}) {
        EXPECT_EQ(read.camera.pinhole.fy, 480);
        EXPECT_EQ(read.camera.pinhole.cy, 239.5) << "rows still go down";
        EXPECT_TRUE(read.y_was_up);
        EXPECT_TRUE(warned(read.warnings, "y is upwards")) << joined(read.warnings);
    }
    const CameraFile lens = read_camera_file(
        write_file(folder / "c.json", R"({"fx": 50, "fy": -50, "cx": 31.5, "cy": 23.5, "width": 64, "height": 48,
                                          "distortion": [0.1, 0, 0.02, 0.03, 0]})"));
    EXPECT_EQ(lens.camera.distortion.p1, -0.02);
    EXPECT_EQ(lens.camera.distortion.p2, 0.03);
    EXPECT_FALSE(camera_from_argument("481.2,480,319.5,239.5").y_was_up);
}

TEST(camera_files, json_lenses_are_read_by_any_of_their_names) {
    const TemporaryFolder folder;
    const auto text = [](const std::string& lens) {
        return R"({"fx": 50, "fy": 50, "cx": 31.5, "cy": 23.5, "width": 64, "height": 48, )" + lens + "}";
    };
    const auto read = [&](const std::string& lens) {
        return read_camera_file(write_file(folder / "c.json", text(lens))).camera.distortion;
    };
    const Distortion lens{.k1 = 0.1, .k2 = -0.2, .p1 = 0.01, .p2 = 0.02};
    for (const char* name : {"distortion", "distortion_coefficients", "dist_coeffs", "distCoeffs", "dist", "D"}) {
        EXPECT_EQ(read(fmt::format(R"("{}": [0.1, -0.2, 0.01, 0.02])", name)), lens) << name;
        EXPECT_EQ(read(fmt::format(R"("{}": [0.1, -0.2, 0.01, 0.02, 0])", name)), lens) << name;
    }
    EXPECT_EQ(read(R"("k1": 0.1, "k2": -0.2, "p1": 0.01, "p2": 0.02)"), lens);
    EXPECT_EQ(read(R"("D": [], "distortion": null)"), Distortion{});
    EXPECT_EQ(read(R"("k1": 0.1, "k6": 0.3)"), (Distortion{.k1 = 0.1, .k6 = 0.3}));
    const Distortion fisheye{.k1 = 0.1, .k2 = 0.2, .model = LensModel::kannala_brandt};
    EXPECT_EQ(read(R"("fisheye": [0.1, 0.2, 0, 0])"), fisheye);
    EXPECT_EQ(read(R"("k1": 0.1, "k2": 0.2, "camera_model": "OPENCV_FISHEYE")"), fisheye);
    EXPECT_EQ(read(R"("dist": [0.1, 0.2, 0, 0], "distortion_model": "equidistant")"), fisheye);
    const std::string both = refusal([&] { (void)read(R"("dist": [0.1, 0, 0, 0], "k1": 0.1)"); });
    EXPECT_TRUE(says(both, "\"dist\" and \"k1\" are both there")) << both;
}

TEST(camera_files, json_of_the_wrong_shape_names_the_key) {
    const TemporaryFolder folder;
    const auto message = [&](const std::string& text) {
        return refusal([&] { (void)read_camera_file(write_file(folder / "c.json", text)); });
    };
    EXPECT_TRUE(says(message(R"({"fx": 1, "fy": 1, "cx": 1, "width": 4, "height": 4})"), "\"cy\""));
    EXPECT_TRUE(says(message(R"({"fx": 1, "fy": 1, "cx": 1, "cy": "x", "width": 4, "height": 4})"), "\"cy\""));
    EXPECT_TRUE(says(message(R"({"fx": 1, "fy": 1, "cx": 1, "cy": 1, "width": 0, "height": 4})"), "\"width\""));
    EXPECT_TRUE(says(message(R"({"fx": 1, "fy": 1, "cx": 1, "cy": 1, "width": 4, "height": 4, "distortion": [1]})"),
                     "\"distortion\" has 1 number, expected 5"));
    EXPECT_TRUE(says(message(R"({"fx": 1, "fy": 1, "cx": 1, "cy": 1, "width": 4, "height": 4,
                                 "distortion": [1, 2, 3, 4, 5, 6, 7, "x"]})"),
                     "\"distortion\" is"));
    EXPECT_TRUE(says(message(R"({"fx": 1e999, "fy": 1, "cx": 1, "cy": 1, "width": 4, "height": 4})"), "c.json"));
    EXPECT_TRUE(says(message("[1, 2]"), "object"));
    EXPECT_TRUE(says(message(""), "empty"));
    EXPECT_TRUE(says(message("{\"fx\": 1,\n \"cx\": Infinity}"), "line 2"));
    EXPECT_TRUE(says(message("{\"fx\": 1,\n \"cx\": Infinity}"), "\"cx\""));
}

// --- EXIF ---

/// A JPEG with an EXIF block of little-endian tags in its Exif directory: number, type (3 short, 4 long, 5 ratio),
/// value.
fs::path jpeg_with(const fs::path& file, const std::vector<std::array<unsigned, 4>>& tags) {
    std::string tiff("II*\0\x08\0\0\0", 8);
    const auto add = [&](unsigned value, int bytes) {
        for (int i = 0; i < bytes; ++i)
            tiff += static_cast<char>((value >> (8 * i)) & 0xFF);
    };
    add(1, 2); // one entry: where the Exif directory is
    add(0x8769, 2), add(4, 2), add(1, 4), add(26, 4), add(0, 4);
    add(static_cast<unsigned>(tags.size()), 2);
    unsigned ratios = 26 + 2 + 12 * static_cast<unsigned>(tags.size()) + 4;
    for (const auto& [tag, type, value, under] : tags) {
        add(tag, 2), add(type, 2), add(1, 4), add(type == 5 ? ratios : value, 4);
        ratios += type == 5 ? 8 : 0;
    }
    add(0, 4);
    for (const auto& [tag, type, value, under] : tags)
        if (type == 5)
            add(value, 4), add(under, 4);
    std::vector<unsigned char> encoded;
    cv::imencode(".jpg", cv::Mat3b(60, 80, cv::Vec3b(10, 20, 30)), encoded);
    std::string jpeg(encoded.begin(), encoded.end());
    const std::string block = std::string("Exif\0\0", 6) + tiff;
    const auto length = static_cast<unsigned>(block.size() + 2);
    jpeg.insert(2,
                std::string("\xFF\xE1", 2) + static_cast<char>(length >> 8) + static_cast<char>(length & 0xFF) + block);
    return write_file(file, jpeg);
}

TEST(exif, gives_the_focal_length_in_pixels) {
    const TemporaryFolder folder;
    const cv::Size size(80, 60); // its diagonal is 100
    // 26 mm on film of 43.27 mm diagonal.
    const auto film = exif_focal_length_px(jpeg_with(folder / "film.jpg", {{0xA405, 3, 26, 0}}), size);
    ASSERT_TRUE(film);
    EXPECT_NEAR(*film, 26 / 43.2666 * 100, 1e-9);
    // 4.2 mm before a sensor of 200 pixels per centimetre that was 800 x 600 pixels large: 84 px then, a tenth now.
    const auto sensor = exif_focal_length_px(
        jpeg_with(
            folder / "sensor.jpg",
            {{0x920A, 5, 42, 10}, {0xA002, 4, 800, 0}, {0xA003, 4, 600, 0}, {0xA20E, 5, 200, 1}, {0xA210, 3, 3, 0}}),
        size);
    ASSERT_TRUE(sensor);
    EXPECT_NEAR(*sensor, 8.4, 1e-9);
    EXPECT_FALSE(exif_focal_length_px(jpeg_with(folder / "none.jpg", {{0x920A, 5, 42, 10}}), size)); // of what sensor?
    EXPECT_FALSE(exif_focal_length_px(jpeg_with(folder / "zero.jpg", {{0xA405, 3, 0, 0}}), size));
    EXPECT_FALSE(exif_focal_length_px(write_file(folder / "broken.jpg", "\xFF\xD8\xFF\xE1"), size));
    EXPECT_FALSE(exif_focal_length_px(folder / "nowhere.jpg", size));
}

} // namespace
} // namespace scanshade
