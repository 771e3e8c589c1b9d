// Camera files as other programs write them: other names for the same numbers, XML, settings, tables, printed matrices.
#include "io/cameras/camera_file.h"
#include "tests/support/files.h"

#include <chrono>
#include <gtest/gtest.h>

namespace scanshade {
namespace {

using namespace tests;

struct OthersCamera {
    const char* name; ///< of the file
    const char* text;
    cv::Size size = {};
    double k1 = 0;
    double units_per_metre = 0;
    const char* warning = nullptr;
};

void PrintTo(const OthersCamera& row, std::ostream* to) { *to << row.name; }

class CamerasOfOthers : public testing::TestWithParam<OthersCamera> {};

TEST_P(CamerasOfOthers, are_read) {
    const OthersCamera& row = GetParam();
    const TemporaryFolder folder;
    const CameraFile found = read_camera_file(write_file(folder / row.name, row.text));
    const Pinhole& pinhole = found.camera.pinhole;
    EXPECT_EQ(pinhole.fx, 140);
    EXPECT_EQ(pinhole.fy, 141);
    EXPECT_EQ(pinhole.cx, 79.5);
    EXPECT_EQ(pinhole.cy, 59.5);
    EXPECT_EQ(pinhole.size, row.size);
    EXPECT_EQ(found.camera.distortion.k1, row.k1);
    EXPECT_EQ(found.depth_units_per_metre.value_or(0), row.units_per_metre);
    EXPECT_EQ(found.warnings.empty(), row.warning == nullptr) << joined(found.warnings);
    EXPECT_TRUE(says(joined(found.warnings), row.warning ? row.warning : ""));
}

const cv::Size known(160, 120);
constexpr const char* opencv_xml =
    "<?xml version=\"1.0\"?>\n<opencv_storage>\n<image_width>160</image_width><image_height>120</image_height>\n"
    "<camera_matrix type_id=\"opencv-matrix\"><rows>3</rows><cols>3</cols><dt>d</dt>\n"
    "<data>140. 0. 79.5 0. 1.41e+02\n 59.5 0. 0. 1.</data></camera_matrix>\n"
    "<distortion_coefficients type_id=\"opencv-matrix\"><rows>5</rows><cols>1</cols><dt>d</dt>\n"
    "<data>0.1 0. 0. 0. 0.</data></distortion_coefficients>\n</opencv_storage>\n";

INSTANTIATE_TEST_SUITE_P(
    Of, CamerasOfOthers,
    testing::Values(
        OthersCamera{"opencv.xml", opencv_xml, known, 0.1},
        OthersCamera{"old_opencv.xml",
                     "<opencv_storage><Camera_Matrix><data>140 0 79.5 0 141 59.5 0 0 1</data></Camera_Matrix>"
                     "</opencv_storage>"},
        OthersCamera{"old_opencv.yml",
                     "%YAML:1.0\n---\nimage_Width: 160\nimage_Height: 120\nCamera_Matrix: !!opencv-matrix\n   rows: "
                     "3\n   cols: 3\n"
                     "   dt: d\n   data: [ 140., 0., 79.5, 0., 141., 59.5, 0., 0., 1. ]\n"
                     "Distortion_Coefficients: !!opencv-matrix\n   rows: 4\n   cols: 1\n   dt: d\n   data: [ 0.1, 0., "
                     "0., 0. ]\n",
                     known, 0.1},
        OthersCamera{"stereo.yml", "%YAML:1.0\n---\nM1: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
                                   "   data: [ 140., 0., 79.5, 0., 141., 59.5, 0., 0., 1. ]\n"},
        OthersCamera{
            "euroc_sensor.yaml",
            "sensor_type: camera\nintrinsics: [140, 141, 79.5, 59.5]\nresolution: [160, 120]\ncamera_model: pinhole\n"
            "distortion_model: radial-tangential\ndistortion_coefficients: [0.1, 0, 0, 0]\n",
            known, 0.1},
        OthersCamera{"orb_slam2.yaml",
                     "%YAML:1.0\n# Camera\nCamera.fx: 140.0\nCamera.fy: 141.0\nCamera.cx: 79.5\nCamera.cy: "
                     "59.5\nCamera.k1: 0.1\n"
                     "Camera.k2: 0.0\nCamera.p1: 0.0\nCamera.p2: 0.0\nCamera.width: 160\nCamera.height: 120\n"
                     "DepthMapFactor: 5000.0\n",
                     known, 0.1, 5000, "taken as units per metre"},
        OthersCamera{"orb_slam3.yaml",
                     "%YAML:1.0\nCamera.type: \"PinHole\"\nCamera1.fx: 140\nCamera1.fy: 141\nCamera1.cx: "
                     "79.5\nCamera1.cy: 59.5\n"
                     "RGBD.DepthMapFactor: 1.0\n",
                     {},
                     0,
                     1,
                     "taken as units per metre"},
        OthersCamera{"unused.yaml",
                     "fx: 140\nfy: 141\ncx: 79.5\ncy: 59.5\nbaseline: 0.05\n",
                     {},
                     0,
                     0,
                     "not used: \"baseline\""},
        OthersCamera{"plain.txt", "fx = 140\nfy = 141\ncx = 79.5 # of depth\ncy = 59.5\nwidth = 160\nheight = 120\n",
                     known},
        OthersCamera{"blanks.txt", "fx 140\nfy 141\ncx 79.5\ncy 59.5\n"},
        OthersCamera{"viewer.csv",
                     "Stream,Depth\nFormat,Z16\nResolution x,160\nResolution y,120\nIntrinsics:,\nFx,140.0\n"
                     "Fy,141.0\nPPx,79.5\nPPy,59.5\nDistortion,Brown Conrady\n",
                     known},
        OthersCamera{"rows.json", R"({"K": [[140,0,79.5],[0,141,59.5],[0,0,1]], "width": 160, "height": 120})", known},
        OthersCamera{"flat.json",
                     R"({"camera_matrix": {"rows": 3, "data": [140,0,79.5,0,141,59.5,0,0,1]}, "dist": [0.1,0,0,0,0]})",
                     {},
                     0.1},
        OthersCamera{"mark.json",
                     "\xEF\xBB\xBF{\"fx\": 140, \"fy\": 141, \"cx\": 79.5, \"cy\": 59.5, \"w\": 160, \"h\": 120}",
                     known},
        OthersCamera{
            "librealsense.json",
            R"({"fx": 140, "fy": 141, "ppx": 79.5, "ppy": 59.5, "width": 160, "height": 120, "depth_scale": 0.001})",
            known, 0, 1000, "metres per unit"},
        OthersCamera{"scannet.txt", "140 0 79.5 0\n0 141 59.5 0\n0 0 1 0\n0 0 0 1\n"},
        OthersCamera{"one_line.txt", "140, 0, 79.5, 0, 141, 59.5, 0, 0, 1"},
        OthersCamera{"printed.txt", "[[140.    0.   79.5]\n [  0.  141.   59.5]\n [  0.    0.    1. ]]\n"},
        OthersCamera{"four.txt", "140 141 79.5 59.5\n"},
        OthersCamera{"columns.json",
                     R"({"intrinsics": [[140,0,0],[0,141,0],[79.5,59.5,1]], "imageResolution": [160,120]})", known},
        OthersCamera{"columns.txt", "140 0 0\n0 141 0\n79.5 59.5 1\n"},
        OthersCamera{"decimal_commas.txt", "140,0 0,0 79,5\n0,0 141,0 59,5\n0,0 0,0 1,0\n"},
        OthersCamera{"assigned.txt", "K = [140 0 79.5\n 0 141 59.5\n 0 0 1]\n"},
        OthersCamera{"numpy_repr.txt", "array([[140., 0., 79.5],\n       [0., 141., 59.5],\n       [0., 0., 1.]])\n"},
        OthersCamera{"size_first.txt", "160 120\n140 141 79.5 59.5\n", known},
        OthersCamera{"size_last.txt", "140 141 79.5 59.5 160 120\n", known},
        OthersCamera{"dictionary.txt", "{'fx': 140.0, 'fy': 141.0, 'cx': 79.5, 'cy': 59.5}\n"},
        OthersCamera{"one_line_keys.txt", "fx=140, fy=141, cx=79.5, cy=59.5\n"},
        OthersCamera{"table.csv", "fx,fy,cx,cy,width,height\n140,141,79.5,59.5,160,120\n", known},
        OthersCamera{"librealsense.txt", "[ 160x120  p[79.5 59.5]  f[140 141]  Brown Conrady [0.1 0 0 0 0] ]\n", known,
                     0.1},
        OthersCamera{"enumerated.txt",
                     "  Width:  160\n  Height: 120\n  PPX:  79.5\n  PPY:  59.5\n  Fx:  140\n  Fy:  141\n"
                     "  Distortion:  Brown Conrady\n  Coeffs:  0.1  0  0  0  0\n",
                     known, 0.1},
        OthersCamera{"ros2.yaml",
                     "height: 120\nwidth: 160\ndistortion_model: plumb_bob\nd:\n- 0.1\n- 0.0\n- 0.0\n- 0.0\n- 0.0\n"
                     "k: [140.0, 0.0, 79.5, 0.0, 141.0, 59.5, 0.0, 0.0, 1.0]\nr: [1.0, 0.0]\nbinning_x: 0\n",
                     known, 0.1},
        OthersCamera{
            "ros2.json",
            R"({"width": 160, "height": 120, "d": [0.1,0,0,0,0], "k": [140,0,79.5,0,141,59.5,0,0,1], "binning_x": 0})",
            known, 0.1},
        OthersCamera{"opencv_unit.yml",
                     "%YAML:1.0\n---\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
                     "   data: [ 140., 0., 79.5, 0., 141., 59.5, 0., 0., 1. ]\ndepth_scale: 0.00025\n",
                     {},
                     0,
                     4000,
                     "metres per unit"},
        OthersCamera{"opencv_unused.yml",
                     "%YAML:1.0\n---\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
                     "   data: [ 140., 0., 79.5, 0., 141., 59.5, 0., 0., 1. ]\nunit: 0.00025\n",
                     {},
                     0,
                     0,
                     "not used: \"unit\""},
        OthersCamera{"camchain.yaml",
                     "cam0:\n  camera_model: pinhole\n  intrinsics: [140, 141, 79.5, 59.5]\n  resolution: [160, 120]\n"
                     "  depth_factor: 5000\n",
                     known, 0, 5000, "units per metre"},
        OthersCamera{"open3d_parameters.json",
                     R"({"class_name": "PinholeCameraParameters", "extrinsic": [1,0], "intrinsic":
            {"height": 120, "width": 160, "intrinsic_matrix": [140,0,0,0,141,0,79.5,59.5,1]}})",
                     known, 0, 0, "the camera in \"intrinsic\" is used"},
        OthersCamera{
            "open3d_trajectory.json",
            R"({"parameters": [{"intrinsic": {"height": 120, "width": 160, "intrinsic_matrix": [140,0,0,0,141,0,79.5,59.5,1]}},
            {"intrinsic": {"height": 120, "width": 160, "intrinsic_matrix": [140,0,0,0,141,0,79.5,59.5,1]}}]})",
            known, 0, 0, "of 2 there"},
        OthersCamera{
            "nested.json",
            R"({"intrinsics": {"fx": 140, "fy": 141, "cx": 79.5, "cy": 59.5}, "resolution": {"width": 160, "height": 120},
            "depth_scale": 0.001})",
            known, 0, 1000, "metres per unit"},
        OthersCamera{"two.json", R"({"depth": {"fx": 140, "fy": 141, "cx": 79.5, "cy": 59.5, "w": 160, "h": 120},
            "color": {"fx": 600, "fy": 600, "cx": 320, "cy": 240, "w": 640, "h": 480}})",
                     known, 0, 0, "\"depth\" is used, of 2 there"},
        OthersCamera{"nested_numbers.json",
                     R"({"fx": 140, "fy": 141, "cx": 79.5, "cy": 59.5, "w": 160, "h": 120, "lens": {"k1": -0.3}})",
                     known, 0, 0, "not used: \"lens.k1\""},
        OthersCamera{"nerfstudio.json",
                     R"({"fl_x": 140, "fl_y": 141, "cx": 80, "cy": 60, "w": 160, "h": 120, "frames": []})", known},
        OthersCamera{"pairs.json",
                     R"({"focal_length": [140, 141], "principal_point": [79.5, 59.5], "image_size": [160, 120]})",
                     known},
        OthersCamera{
            "strings.json",
            R"({"Fx": "140.0", "Fy": "141", "Cx": "79.5", "Cy": "59.5", "Width": "160", "Height": "120", "depthScale": "0.001"})",
            known, 0, 1000, "metres per unit"},
        OthersCamera{"four.json", "[140, 141, 79.5, 59.5]"},
        OthersCamera{"twelve.json",
                     R"({"K": [140, 0, 79.5, 0, 141, 59.5, 0, 0, 1], "dist": [0.1,0,0,0,0,0,0,0,0,0,0,0]})",
                     {},
                     0.1},
        OthersCamera{"lens_object.json",
                     R"({"K": [140, 0, 79.5, 0, 141, 59.5, 0, 0, 1], "distortion": {"k1": 0.1, "p2": 0}})",
                     {},
                     0.1}),
    [](const auto& info) {
        std::string name = info.param.name;
        std::ranges::replace(name, '.', '_');
        return name;
    });

TEST(CamerasOfOthers16, of_two_bytes_a_character_are_read) {
    const TemporaryFolder folder;
    for (const bool little : {true, false}) {
        std::string text = little ? "\xff\xfe" : "\xfe\xff";
        for (const char c : std::string("140 0 79.5\r\n0 141 59.5\r\n0 0 1\r\n"))
            text += little ? std::string{c, '\0'} : std::string{'\0', c};
        EXPECT_EQ(read_camera_file(write_file(folder / "K.txt", text)).camera.pinhole.cy, 59.5);
    }
}

TEST(CamerasOfOthers16, amid_many_numbers_are_found_soon) {
    std::string many = "{";
    for (int i = 0; i < 20000; ++i)
        many += "\"a" + std::to_string(i) + "\": 1, ";
    many += "\"b\": [";
    for (int i = 0; i < 20000; ++i)
        many += "{}, ";
    const TemporaryFolder folder;
    const auto begin = std::chrono::steady_clock::now();
    EXPECT_TRUE(
        says(refusal([&] { (void)read_camera_file(write_file(folder / "c.json", many + "{}]}")); }), "both missing"));
    EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(20))
        << "minutes, if all were copied for each";
}

TEST(CamerasOfOthersRefused, say_what_they_are_and_what_was_expected) {
    const TemporaryFolder folder;
    const auto complaint = [&](const char* name, const char* text) {
        return refusal([&] { (void)read_camera_file(write_file(folder / name, text)); });
    };
    EXPECT_TRUE(
        says(complaint("SN1.conf", "[LEFT_CAM_VGA]\nfx=140.0\nfy=141.0\ncx=79.5\ncy=59.5\n[LEFT_CAM_HD]\nfx=700\n"),
             "an INI file, as of ZED cameras, with a camera for each section: none is chosen. [LEFT_CAM_VGA] would be "
             "--camera 140.0,141.0,79.5,59.5"));
    EXPECT_TRUE(
        says(complaint("c.xml", "<calibration><fx>140</fx></calibration>"), "XML of <calibration>: expected OpenCV's"));
    EXPECT_TRUE(
        says(complaint("o.xml",
                       "<opencv_storage><camera_matrix><data>140 0 79.5 0 141</data></camera_matrix></opencv_storage>"),
             "\"camera_matrix\" has 5 numbers, expected 9"));
    EXPECT_TRUE(says(
        complaint(
            "w.xml",
            "<opencv_storage><camera_matrix><data>wide 0 79.5 0 141 5 0 0 1</data></camera_matrix></opencv_storage>"),
        "\"camera_matrix\": value 1 is not a finite number"));
    EXPECT_TRUE(says(complaint("c.json", R"({"K": [[140,0,1],[0,141,1],[79.5,59.5,1]]})"), "expected fx 0 cx"));
    EXPECT_TRUE(says(
        complaint("s.json",
                  R"({"left": {"fx": 1, "fy": 1, "cx": 1, "cy": 1}, "right": {"fx": 2, "fy": 1, "cx": 1, "cy": 1}})"),
        "2 cameras (\"left\", \"right\"), and which took the depth is not said"));
    EXPECT_TRUE(
        says(complaint("i.json", R"({"fx": 140, "fy": 141, "ppx": 79.5, "ppy": 59.5, "width": 160, "height": 120,
        "model": "distortion.inverse_brown_conrady", "coeffs": [0.1, 0, 0, 0, 0]})"),
             "lenses given by their inverse are not read"));
    EXPECT_TRUE(
        says(complaint("a.json", R"({"camera_angle_x": 1.0, "frames": []})"), "\"camera_angle_x\" alone is no camera"));
    EXPECT_TRUE(
        says(complaint("k.json", R"({"CalibrationInformation": {"Cameras": []}})"), "Azure Kinect's calibration"));
    EXPECT_TRUE(says(complaint("o.json", R"({"voxel": 1, "name": "x"})"), "both missing; it has \"name\", \"voxel\""));
    EXPECT_TRUE(says(complaint("K.npy", "\x93NUMPY"), "a NumPy array, expected text"));
    EXPECT_TRUE(says(complaint("bomb.yaml",
                               "image_width: 1\na: &a [1,1,1,1,1,1,1,1,1,1]\nb: &b [*a,*a,*a,*a,*a,*a,*a,*a,*a,*a]\n"
                               "c: &c [*b,*b,*b,*b,*b,*b,*b,*b,*b,*b]\nd0: &d [*c,*c,*c,*c,*c,*c,*c,*c,*c,*c]\ne: &e "
                               "[*d,*d,*d,*d,*d,*d,*d,*d,*d,*d]\n"
                               "f0: [*e,*e,*e,*e,*e,*e,*e,*e,*e,*e]\n"),
                     "too many values for a camera"));
    EXPECT_TRUE(says(complaint("k.txt", "fx: 140\nfy: 141\ncx: 79.5\n"), "\"cy\" is missing"));
    EXPECT_TRUE(says(complaint("u.txt", "fx: 140\nfy: \xff\x8c\ncx: 1\ncy: 1\n"), "\"fy\" is")) << "no UTF-8";
    EXPECT_TRUE(says(complaint("n.txt", "fx: 140\nfy: wide\ncx: 79.5\ncy: 1\n"), "\"fy\" is"));
    EXPECT_TRUE(says(complaint("t.txt", "Camera.fx: 140\nCamera.fx: 150\n"), "line 2: \"fx\" is there twice"));
}

} // namespace
} // namespace scanshade
