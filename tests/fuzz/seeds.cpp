// Small sound files of every format, for the fuzz targets to start from: fuzz_seeds FOLDER writes FOLDER/TARGET/NAME.
#include "io/cameras/camera_file.h"
#include "io/captures/recordings/ros/mcap_output.h"
#include "io/captures/recordings/ros/message_output.h"
#include "io/clouds/cloud_file.h"
#include "io/images/image_file.h"
#include "tests/fuzz/fuzz.h"
#include "tests/support/e57_file.h"
#include "tests/support/laz_file.h"
#include "tests/support/ros_files.h"
#include "tests/support/tar.h"

#include <array>
#include <cstdlib>
#include <cstring>
#include <opencv2/imgcodecs.hpp>
#include <zlib.h>

namespace {

namespace fs = std::filesystem;
using namespace scanshade;
using tests::raw;

fs::path root;

/// OpenCV writes EXR only where this is set when it first looks.
[[maybe_unused]] const bool exr_allowed = ::setenv("OPENCV_IO_ENABLE_OPENEXR", "1", 1) == 0;

void seed(const std::string& target, const std::string& name, const std::string& bytes) {
    fs::create_directories(root / target);
    std::ofstream(root / target / name, std::ios::binary) << bytes;
}

void images() {
    cv::Mat1w depth(4, 8, ushort(1500));
    cv::randu(depth, 500, 4000);
    cv::Mat1f metres;
    depth.convertTo(metres, CV_32F, 1e-3);
    for (const char* kind : {".png", ".pgm", ".tiff", ".exr", ".pfm", ".jpg", ".bmp", ".webp"}) {
        const std::string name(kind);
        const bool integers = name == ".png" || name == ".pgm",
                   floats = name == ".tiff" || name == ".exr" || name == ".pfm";
        const cv::Mat image = integers ? cv::Mat(depth)
                              : floats ? cv::Mat(metres)
                                       : cv::Mat(cv::Mat3b(8, 16, {9, 99, 199}));
        std::vector<uchar> bytes;
        cv::imencode(kind, image, bytes);
        seed("image", "seed" + name, {bytes.begin(), bytes.end()});
    }
    const auto pclzf = [](std::string type, std::size_t pixel_bytes) { // 8x4 pixels in LZF's literal runs of 32 bytes
        const std::string run = '\x1f' + std::string("0123456789abcdefghijklmnopqrstuv");
        std::string packed;
        for (std::size_t i = 0; i < pixel_bytes; ++i)
            packed += run;
        seed("image", type + ".pclzf",
             "PCLZF" + raw(8U) + raw(4U) + (type + std::string(16, ' ')).substr(0, 16) +
                 raw(static_cast<std::uint32_t>(packed.size())) + raw(static_cast<std::uint32_t>(32 * pixel_bytes)) +
                 packed);
    };
    const std::string header = "{'descr': '<f4', 'fortran_order': False, 'shape': (4, 8), }\n";
    seed("image", "seed.npy",
         "\x93NUMPY\x01" + std::string(1, '\0') + static_cast<char>(header.size()) + std::string(1, '\0') + header +
             std::string(4 * 4 * 8, '?'));
    pclzf("depth16", 2);
    pclzf("rgb24", 3);
    pclzf("yuv422", 2);
    pclzf("bayer8", 1);
}

void clouds() {
    const std::vector<Eigen::Vector3d> points{{0, 0, 1}, {1, 0, 1}, {0, 1, 2}};
    const std::vector<float> values{0.5F, 1, 0};
    write_new_ply(root / "ply/new.ply", points, {{1, 2, 3}, {4, 5, 6}, {7, 8, 9}}, {{"ambient_occlusion", values}});
    const std::string vertex =
        "element vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty float nx\n"
        "property float ny\nproperty float nz\nproperty list uchar int more\nproperty uchar red\n"
        "property uchar green\nproperty uchar blue\n";
    seed("mesh", "a.obj",
         "mtllib a.mtl\nv 0 0 0\nv 1 0 0 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nvn 0 0 1\nusemtl m\n"
         "f 1/1/1 2/2/1 -1/-1/-1\n");
    const std::string gltf =
        R"({"asset":{"version":"2.0"},"nodes":[{"mesh":0,"scale":[-1,1,1]}],"materials":[{"name":"m"}],"meshes":[{"primitives":[)"
        R"({"material":0,"attributes":{"POSITION":0,"TEXCOORD_0":1}}]}],"accessors":[{"bufferView":0,"componentType":5126,)"
        R"("type":"VEC3","count":3},{"bufferView":0,"byteOffset":4,"componentType":5126,"type":"VEC2","count":3}],)"
        R"("bufferViews":[{"buffer":0,"byteLength":36}],"buffers":[{"byteLength":36)";
    const std::string bin(36, '\x3f');
    std::string json = gltf + "}]}";
    json.resize((json.size() + 3) / 4 * 4, ' ');
    seed("mesh", "a.gltf", gltf + R"(,"uri":"data:;base64,Pz8/Pz8/Pz8/Pz8/Pz8/Pz8/Pz8/Pz8/Pz8/Pz8/Pz8/Pz8/"}]})");
    seed("mesh", "a.glb",
         "glTF" + raw(2U) + raw(static_cast<std::uint32_t>(28 + json.size() + bin.size())) +
             raw(static_cast<std::uint32_t>(json.size())) + "JSON" + json + raw(36U) + std::string("BIN\0", 4) + bin);
    seed("ply", "ascii.ply",
         "ply\nformat ascii 1.0\ncomment c\nobj_info num_cols 3\nobj_info num_rows 1\n" + vertex +
             "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 1 0 0 1 2 5 6 1 2 3\n"
             "1 0 1 0 0 1 0 1 2 3\nnan 0 1 0 0 1 1 7 1 2 3\n3 0 1 2\n");
    const std::string fields = "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z rgb normal_x\nSIZE 4 4 4 4 8\nTYPE F F F F F\n"
                               "COUNT 1 1 1 1 1\nWIDTH 2\nHEIGHT 1\nVIEWPOINT 0 0 1 1 0 0 0\nPOINTS 2\nDATA ";
    seed("pcd", "ascii.pcd", fields + "ascii\n1 2 3 4.2e6 0.5\nnan nan nan 0 nan\n");
    std::string body;
    for (int i = 0; i < 2; ++i)
        body += raw(1.0F) + raw(2.0F) + raw(3.0F) + raw(0x00ffeeddU) + raw(0.5);
    seed("pcd", "binary.pcd", fields + "binary\n" + body);
    const std::string packed = '\x1f' + body.substr(0, 32) + '\x0f' + body.substr(32); // LZF's literal runs
    seed("pcd", "compressed.pcd",
         fields + "binary_compressed\n" + raw(static_cast<std::uint32_t>(packed.size())) +
             raw(static_cast<std::uint32_t>(body.size())) + packed);
    seed("text_cloud", "xyz", std::string(1, '\0') + "//X Y Z R G B\n1 2 3 4 5 6\n1 2 4 5 6 7\n");
    seed("text_cloud", "pts",
         "\x01"
         "2\n1 2 3 -5 1 2 3\n1 2 4 6 1 2 3\n");
    seed("text_cloud", "ptx",
         "\x02"
         "2\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n5 6 7 1\n1 2 3 0.5\n0 0 0 0.5\n");
    seed("text_cloud", "bin", "\x03" + raw(1.0F) + raw(2.0F) + raw(3.0F) + raw(0.5F));
    seed("text_cloud", "pcd.bin", "\x04" + raw(1.0F) + raw(2.0F) + raw(3.0F) + raw(9.0F) + raw(31.0F));
}

/// LAS 1.2, point format 2, with a record that describes extra bytes.
void las() {
    std::string header(227, '\0'), record(54, '\0'), descriptor(192, '\0');
    const auto put = [](std::string& bytes, std::size_t at, const std::string& value) {
        bytes.replace(at, value.size(), value);
    };
    put(record, 2, "LASF_Spec");
    put(record, 18, raw(std::uint16_t(4)) + raw(std::uint16_t(192)));
    put(descriptor, 2, "\x09");
    put(descriptor, 4, "height");
    put(header, 0, "LASF");
    put(header, 24, "\x01\x02");
    put(header, 94,
        raw(std::uint16_t(227)) + raw(std::uint32_t(227 + 54 + 192)) + raw(std::uint32_t(1)) + "\x02" +
            raw(std::uint16_t(30)) + raw(std::uint32_t(2)));
    for (std::size_t axis = 0; axis < 3; ++axis) {
        put(header, 131 + 8 * axis, raw(0.01));
        put(header, 155 + 8 * axis, raw(1000.0));
    }
    std::string points;
    for (int i = 0; i < 2; ++i)
        points += raw(100 + i) + raw(200) + raw(300) + std::string(14, '\x07') + raw(1.5F);
    seed("las", "seed.las", header + record + descriptor + points);
}

/// Chunks of both kinds, and COPC's of varying length.
void laz_and_copc() {
    for (const int format : {3, 7})
        seed("laz", fmt::format("format{}.laz", format),
             tests::laz_file(format, laz::usual_packing(format, format == 3 ? 38 : 40), tests::twelve_records(format)));
    seed("laz", "copc.laz", tests::copc_file());
}

/// Two scans; angles and packed integers.
void e57_scans() {
    using namespace tests;
    TestScan posed = float_scan(5, 100);
    posed.before =
        "<pose type=\"Structure\"><rotation type=\"Structure\"><w type=\"Float\">0.6</w><z type=\"Float\">0.8</z>"
        "</rotation><translation type=\"Structure\"><x type=\"Float\">1</x></translation></pose>";
    seed("e57", "two.e57", e57_file({float_scan(40), posed}));
    TestScan coloured = float_scan(6);
    coloured.prototype += "<colorRed type=\"Integer\" minimum=\"0\" maximum=\"255\"/><cartesianInvalidState "
                          "type=\"Integer\" minimum=\"0\" maximum=\"2\"/>";
    Bits invalid;
    for (const unsigned state : {0U, 0U, 2U, 0U, 1U, 0U})
        invalid.add(state, 2);
    coloured.streams.insert(coloured.streams.end(), {std::string(6, 'r'), invalid.bytes()});
    seed("e57", "coloured.e57", e57_file({coloured}));
}

/// Every container of ROS, packed and not.
void ros_recordings() {
    using namespace tests;
    for (const char* packing : {"none", "bz2", "lz4"})
        seed("bag", fmt::format("{}.bag", packing), bag_of_ros1(RosMessages(false).messages(), packing, ""));
    for (const char* packing : {"", "lz4", "zstd"})
        seed("bag", fmt::format("{}.mcap", packing), mcap(RosMessages(true).messages(), packing, ""));
    for (const char* packing : {"plain", "zstd"})
        (void)sqlite(RosMessages(true).messages(), packing, root / "bag" / fmt::format("{}.db3", packing));
}

void cameras() {
    CameraFile camera;
    camera.camera = {{525, 526, 319.5, 239.5, {640, 480}}, {0.1, -0.2, 0.001, 0.002, 0}, {}};
    for (const std::string& name : camera_format_names()) {
        CameraFile each = camera;
        if (name == "open3d")
            each.camera.distortion = {};
        const fs::path file = root / "camera" / ("seed." + name);
        write_camera_file(file, each, camera_format(file, name));
    }
    camera.colour = ColourCamera{camera.camera, Eigen::Isometry3d::Identity()};
    write_camera_file(root / "camera/beside.json", camera, CameraFormat::scanshade);
    write_camera_file(root / "camera/beside.yaml", camera, CameraFormat::kalibr);
    seed("camera", "matrix.txt", "585 0 320\n0 585 240\n0 0 1\n");
    const std::string numbers = "<focal_length_x>525</focal_length_x><focal_length_y>525</focal_length_y>"
                                "<principal_point_x>320</principal_point_x><principal_point_y>240</principal_point_y>";
    seed("camera", "pcl.xml",
         "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<rgb>" + numbers + "</rgb>\n<depth>" + numbers +
             "<z_multiplication_factor>0.001</z_multiplication_factor></depth>\n");
    seed("camera", "info.txt",
         "m_depthWidth = 640\nm_depthHeight = 480\nm_depthShift = 1000\n"
         "m_calibrationDepthIntrinsic = 583 0 320 0 0 583 240 0 0 0 1 0 0 0 0 1\n");
}

void texts() {
    const std::string matrix = "1 0 0 0.5\n0 1 0 0\n0 0 1 2\n0 0 0 1\n",
                      camera = R"({"fx":2,"fy":2,"cx":0.5,"cy":0.5,"width":2,"height":2})";
    seed("trajectory", "tum", std::string(1, '\0') + "# t\n1.5 0 0 1 0 0 0 1\n1.6 0 0 1 0 0 0.7 0.7\n");
    seed("trajectory", "rows",
         "\x01"
         "0 0 1 0 0 0 1\n0 0 2 0 0 1 0\n");
    seed("trajectory", "log",
         "\x02"
         "0 0 1\n" +
             matrix + "1 1 2\n" + matrix);
    seed("trajectory", "matrix", "\x03" + matrix);
    seed("lists", "tum",
         std::string(1, '\0') +
             "# depth\n1.0 depth/1.pgm\n2.0 depth/2.pgm\n3 ../outside.pgm\n=====\n1.01 color/1.pgm\n"
             "2.01 color/2.pgm\n=====\n0.9 0 0 1 0 0 0 1\n2.1 0 0 2 0 0 0 1\n=====\n" +
             camera);
    seed("lists", "redwood",
         "\x01"
         "depth/1.pgm color/1.pgm\ncolor/2.pgm depth/2.pgm\n=====\n0 0 1\n" +
             matrix + "1 1 2\n" + matrix + "=====\n" + camera);
    seed("lists", "slam",
         "\x02"
         "0 0 1 0 0 0 1\n0 0 2 0 0 1 0\n=====\n2 0 0.5\n0 2 0.5\n0 0 1\n");
    const std::string frame =
        R"({"frame":{"index":0,"name":"000","status":"ok","why":"","fault":"none","size":[64,48],"valid":0.9,"coverage":1.0,"visibility":0.8,"camera":)" +
        camera.substr(0, camera.size() - 1) +
        R"(,"origin":"o"},"warnings":["w"],"ms":{"load":1.0,"project":0.1,"compute":2.0,"attach":0.1,"write":null},)"
        R"("passes":[["p",0.5]],"files":["ao/000.png"],"notes":["n"]},"settings":"s","stamp":"1","input":"2","sizes":[)";
    seed("job", "journal",
         std::string(1, '\0') +
             R"({"process":{"host":"h","pid":1,"device":"d","started":"2026-01-01T00:00:00Z","version":"0.1.0"}})"
             "\n" +
             frame + "10]}\n" +
             R"({"again":["001"]})"
             "\n"
             R"({"begun":"002"})"
             "\n"
             R"({"complete":"k"})"
             "\n");
    seed("job", "contradiction", std::string(1, '\0') + frame + "]}\n");
    seed("job", "plan",
         "\x01"
         R"({"program":"scanshade","version":"0.1.0","settings":{"radius":"0.4"},"tasks":1,"cost":1.0,"refused":["a"]})"
         "\n=====\n"
         R"({"capture":"/data/a","name":"a/b","first":0,"frames":2,"of":4,"cost":1.5})"
         "\n");
    seed("job", "settings",
         "\x02"
         R"({"settings":{"method":{"method":"cacao"},"method cacao":{"cacao.radius":0.3,"x":true,"y":"z"}}})"
         "\n");
}

/// What is typed, and what is shown: words of every command, the small languages of flags, a run's manifest.
void typed() {
    const std::string settings =
        R"(=====
{"settings":{"method":{"method":"cacao"},"method cacao":{"cacao.radius":0.3,"cacao.blur_passes":2}}})";
    char row = 0; // of the target's table of commands
    for (const char* line :
         {"a\nb\n--json\n--all", "capture\n--settings\nsettings.json\n-o\nout\n--radius\n0.4\n--preset\nbest",
          "data\n-o\njob\n--frames\n10:50:2", "job\n--json", "job", "out", "boards\n--board\n9x6\n--square=0.025",
          "a\nb\n-o\nc", "--generated\n-o\nreport\n--size\n64x48", "capture\n--free\nstrength,power\n-o\ncurve.json",
          "office\n-o\ncapture\n--size\n64x48\n--frames\n2", "", ""}) {
        seed("command_line", "command" + std::to_string(row), std::string(1, row) + line + "\n" + settings);
        ++row;
    }
    seed("command_line", "budget",
         "\x01"
         "a\n--max-error\n0.13\n--depth-noise\nkinect\n--depth-range\n0.3:8\n");
    seed("command_line", "cloud",
         "\x01"
         "a\n--cloud.sky\n--cloud.rays=64\n--write\nao,mcap,glb\n--shard\n2/8\n");
    const auto argument = [](char kind, const std::string& text) {
        seed("arguments", "kind" + std::to_string(kind) + "_" + std::to_string(text.size()),
             std::string{kind, '\x32'} + text);
    };
    for (const char* text : {"10:50:2", ":100", "7", "-5:", "1::2147483647"})
        argument(0, text);
    for (const char* text : {"525,525,319.5,239.5", "kinect", "tum-freiburg1", "481.2,-480,319.5,239.5"})
        argument(1, text);
    argument(2, "2/8");
    argument(3, "8,16,32.5");
    for (const char* text : {"none", "kinect", "0.001,0.002,3"})
        argument(4, text);
    for (const char* text : {"mm", "5000", "1/5000"})
        argument(5, text);
    const std::string point =
        R"({"method":"cacao","name":"high","settings":{"radius":"0.5"},"ns_per_pixel":3,"rms":0.1})";
    argument(6, R"({"device":"d","clean":{"made_by":"m","points":[)" + point + R"(],"others":[)" + point + "]}}");
    const std::string frame =
        R"({"index":0,"name":"000","status":"doubtful","why":"","fault":"none","size":[64,48],"valid_share":0.9,)"
        R"("coverage":1,"mean_visibility":0.8,"ms":{"load":1,"write":2},"warnings":["w"],"notes":["n"],"doubts":["d"],)"
        R"("files":["ao/000.png"],"world_from_camera":[1,0,0,0,0,1,0,0,0,0,1,0]})";
    const std::string manifest =
        R"({"version":"0.1.0","command_line":"run","started":"2026","device":{"name":"d","kind":"cpu","driver":"v"},)"
        R"("capture":{"path":"/a/b","kind":"tum","warnings":["<b>"],"camera":{"fx":2}},"method":"cacao","radius":"r",)"
        R"("settings":{"input":{"frames":"1:2"},"method":{"method":"cacao"}},"totals":{"took_ms":5,"slowest_stage":"load"},)"
        R"("budget":["b"],"recording_points":"x","frames":[)" +
        frame + "]}";
    seed("page", "manifest", std::string(1, '\0') + manifest);
    seed("page", "blocks", std::string(1, '\0') + manifest + "\n=====\n" + manifest);
    seed("page", "list",
         "\x01"
         "a</script>\n=====\nt<b>\n=====\nn\"\n=====\n'r\n=====\na/index.html\n=====\ns&");
    seed("page", "table",
         "\x02"
         "a,b\n=====\n\"why\"\n=====\nw\n=====\nv;");
}

void recordings() {
    const std::string header = "{'descr': '<u2', 'fortran_order': False, 'shape': (2, 4, 8), }\n",
                      array = std::string("\x93NUMPY\x01\x00", 8) + raw(static_cast<std::uint16_t>(header.size())) +
                              header + std::string(128, '\7');
    seed("recording", "stack.npy", '\0' + array);
    const std::string name = "depth.npy",
                      facts = raw<std::uint32_t>(20) + raw(0U) + raw(0U).substr(0, 2) +
                              raw(static_cast<std::uint32_t>(crc32(0, reinterpret_cast<const Bytef*>(array.data()),
                                                                   static_cast<uInt>(array.size())))) +
                              raw(static_cast<std::uint32_t>(array.size())) +
                              raw(static_cast<std::uint32_t>(array.size())) +
                              raw(static_cast<std::uint32_t>(name.size()));
    seed("recording", "stored.npz", std::string("\0PK\3\4", 5) + facts + name + array);
    const std::string runs = "\xe3"
                             "abc"
                             "\x38\x03\xf2\x06" +
                             std::string(7, '\0');
    seed("recording", "raw.lzfse", "\2bvx-" + raw(3U) + "abcbvx$");
    seed("recording", "lzvn.lzfse", "\2bvxn" + raw(15U) + raw(static_cast<std::uint32_t>(runs.size())) + runs + "bvx$");
    seed("recording", "depth.bin", "\1" + raw(4U) + "\x1f\7\7\1");
    const std::string depth(16, '\5'), time("\xE7\x81\x07", 3),
        block = "\xA3\x94\x82" + std::string("\0\1\x80", 3) + depth,
        group = "\xA0\x96\xA1\x94\x82" + std::string("\0\2\0", 3) + depth;
    seed("matroska", "sized", std::string(1, '\0') + "\x1F\x43\xB6\x75\xB1" + time + block + group);
    seed("matroska", "unsized",
         std::string(1, '\0') + "\x1F\x43\xB6\x75\xFF" + time + block + "\x1F\x43\xB6\x75\xFF" + time + group);
    seed("matroska", "attached",
         std::string(1, '\0') + "\x19\x41\xA4\x69\x9C\x61\xA7\x99\x46\x6E\x90" + "calibration.json" + "\x46\x5C\x82{}" +
             "\x1F\x43\xB6\x75\x99" + time + block);
}

void colmap() {
    const auto pose = [](double x) {
        return raw(1.0) + raw(0.0) + raw(0.0) + raw(0.0) + raw(x) + raw(0.0) + raw(0.0) + raw(1U);
    };
    seed("colmap", "images.txt",
         std::string(1, '\0') + "# list\n1 1 0 0 0 0 0 0 1 a.pgm\n0.5 0.5 -1\n2 1 0 0 0 0 0 1 1 "
                                "../../../outside.pgm\n\n");
    seed("colmap", "cameras.txt", "\1# list\n1 OPENCV 2 2 2 2 1 1 0.1 0 0 0\n2 SIMPLE_PINHOLE 2 2 2 1 1\n");
    seed("colmap", "depth",
         "\2"
         "2&2&1&" +
             raw(1.0F) + raw(2.0F) + raw(0.0F) + raw(-1.0F));
    seed("colmap", "images.bin",
         '\3' + raw(std::uint64_t(2)) + raw(1U) + pose(0) + "a.pgm" + '\0' + raw(std::uint64_t(1)) +
             std::string(24, '\1') + raw(2U) + pose(1) + "b/c.pgm" + '\0' + raw(std::uint64_t(0)));
    seed("colmap", "cameras.bin",
         '\4' + raw(std::uint64_t(1)) + raw(1U) + raw(1U) + raw(std::uint64_t(2)) + raw(std::uint64_t(2)) + raw(2.0) +
             raw(2.0) + raw(1.0) + raw(1.0));
    seed("image", "seed.geometric.bin", "2&2&1&" + raw(1.0F) + raw(2.0F) + raw(0.0F) + raw(-1.0F));
}

/// HDF5 of one data set, 2x3 floats: as they are, and deflated in a chunk of a tree. Checksums are not looked at.
void hdf5() {
    const std::string nowhere = raw(~std::uint64_t(0));
    const auto message = [](int type, const std::string& data) {
        return static_cast<char>(type) + raw(static_cast<std::uint16_t>(data.size())) + '\0' + data;
    };
    const auto object = [](const std::string& messages) {
        return std::string("OHDR\2\0", 6) + static_cast<char>(messages.size()) + messages + raw(0U);
    };
    const std::string data = raw(1.F) + raw(2.F) + raw(3.F) + raw(4.F) + raw(5.F) + raw(6.F);
    std::string packed(compressBound(data.size()), '\0');
    uLongf size = packed.size();
    compress(reinterpret_cast<Bytef*>(packed.data()), &size, reinterpret_cast<const Bytef*>(data.data()), data.size());
    packed.resize(size);
    const std::string shape = std::string("\2\2\0\1", 4) + raw(std::uint64_t(2)) + raw(std::uint64_t(3)),
                      type = std::string("\x11\x20\x1f\0", 4) + raw(4U) + std::string("\0\0\x20\0\x17\x08\0\x17", 8) +
                             raw(127U);
    const auto file = [&](const std::string& filters, const auto& layout_at, const auto& elements_at) {
        constexpr std::size_t superblock = 48;
        const auto link = [](std::uint64_t at) { return std::string("\1\0\7dataset", 10) + raw(at); };
        const std::uint64_t header = superblock + object(message(6, link(0))).size();
        const auto set = [&](std::uint64_t at) {
            return object(message(1, shape) + message(3, type) + filters + message(8, layout_at(at)));
        };
        const std::uint64_t elements = header + set(0).size();
        return std::string("\x89HDF\r\n\x1a\n\2\x08\x08\0", 12) + raw(std::uint64_t(0)) + nowhere + nowhere +
               raw(std::uint64_t(superblock)) + raw(0U) + object(message(6, link(header))) + set(elements) +
               elements_at(elements);
    };
    seed("hdf5", "contiguous.h5",
         file(
             "", [&](std::uint64_t at) { return "\3\1" + raw(at) + raw(std::uint64_t(data.size())); },
             [&](std::uint64_t) { return data; }));
    const std::uint64_t node = 24 + 40 + 32; // header, a key with its child, the last key
    seed("hdf5", "deflated.h5",
         file(
             message(11, std::string("\2\1\1\0\0\0\0\0", 8)),
             [&](std::uint64_t at) { return "\3\2\3" + raw(at) + raw(2U) + raw(3U) + raw(4U); },
             [&](std::uint64_t at) {
                 return "TREE" + std::string("\1\0\1\0", 4) + nowhere + nowhere +
                        raw(static_cast<std::uint32_t>(size)) + raw(0U) + std::string(24, '\0') + raw(at + node) +
                        std::string(32, '\0') + packed;
             }));
}

/// A recording of an earlier run, and a group of it by itself.
void groups() {
    const std::string type = "std_msgs/msg/String", group = ros::packed_group("frame", {{1, 1, 5, "message"}});
    const fs::path file = root / "groups" / "run.mcap";
    fs::create_directories(file.parent_path());
    ros::McapOutput output(file, "seed", {{"/a", type, ros::definition_of(type)}});
    output.add(group);
    output.finish();
    seed("groups", "group", group);
}

void tars() {
    using namespace tests;
    seed("tar", "plain", tar_member("camera.json", "{}") + tar_member("a.depth.png", "x") + tar_end());
    seed("tar", "long",
         tar_member("L", "long/name", 'L') + tar_member("l", "x") + tar_pax({{"path", "pax/name"}, {"size", "1"}}) +
             tar_member("p", "y") + tar_end());
    seed("tar", "links",
         tar_member("a/real", "x") + tar_header("soft", 0, '2', "a/real") + tar_header("hard", 0, '1', "a/real") +
             tar_header("d/", 0, '5') + tar_header("huge", std::uint64_t(1) << 60));
}

} // namespace

int main(int count, char** words) {
    if (count != 2)
        return 1;
    root = words[1];
    images();
    clouds();
    las();
    laz_and_copc();
    e57_scans();
    ros_recordings();
    cameras();
    texts();
    typed();
    recordings();
    colmap();
    hdf5();
    groups();
    tars();
    return 0;
}
