// What is no capture is refused with its cause: the format by name, what a folder holds, and what helps.
#include "io/captures/capture.h"
#include "tests/support/files.h"
#include "tests/support/made_recording.h"

#include <gtest/gtest.h>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using namespace tests;

struct ForeignFile {
    const char* name;
    const char* bytes;
    const char* says;
};
void PrintTo(const ForeignFile& row, std::ostream* to) { *to << row.name; }

class ForeignFiles : public testing::TestWithParam<ForeignFile> {};

TEST_P(ForeignFiles, are_refused_by_name_alone_and_in_a_folder) {
    const TemporaryFolder folder;
    const ForeignFile& row = GetParam();
    const fs::path file = write_file(folder / row.name, row.bytes);
    EXPECT_TRUE(says(refusal([&] { (void)open_capture(file); }), file.string() + ": " + row.says));
    const std::string of_folder = refusal([&] { (void)open_capture(folder.path()); });
    EXPECT_TRUE(says(of_folder, "no frames found in"));
    EXPECT_TRUE(says(of_folder, std::string("\n  ") + row.name + ": " + row.says));
}

INSTANTIATE_TEST_SUITE_P(Of, ForeignFiles,
                         testing::Values(ForeignFile{"m.stl", "solid box\nfacet normal 0 0 1\n",
                                                     "a mesh in STL, which is not read: meshes are read from PLY"},
                                         ForeignFile{"m.STL", "solid box\n", "a mesh in STL"},
                                         ForeignFile{"b.stl", "binary\1\2\3", "a mesh in STL"},
                                         ForeignFile{"m.off", "OFF\n8 6 12\n", "a mesh in OFF"},
                                         ForeignFile{"m.fbx", "Kaydara FBX Binary", "a scene in FBX"},
                                         ForeignFile{"s.sog", "\1\2\3", "Gaussian splats in SOG"},
                                         ForeignFile{"s.ksplat", "\1\2\3", "Gaussian splats in .ksplat"},
                                         ForeignFile{"r.svo2", "\1\2\3", "a recording of a ZED camera"},
                                         ForeignFile{"r.oni", "NI10\1", "a recording of OpenNI"},
                                         ForeignFile{"l.pcap", "\1\2\3", "a lidar's network packets"},
                                         ForeignFile{"s.fls", "\1\2\3",
                                                     "a scan of FARO, which is not read: export it as E57"},
                                         ForeignFile{"v.mp4", "\1ftyp", "a video, which is not read"},
                                         ForeignFile{"d.raw", "\1\2\3", "bare numbers without a size"}),
                         [](const auto& info) {
                             std::string name = info.param.name;
                             std::ranges::replace(name, '.', '_');
                             return name;
                         });

TEST(NearMisses, of_folders_tell_why_their_texts_are_no_clouds) {
    const auto complaint = [&](const char* name, const std::string& text, bool beside) {
        const TemporaryFolder folder;
        write_file(folder / name, text);
        if (beside)
            write_file(folder / "notes.md", "hello\n");
        return refusal([&] { (void)open_capture(folder.path()); });
    };
    std::string points;
    for (int k = 0; k < 16; ++k)
        points += std::to_string(7 * k % 4) + "," + std::to_string(7 * k / 4 % 4) + ",1\n";
    EXPECT_EQ(complaint("c.csv", "x,y,z\n" + points, false), "") << "nothing but tables: clouds";
    EXPECT_TRUE(says(complaint("c.csv", "x,y,z\n" + points, true),
                     "c.csv: points as text, beside other files: give the file itself"));
    EXPECT_TRUE(says(complaint("c.txt", "pt0 1 2 3\npt1 1 2 3\n", false),
                     "c.txt: text that begins with \"pt0 1 2 3\": no cloud"));
    EXPECT_TRUE(says(complaint("c.txt", "lat lon alt\n48 11 500\n", false), "latitudes and longitudes are no lengths"));
}

TEST(NearMisses, of_files_tell_text_json_and_what_is_unknown) {
    const TemporaryFolder folder;
    const auto complaint = [&](const char* name, const std::string& bytes) {
        return refusal([&] { (void)open_capture(write_file(folder / name, bytes)); });
    };
    EXPECT_TRUE(says(complaint("notes.md", "hello\nworld\n"),
                     "text that begins with \"hello\": no cloud, which is eight lines"));
    EXPECT_TRUE(says(complaint("c.json", "{\"fx\": 1}"),
                     "JSON: no capture by itself. Give the folder that it lies in, or a camera "
                     "with --camera"));
    EXPECT_TRUE(
        says(complaint("x.dat", std::string("\0\1\2\3", 4)), "as no recording, depth image or cloud that is known"));
    EXPECT_TRUE(says(complaint("nothing.dat", ""), "empty file (0 bytes)"));
    EXPECT_TRUE(says(complaint("mesh", "OFF\n8 6 12\n"), "a mesh in OFF")) << "by how it begins";
    for (const char* name : {"notes.md", "x.dat"})
        EXPECT_TRUE(says(complaint(name, "hello"), "`scanshade help formats`"));
}

TEST_F(Made, folders_without_frames_say_what_they_hold_and_why_that_is_none) {
    const auto complaint = [&] { return refusal([&] { (void)open_capture(folder.path()); }); };
    EXPECT_TRUE(says(complaint(), "it holds no files; a capture has depth/ or depth.txt"));
    colour("left01.jpg", {16, 12});
    colour("left02.jpg", {16, 12});
    const std::string of_pictures = complaint();
    EXPECT_TRUE(says(of_pictures, "it holds 2 files (2 .jpg)"));
    EXPECT_TRUE(says(of_pictures, "left01.jpg and 1 more image (JPEG of 8 bits, 3 channels): a picture"));
    EXPECT_TRUE(says(of_pictures, "`scanshade refine --board COLUMNSxROWS`"));
    fs::create_directories(folder / "depth");
    EXPECT_TRUE(says(complaint(), "\n  depth/: it is empty"));
    colour("depth/0.jpg", {16, 12});
    EXPECT_TRUE(says(complaint(), "\n  depth/0.jpg (JPEG of 8 bits, 3 channels): a picture, also of depth in colours"));
    for (const char* name : {"a.off", "b.off", "c.stl", "d.mp4", "e.pcap"})
        text(name, "some");
    const std::string full = complaint();
    EXPECT_TRUE(says(full, "it holds 7 files (2 .jpg, 2 .off, 1 .mp4, 1 .pcap, 1 .stl)"));
    EXPECT_EQ(std::ranges::count(full, '\n'), 4) << "three reasons, and where to look: " << full;
    EXPECT_EQ(full.find("b.off"), std::string::npos) << "one of a kind is enough";
}

TEST_F(Made, grey_pictures_are_too_coarse_for_depth) {
    picture("0.png", cv::Mat1b(6, 8, uchar(7)));
    EXPECT_TRUE(says(refusal([&] { (void)open_capture(folder.path()); }),
                     "0.png (PNG of 8 bits, 1 channel): 8 bits are too few for distances"));
}

// --- RealSense Viewer's snapshots ---

constexpr const char* table = "Stream,Depth\nFormat,Z16\nResolution x,8\nResolution y,6\nBytes per pixel,2\n"
                              "Intrinsics:,\nFx,10\nFy,11\nPPx,3.5\nPPy,2.5\n";

TEST_F(Made, viewer_snapshots_are_read_by_their_tables) {
    std::string raw(2UL * 8 * 6, '\0');
    raw[2 * 9] = '\xb8'; // 3000 at (1, 1)
    raw[2 * 9 + 1] = '\x0b';
    text("wall_Depth.raw", raw);
    text("wall_Depth_metadata.csv", table);
    colour("wall_Depth.png", {8, 6});
    text("wall_Color.raw", std::string(3UL * 8 * 6, '\1'));
    text("wall_Color_metadata.csv", "Stream,Color\nFormat,RGB8\nResolution x,8\nResolution y,6\n");
    const Capture capture = open_capture(folder.path());
    EXPECT_EQ(capture.kind, "RealSense Viewer snapshot");
    ASSERT_EQ(capture.entries.size(), 1U);
    const Frame frame = capture.load(0);
    EXPECT_EQ(frame.name, "wall_Depth");
    EXPECT_EQ(frame.depth_m(1, 1), 3);
    EXPECT_EQ(frame.depth_m(0, 0), 0);
    expect_camera(frame, 10, 11, 3.5, 2.5);

    text("wall_Depth.raw", raw + "x");
    EXPECT_TRUE(
        says(refusal([&] { (void)open_capture(folder.path()).load(0); }), "more than 96 bytes, expected 96 for 8x6"));
    text("wall_Depth.raw", "x");
    EXPECT_TRUE(says(refusal([&] { (void)open_capture(folder.path()).load(0); }), "1 byte, expected 96 for 8x6"));
    text("wall_Depth_metadata.csv", "Stream,Depth\nFormat,Z16\n");
    EXPECT_TRUE(says(refusal([&] { (void)open_capture(folder.path()); }), "no \"Resolution x\" and \"Resolution y\""));
    text("wall_Depth_metadata.csv", "Stream,Depth\nFormat,Z16\nResolution x,4000000000\nResolution y,4000000000\n");
    EXPECT_FALSE(refusal([&] { (void)open_capture(folder.path()); }).empty());
}

} // namespace
} // namespace scanshade
