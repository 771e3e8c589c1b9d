// Inputs that would do harm: that ask for more than they hold, lead out of their folder, or never end. What the fuzz
// targets (tests/fuzz) found stays here as rows.
#include "io/cameras/camera_file.h"
#include "io/captures/capture.h"
#include "io/captures/listing/layouts.h"
#include "io/captures/listing/trajectory.h"
#include "io/clouds/cloud_file.h"
#include "io/images/image_file.h"
#include "io/text.h"
#include "tests/support/files.h"
#include "tests/support/png.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>
#include <sys/resource.h>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using namespace tests;

class Hostile : public ::testing::Test {
  protected:
    [[nodiscard]] std::string camera_refusal(const std::string& text) const {
        const fs::path file = write_file(folder / "camera", text);
        return refusal([&] { (void)read_camera_file(file); });
    }
    [[nodiscard]] std::string cloud_refusal(const std::string& name, const std::string& bytes) const {
        const fs::path file = write_file(folder / name, bytes);
        std::vector<std::string> warnings;
        return refusal([&] { (void)read_cloud(file, warnings); });
    }
    /// A capture in TUM's layout whose depth.txt names these files.
    void list(const std::vector<std::string>& names) const {
        std::string lines;
        for (std::size_t i = 0; i < names.size(); ++i)
            lines += fmt::format("{}.5 {}\n", i, names[i]);
        write_file(folder / "capture/depth.txt", lines);
    }
    [[nodiscard]] Capture capture() const { return open_capture(folder / "capture"); }

    const TemporaryFolder folder;
    const std::string image = "P5 2 2 65535\n12345678";
};

// ---------------------------------------------------------------------------------------------------- paths

TEST_F(Hostile, names_in_lists_lead_nowhere_but_into_the_capture) {
    write_file(folder / "outside.pgm", image);
    write_file(folder / "capture/depth/1.pgm", image);
    write_file(folder / "capture2/1.pgm", image); // a neighbour whose name starts alike
    fs::create_symlink("loop.pgm", folder / "capture/depth/loop.pgm");
    const std::vector<std::string> bad = {"../outside.pgm",
                                          "depth/../../outside.pgm",
                                          "depth/./.././../outside.pgm",
                                          (folder / "outside.pgm").string(),
                                          (folder / "capture/depth/1.pgm").string(),
                                          "//" + (folder / "outside.pgm").string(),
                                          "../capture2/1.pgm",
                                          "depth/loop.pgm",
                                          std::string("depth/1.pgm\0/../../..", 21),
                                          "depth",
                                          ".",
                                          ".."};
    const std::vector<std::string> good = {"depth/1.pgm", "./depth//1.pgm", "depth/../depth/1.pgm",
                                           "../capture/depth/1.pgm"};
    list(bad);
    for (const CaptureEntry& entry : capture().entries)
        EXPECT_NE(entry.problem, "") << entry.depth;
    EXPECT_TRUE(says(capture().entries[0].problem, "leaves the capture's folder"));
    list({good.begin(), good.end() - 1});
    for (const CaptureEntry& entry : capture().entries)
        EXPECT_EQ(entry.problem, "");
    list({good.back()}); // comes back in by its own name: refused all the same, for the folder may be renamed
    EXPECT_TRUE(says(capture().entries[0].problem, "leaves"));
}

TEST_F(Hostile, links_are_followed_since_whoever_made_the_folder_put_them_there) {
    write_file(folder / "store/7f3a", image);
    write_file(folder / "store/more/1.pgm", image);
    fs::create_directories(folder / "capture/depth");
    fs::create_symlink(folder / "store/7f3a", folder / "capture/depth/1.pgm");
    fs::create_symlink("../../store/7f3a", folder / "capture/depth/2.pgm");
    fs::create_symlink("1.pgm", folder / "capture/depth/inside.pgm");
    fs::create_directory_symlink(folder / "store/more", folder / "capture/more");
    list({"depth/1.pgm", "depth/2.pgm", "depth/inside.pgm", "more/1.pgm"});
    const Capture linked = capture();
    for (std::size_t i = 0; i < linked.entries.size(); ++i) {
        EXPECT_EQ(linked.entries[i].problem, "") << linked.entries[i].depth;
        EXPECT_NO_THROW((void)linked.load(i)) << linked.entries[i].depth;
    }
}

TEST_F(Hostile, a_capture_may_be_reached_through_a_link) {
    write_file(folder / "real/depth/1.pgm", image);
    write_file(folder / "real/depth.txt", "1 depth/1.pgm\n");
    fs::create_directory_symlink(folder / "real", folder / "capture");
    EXPECT_EQ(capture().entries[0].problem, "");
}

TEST_F(Hostile, names_of_frames_become_names_of_files_in_the_output_folder) {
    const std::vector<std::string> names = {"..",
                                            ".",
                                            "",
                                            ".hidden",
                                            "a/b",
                                            "a\\b",
                                            "a\nb",
                                            "\x1b[2J",
                                            "caf\xe9",
                                            "caf\xc3\xa9",
                                            std::string(1000, 'x'),
                                            ".x.tmp-1-2"};
    std::vector<CaptureEntry> entries;
    for (const std::string& name : names)
        entries.emplace_back().name = name;
    settle_names(entries);
    std::set<std::string> taken;
    for (const CaptureEntry& entry : entries) {
        EXPECT_TRUE(taken.insert(entry.name).second) << entry.name;
        EXPECT_EQ(fs::path(entry.name).filename(), entry.name);
        EXPECT_NE(entry.name[0], '.');
        EXPECT_EQ(as_utf8(entry.name), entry.name) << "a journal holds names as JSON";
        EXPECT_EQ(std::ranges::count_if(entry.name, [](char c) { return static_cast<unsigned char>(c) < ' '; }), 0);
        write_file(folder / ("." + entry.name + ".tmp-4194304-1000000.tiff"), "");
    }
    EXPECT_EQ(entries[9].name, "caf\xc3\xa9") << "what is fit stays";
}

TEST_F(Hostile, a_name_listed_a_hundred_thousand_times_is_numbered_at_once) {
    std::vector<CaptureEntry> entries(100'000); // counting up from 2 for each would take 5e9 steps
    settle_names(entries);
    EXPECT_EQ(entries[0].name, "frame");
    EXPECT_EQ(entries.back().name, "frame-100000");
}

TEST_F(Hostile, utf8_is_distinguished_from_similar_bytes) {
    for (const char* sound : {"", "a", "\xc3\xa9", "\xe2\x82\xac", "\xf0\x9f\x98\x80"})
        EXPECT_EQ(as_utf8(sound), sound);
    EXPECT_EQ(as_utf8("\xe9t\xe9"), "_t_");
    EXPECT_EQ(as_utf8("\xc0\xaf"), "__") << "an overlong slash";
    EXPECT_EQ(as_utf8("\xed\xa0\x80"), "___") << "half of a surrogate pair";
    EXPECT_EQ(as_utf8("\xf4\x90\x80\x80"), "____") << "beyond the last code point";
    EXPECT_EQ(as_utf8("a\xe2\x82"), "a__");
}

TEST_F(Hostile, a_plan_follows_circular_links_once_and_reports_names_it_cannot_hold) {
    if (!program_is_built())
        GTEST_SKIP() << "the program is not built";
    write_capture(folder / "data/a/b", 1);
    write_capture(folder / "data/caf\xe9", 1);
    for (const char* link : {"data/back", "data/a/back", "data/a/again"})
        fs::create_directory_symlink(folder / "data", folder / link);
    const Ran ran = run_program(fmt::format("plan {} -o {}", (folder / "data").string(), (folder / "job").string()));
    EXPECT_EQ(ran.exit_code, 2) << ran.err;
    EXPECT_TRUE(says(ran.err, "caf_: the name is not UTF-8"));
    EXPECT_TRUE(says(ran.out, "1  frames in 1 tasks"));
}

// ---------------------------------------------------------------------------------------------------- memory

/// What the reader may take while it makes up its mind.
class LittleMemory {
  public:
    LittleMemory() {
        getrlimit(RLIMIT_AS, &before_);
        rusage used{};
        getrusage(RUSAGE_SELF, &used);
        std::ifstream statm("/proc/self/statm");
        rlim_t pages = 0;
        statm >> pages;
        const rlimit little{pages * 4096 + (64 << 20), before_.rlim_max};
        setrlimit(RLIMIT_AS, &little);
    }
    ~LittleMemory() { setrlimit(RLIMIT_AS, &before_); }
    LittleMemory(const LittleMemory&) = delete;
    LittleMemory& operator=(const LittleMemory&) = delete;

  private:
    rlimit before_{};
};

TEST_F(Hostile, small_images_do_not_ask_for_large_ones) {
    const auto refused = [&](const std::string& bytes) {
        const fs::path file = write_file(folder / "image", bytes);
        const LittleMemory little;
        return refusal([&] { (void)read_stored_depth(file); });
    };
    const auto colour_refused = [&](const std::string& bytes) {
        const fs::path file = write_file(folder / "image", bytes);
        const LittleMemory little;
        return refusal([&] { (void)read_colour(file); });
    };
    EXPECT_EQ(refused(png(8, 4, 16, 0, 4)), "");
    EXPECT_TRUE(says(refused(png(16000, 16000, 16, 0, 4)), "cannot become 16000x16000 pixels"));
    std::vector<uchar> encoded;
    cv::imencode(".tiff", cv::Mat1w(4, 8, ushort(7)), encoded, {cv::IMWRITE_TIFF_COMPRESSION, 1});
    std::string tiff(encoded.begin(), encoded.end());
    for (const unsigned tag : {0x100U, 0x101U}) { // width and height, stored as SHORT
        const std::string entry = {static_cast<char>(tag), '\1', '\3', '\0', '\1', '\0', '\0', '\0'};
        const auto at = tiff.find(entry);
        ASSERT_NE(at, std::string::npos);
        tiff.replace(at + 8, 2, "\x80\x3e"); // 16000
    }
    EXPECT_TRUE(says(refused(tiff), "cannot become 16000x16000 pixels"));
    encoded.clear();
    cv::imencode(".jpg", cv::Mat3b(8, 16, {9, 99, 199}), encoded);
    std::string jpeg(encoded.begin(), encoded.end());
    const auto frame = jpeg.find("\xff\xc0");
    ASSERT_NE(frame, std::string::npos);
    jpeg.replace(frame + 5, 4, "\x3e\x80\x3e\x80");
    EXPECT_TRUE(says(colour_refused(jpeg), "cannot become 16000x16000 pixels"));
    const auto bmp = [](const std::string& width, const std::string& height) {
        return "BM" + std::string(12, '\0') + "\x28" + std::string(3, '\0') + width + height + std::string(28, '\0');
    };
    EXPECT_TRUE(says(colour_refused(bmp(std::string("\0\0\1\0", 4), std::string("\0\0\1\0", 4))), "2^28"));
    EXPECT_TRUE(says(colour_refused(bmp("\xff\xff\xff\xff", std::string("\1\0\0\0", 4))), "at least 1x1"));
    EXPECT_TRUE(says(colour_refused("GIF89a and so on"), "neither PNG"));
    std::vector<uchar> pfm;
    cv::imencode(".pfm", cv::Mat1f(2, 2, 0.5F), pfm);
    EXPECT_TRUE(says(colour_refused({pfm.begin(), pfm.end()}), "floats"));
}

TEST_F(Hostile, files_larger_than_memory_are_refused_unread) {
    for (const char* name : {"a.las", "a.ply", "a.pcd", "a.xyz", "a.bin"}) {
        const fs::path file = write_file(folder / name, std::string(name) == "a.las" ? "LASF" : "ply\n");
        fs::resize_file(file, std::uintmax_t(1) << 42); // a hole of 4 TiB
        std::vector<std::string> warnings;
        EXPECT_TRUE(says(refusal([&] { (void)read_cloud(file, warnings); }), "more than this machine's memory"))
            << name;
    }
    const fs::path image_file = write_file(folder / "d.png", png(8, 4, 16, 0, 4));
    fs::resize_file(image_file, std::uintmax_t(1) << 32);
    EXPECT_TRUE(
        says(refusal([&] { (void)read_stored_depth(image_file); }), "4294967296 bytes, too large for an image"));
}

TEST_F(Hostile, lists_have_an_end) {
    write_file(folder / "capture/depth/1.pgm", image);
    write_file(folder / "capture/depth.txt", std::string((1 << 22) + 1, '\n'));
    EXPECT_TRUE(says(refusal([&] { (void)capture(); }), "more than 4194304 lines"));
    write_file(folder / "capture/depth.txt", "1 depth/1.pgm\n2 " + std::string(1 << 14, 'x') + "\n");
    EXPECT_TRUE(says(refusal([&] { (void)capture(); }), "depth.txt line 2: 16386 bytes, expected at most 8192"));
    fs::resize_file(folder / "capture/depth.txt", (1 << 28) + 1);
    EXPECT_TRUE(says(refusal([&] { (void)capture(); }), "268435457 bytes, too large for a list"));
}

// ---------------------------------------------------------------------------------------------------- depth

std::string repeated(const std::string& text, int times) {
    std::string all;
    for (int i = 0; i < times; ++i)
        all += text;
    return all;
}

TEST_F(Hostile, deep_nesting_is_refused_before_anything_recurses_into_it) {
    const int deep = 100'000;
    for (const std::string& text : {"{\"fx\":" + repeated("[", deep) + repeated("]", deep) + "}",
                                    "{\"fx\":" + repeated("{\"a\":", deep) + "1" + repeated("}", deep) + "}"})
        EXPECT_TRUE(says(camera_refusal(text), "nested deeper than 64 levels"));
    for (const std::string& text :
         {"%YAML:1.0\ncamera_matrix: " + repeated("[", deep), "camera_matrix: " + repeated("{a: ", deep),
          "camera_matrix:\n  " + repeated("- ", deep) + "1\n", "cam0: " + repeated("a: ", deep) + "1\n",
          "camera_matrix:\n" + repeated(" ", deep) + "- 1\n"})
        EXPECT_NE(camera_refusal(text), "") << text.substr(0, 40);
    for (const char* text : {"-----h\nh\ncamera_matrix:", "camera_matrix:\n--------{\n\"\\u--{\n\"\\u",
                             "cam0:\n  camera_model: pinhole\n  : [0.1, -0.2]\n", "cam0: 3\n", "cam0: [1, 2]\n",
                             "cam0: &a [*a]\n", "camera_matrix: &a {data: *a}\n"})
        EXPECT_NE(camera_refusal(text), "") << text; // OpenCV's parser never came back from the first two
    if (!program_is_built())
        GTEST_SKIP() << "the program is not built";
    const fs::path settings =
        write_file(folder / "s.json",
                   "{\"settings\":{\"method\":{\"radius\":" + repeated("[", deep) + repeated("]", deep) + "}}}");
    const Ran ran = run_program(fmt::format("run {} -o {} --settings {}", folder.path().string(),
                                            (folder / "out").string(), settings.string()));
    EXPECT_EQ(ran.exit_code, 1);
    EXPECT_TRUE(says(ran.err, "nested deeper than 64 levels"));
}

// ---------------------------------------------------------------------------------------------------- what was found

TEST_F(Hostile, lists_named_like_coordinates_are_not_read_as_such) {
    // An empty list has no first value: reading one went past the end of the file.
    const std::string start = "ply\nformat binary_little_endian 1.0\nelement vertex 1\n",
                      place = "property float x\nproperty float y\nproperty float z\n", twelve(12, '\0');
    for (const std::string& lists : std::vector<std::string>{
             "property list uchar double x\n", "property list uchar double nx\nproperty float ny\nproperty float nz\n",
             "property list uchar double ambient_occlusion\n"}) {
        std::string body = twelve;
        body.append(lists.find("ny") == std::string::npos ? 1 : 9, '\0');
        const fs::path file =
            write_file(folder / "a.ply", fmt::format("{}{}{}end_header\n{}", start, place, lists, body));
        std::vector<std::string> warnings;
        const Cloud cloud = read_cloud(file, warnings);
        EXPECT_EQ(cloud.points, std::vector<Eigen::Vector3d>{Eigen::Vector3d::Zero()});
        EXPECT_TRUE(recorded_normals(cloud).empty());
        EXPECT_TRUE(says(refusal([&] { (void)recorded_field(cloud, "ambient_occlusion", file); }), "no field"));
    }
    EXPECT_TRUE(
        says(cloud_refusal("b.ply", start + "property list uchar double x\nproperty float y\nproperty float z\n" +
                                        "end_header\n" + std::string(9, '\0')),
             "no property x"));
}

} // namespace
} // namespace scanshade
