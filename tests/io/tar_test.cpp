// Captures in tars: read in place like folders; hostile and cut archives; WebDataset's samples.
#include "io/captures/capture.h"
#include "io/content_hash.h"
#include "io/files.h"
#include "io/tar_index.h"
#include "io/text.h"
#include "tests/support/files.h"
#include "tests/support/tar.h"

#include <cstdlib>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using tests::refusal;
using tests::says;
using tests::tar_end;
using tests::tar_header;
using tests::tar_member;
using tests::tar_of;
using tests::tar_pax;
using tests::warned;
using tests::write_file;

class Tar : public testing::Test {
  protected:
    fs::path tar(const std::string& bytes) const { return write_file(folder / fmt::format("{}.tar", count_++), bytes); }
    static std::string text(const fs::path& path) { return read_bytes(path); }
    std::string depth_png(int index) const {
        std::vector<uchar> bytes;
        cv::Mat1w image(48, 64, static_cast<ushort>(1000 + index));
        cv::imencode(".png", image, bytes);
        return {bytes.begin(), bytes.end()};
    }
    const tests::TemporaryFolder folder;
    mutable int count_ = 0;
};

TEST_F(Tar, a_capture_is_the_same_in_a_tar) {
    tests::write_capture(folder / "capture", 3);
    const fs::path packed = tar(tar_of(folder / "capture"));
    const Capture plain = open_capture(folder / "capture"), read = open_capture(packed);
    EXPECT_EQ(read.kind, plain.kind);
    ASSERT_EQ(read.entries.size(), 3u);
    for (std::size_t i = 0; i < 3; ++i) {
        const Frame a = plain.load(i), b = read.load(i);
        EXPECT_EQ(a.name, b.name);
        EXPECT_EQ(cv::norm(a.depth_m, b.depth_m, cv::NORM_INF), 0);
        EXPECT_EQ(cv::norm(a.colour, b.colour, cv::NORM_INF), 0);
        EXPECT_EQ(content_hash_of(plain.entries[i]), content_hash_of(read.entries[i]));
    }
}

TEST_F(Tar, a_folder_in_a_tar_and_a_tar_in_a_folder_are_opened) {
    tests::write_capture(folder / "data/capture", 2);
    const fs::path packed = write_file(folder / "set/one.tar", tar_of(folder / "data"));
    EXPECT_EQ(open_capture(packed / "capture").entries.size(), 2u);
    EXPECT_EQ(open_capture_at_or_below(packed).entries.size(), 2u);
    fs::remove(packed);
    write_file(folder / "set/one.tar", tar_of(folder / "data/capture"));
    EXPECT_EQ(open_capture_at_or_below(folder / "set").entries.size(), 2u);
}

TEST_F(Tar, every_way_to_write_a_long_name_is_read) {
    const std::string part(90, 'n'), long_name = part + "/" + part + "/" + part + "/x.txt";
    const fs::path file = tar(tar_member("././@LongLink", long_name + '\0', 'L') + tar_member(part, "gnu") +
                              tar_pax({{"path", "p/" + long_name}, {"mtime", "1.5"}}) + tar_member("short", "pax") +
                              tar_header("x.txt", 5, '0', "", part) + tests::tar_padded("ustar") +
                              tar_member("./a//b/./c.txt", "plain") + tar_end());
    EXPECT_EQ(text(file / long_name), "gnu");
    EXPECT_EQ(text(file / "p" / long_name), "pax");
    EXPECT_EQ(text(file / part / "x.txt"), "ustar");
    EXPECT_EQ(text(file / "a/b/c.txt"), "plain");
    EXPECT_EQ(text(file / "a" / "." / "b" / "c.txt"), "plain");
    EXPECT_TRUE(is_folder(file / "a/b"));
    EXPECT_FALSE(is_there(file / "a/x"));
    EXPECT_FALSE(is_there(file / ".." / file.filename() / ".." / "a"));
    EXPECT_TRUE(oddities_of_tar(file).empty());
}

TEST_F(Tar, a_folder_lists_its_own_items_once) {
    const fs::path file =
        tar(tar_header("a/", 0, '5') + tar_member("a/2", "") + tar_member("a-b", "") + tar_member("a/1/x", "") +
            tar_member("a/1/y", "") + tar_member("a.b", "") + tar_header("empty/", 0, '5') + tar_end());
    std::error_code trouble;
    const auto names = [&](const fs::path& at) {
        std::string all;
        for (const auto& [name, kind] : items_in(at, trouble))
            all += name + (kind == FolderItem::Kind::folder ? "/ " : " ");
        return all;
    };
    EXPECT_EQ(names(file), "a/ a-b a.b empty/ ");
    EXPECT_EQ(names(file / "a"), "1/ 2 ");
    EXPECT_EQ(names(file / "a/1"), "x y ");
    EXPECT_EQ(names(file / "empty"), "");
    EXPECT_FALSE(trouble);
    EXPECT_EQ(names(file / "none"), "");
    EXPECT_TRUE(trouble);
}

TEST_F(Tar, the_last_of_equal_names_counts_and_is_told) {
    const fs::path file = tar(tar_member("a", "old") + tar_member("b", "b") + tar_member("./a", "new") + tar_end());
    EXPECT_EQ(text(file / "a"), "new");
    EXPECT_TRUE(warned(oddities_of_tar(file), "of one name, of which the last counts: \"a\""));
}

TEST_F(Tar, names_that_lead_out_are_left_out_and_told) {
    const fs::path file =
        tar(tar_member("../evil", "x") + tar_member("/etc/evil", "x") + tar_member("a/../../evil", "x") +
            tar_pax({{"path", std::string("nul\0l", 5)}}) + tar_member("x", "x") + tar_member("good", "g") + tar_end());
    EXPECT_EQ(text(file / "good"), "g");
    EXPECT_FALSE(is_there(file / "../evil"));
    EXPECT_FALSE(is_there(file / "etc/evil"));
    EXPECT_TRUE(warned(oddities_of_tar(file), "4 members left out"));
}

TEST_F(Tar, links_lead_to_members_and_never_out) {
    const fs::path file = tar(tar_member("a/real", "here") + tar_header("a/hard", 0, '1', "a/real") +
                              tar_header("b/soft", 0, '2', "../a/real") + tar_header("b/twice", 0, '2', "soft") +
                              tar_header("out", 0, '2', "/etc/passwd") + tar_header("up", 0, '2', "../../x") +
                              tar_header("loop", 0, '2', "loop") + tar_header("lost", 0, '1', "none") +
                              tar_header("device", 0, '3') + tar_end());
    for (const char* name : {"a/hard", "b/soft", "b/twice"})
        EXPECT_EQ(text(file / name), "here") << name;
    for (const char* name : {"out", "up", "loop", "lost", "device"})
        EXPECT_FALSE(is_there(file / name)) << name;
    const auto said = oddities_of_tar(file);
    EXPECT_TRUE(warned(said, "2 links that lead out of it"));
    EXPECT_TRUE(warned(said, "2 links to no file in it"));
    EXPECT_TRUE(warned(said, "neither files, folders nor links"));
}

TEST_F(Tar, sizes_beyond_the_file_fail_by_name_and_leave_what_is_whole) {
    for (const std::uint64_t size : {std::uint64_t(5000), std::uint64_t(1) << 40, std::uint64_t(1) << 60}) {
        const fs::path file = tar(tar_member("good", "g") + tar_header("huge", size) + std::string(100, 'h'));
        EXPECT_EQ(text(file / "good"), "g");
        const std::string said = refusal([&] { (void)text(file / "huge"); });
        EXPECT_TRUE(says(said, fmt::format("/huge: a member of {} bytes, 100 of which", size))) << said;
        EXPECT_TRUE(warned(oddities_of_tar(file), "cut"));
    }
    const fs::path file = tar(tar_member("good", "g") + tar_pax({{"size", "18446744073709551615"}}) +
                              tar_member("huge", "x") + tar_end());
    EXPECT_EQ(text(file / "good"), "g");
    EXPECT_NE(refusal([&] { (void)text(file / "huge"); }), "");
}

TEST_F(Tar, cut_anywhere_the_frames_before_the_cut_stay_good) {
    std::string bytes;
    std::vector<std::size_t> ends;
    for (int i = 0; i < 3; ++i) {
        bytes += tar_member(fmt::format("depth/{}.png", i), depth_png(i));
        ends.push_back(bytes.size());
    }
    for (std::size_t length = 512; length < bytes.size(); length += 97) {
        const fs::path file = tar(bytes.substr(0, length));
        std::size_t whole = 0;
        for (; ends[whole] <= length; ++whole)
            EXPECT_EQ(refusal([&] { (void)text(file / fmt::format("depth/{}.png", whole)); }), "") << length;
        const bool within_padding =
            std::string_view(bytes).substr(length, ends[whole] - length).find_first_not_of('\0') ==
            std::string_view::npos; // no byte of a file is lost
        EXPECT_TRUE(within_padding || warned(oddities_of_tar(file), file.string())) << length;
        fs::remove(file);
    }
}

TEST_F(Tar, a_damaged_header_ends_the_list_and_is_told) {
    std::string bytes = tar_member("a", "a") + tar_member("b", "b") + tar_end();
    bytes[1024 + 5] = 'x';
    const fs::path file = tar(bytes);
    EXPECT_EQ(text(file / "a"), "a");
    EXPECT_FALSE(is_there(file / "b"));
    EXPECT_TRUE(warned(oddities_of_tar(file), "no header of a tar at byte 1024"));
}

TEST_F(Tar, any_byte_changed_is_survived) {
    const std::string sound = tar_pax({{"path", "long/a"}}) + tar_member("a", "a") + tar_member("L", "b/c", 'L') +
                              tar_member("b", "b") + tar_header("l", 0, '2', "long/a") + tar_end();
    for (std::size_t at = 0; at < sound.size(); ++at) {
        std::string bytes = sound;
        bytes[at] = static_cast<char>(bytes[at] ^ 0x41);
        const fs::path file = write_file(folder / "changed.tar", bytes);
        (void)refusal([&] {
            const TarIndex index(file);
            for (const auto& [name, kind] : index.items_in(""))
                (void)index.find(name);
        });
    }
}

TEST_F(Tar, sparse_members_are_refused_by_name) {
    const fs::path file =
        tar(tar_member("old", "x", 'S') + tar_pax({{"GNU.sparse.major", "1"}, {"GNU.sparse.name", "new"}}) +
            tar_member("GNUSparseFile.0/new", "x") + tar_member("good", "g") + tar_end());
    for (const char* name : {"old", "new"})
        EXPECT_TRUE(says(refusal([&] { (void)text(file / name); }), fmt::format("/{}: a sparse member", name)));
    EXPECT_EQ(text(file / "good"), "g");
}

TEST_F(Tar, archives_joined_by_cat_are_read_to_the_end) {
    const fs::path file = tar(tar_member("a", "a") + std::string(10240, '\0') + tar_member("b", "b") + tar_end());
    EXPECT_EQ(text(file / "b"), "b");
}

TEST_F(Tar, a_changed_tar_is_indexed_again_and_its_stamps_change) {
    const fs::path file = folder / "x.tar";
    write_file(file, tar_member("a", "old") + tar_end());
    EXPECT_EQ(text(file / "a"), "old");
    const std::string stamp = stamp_of(file / "a");
    EXPECT_NE(stamp, "");
    EXPECT_EQ(stamp_of(file / "a"), stamp);
    write_file(folder / "y.tar", tar_member("a", "new") + tar_end());
    fs::rename(folder / "y.tar", file);
    fs::last_write_time(file, fs::last_write_time(file) + std::chrono::seconds(1));
    EXPECT_EQ(text(file / "a"), "new");
    EXPECT_NE(stamp_of(file / "a"), stamp);
    EXPECT_EQ(hash_of_file(file / "a"), hash_of("new"));
    EXPECT_EQ(stamp_of(file / "none"), "");
}

TEST_F(Tar, packed_archives_are_refused_with_the_command_that_unpacks_them) {
    const auto said = [&](const std::string& name, const std::string& magic) {
        const fs::path file = write_file(folder / name, magic + std::string(600, 'x'));
        return refusal([&] { (void)open_capture(file); });
    };
    const std::string at = folder.path().string() + "/";
    EXPECT_TRUE(says(said("a.tar.gz", "\x1f\x8b\x08"), fmt::format("`gzip -dc {0}a.tar.gz > {0}a.tar`", at)));
    EXPECT_TRUE(says(said("a.tgz", "\x1f\x8b\x08"), fmt::format("`gzip -dc {0}a.tgz > {0}a.tar`", at)));
    EXPECT_TRUE(
        says(said("a b.tar.zst", "\x28\xb5\x2f\xfd"), fmt::format("`zstd -dc '{0}a b.tar.zst' > '{0}a b.tar'`", at)));
    EXPECT_TRUE(says(said("a.tar.xz", std::string("\xfd"
                                                  "7zXZ\0",
                                                  6)),
                     "xz -dc"));
    EXPECT_TRUE(says(said("a.tar.bz2", "BZh9"), "bzip2 -dc"));
}

// --- WebDataset ---

TEST_F(Tar, samples_of_webdataset_have_camera_pose_and_scale) {
    std::vector<uchar> colour;
    cv::imencode(".jpg", cv::Mat3b(48, 64, cv::Vec3b(9, 99, 199)), colour);
    std::string bytes;
    for (const int i : {10, 2}) {
        const std::string key = fmt::format("s{}", i);
        bytes +=
            tar_member(key + ".depth.png", depth_png(i)) +
            tar_member(key + ".rgb.jpg", {colour.begin(), colour.end()}) +
            tar_member(key + ".json", fmt::format(R"({{"K": [[50, 0, 31], [0, 51, 23], [0, 0, 1]], "depth_scale": 500,
                     "world_from_camera": [[1,0,0,{}],[0,1,0,0],[0,0,1,0],[0,0,0,1]], "timestamp": 1.5}})",
                                                  i));
    }
    const Capture capture = open_capture(tar(bytes + tar_member("s3.depth.png", depth_png(3)) +
                                             tar_member("s3.json", "{") + tar_member("readme.txt", "x") + tar_end()));
    EXPECT_EQ(capture.kind, "WebDataset");
    ASSERT_EQ(capture.entries.size(), 3u);
    EXPECT_EQ(capture.entries[2].name, "s10");
    const Frame frame = capture.load(0);
    EXPECT_EQ(frame.name, "s2");
    EXPECT_NEAR(frame.depth_m(3, 3), 1002 / 500.0, 1e-4);
    EXPECT_EQ(frame.camera.pinhole.fy, 51);
    EXPECT_EQ(frame.colour.size(), cv::Size(64, 48));
    ASSERT_TRUE(frame.world_from_camera);
    EXPECT_EQ(frame.world_from_camera->translation().x(), 2);
    EXPECT_TRUE(says(refusal([&] { (void)capture.load(1); }), "s3.json line 1: not JSON"));
}

TEST_F(Tar, samples_without_json_take_a_camera_beside_them) {
    const Capture capture = open_capture(
        tar(tar_member("camera.json", R"({"fx": 50, "fy": 50, "cx": 32, "cy": 24, "width": 64, "height": 48})") +
            tar_member("a.depth.png", depth_png(1)) + tar_member("b.depth.png", depth_png(2)) + tar_end()));
    EXPECT_EQ(capture.kind, "WebDataset");
    EXPECT_EQ(capture.entries.size(), 2u);
    EXPECT_EQ(capture.load(1).camera.pinhole.fx, 50);
}

} // namespace
} // namespace scanshade
