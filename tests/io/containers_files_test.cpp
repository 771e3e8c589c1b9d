// Recordings in one file, made here byte by byte: NumPy's archives and stacks, Record3D's, ScanNet++'s depth.bin; and
// LZFSE, in which Record3D packs.
#include "io/captures/capture.h"
#include "io/compression/inflated_stream.h"
#include "io/compression/lzfse.h"
#include "io/images/image_file.h"
#include "tests/support/files.h"
#include "tests/support/packed.h"
#include "tests/support/raw.h"

#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <lz4.h>
#include <zlib.h>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
constexpr int bare = -15; // deflate without a head
using tests::packed_by_zlib;
using tests::raw;
using tests::refusal;
using tests::says;
using tests::warned;
using tests::write_file;

std::string u16(unsigned value) { return raw(static_cast<std::uint16_t>(value)); }
std::string u32(std::size_t value) { return raw(static_cast<std::uint32_t>(value)); }

template <class Number>
std::string raw_all(const std::vector<Number>& values) {
    return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(Number)};
}

struct Member {
    std::string name, bytes;
    bool packed = true;
    bool zip64 = false; ///< sizes and place stand in an extra field, as above 4 GiB
};

std::string zip(const std::vector<Member>& members) {
    std::string file, rows;
    for (const Member& member : members) {
        const std::string data = member.packed ? packed_by_zlib(member.bytes, bare) : member.bytes;
        const auto crc =
            crc32(0, reinterpret_cast<const Bytef*>(member.bytes.data()), static_cast<uInt>(member.bytes.size()));
        const std::size_t ones = 0xffffffff;
        const std::string facts = u16(20) + u16(0) + u16(member.packed ? 8 : 0) + u32(0) + u32(crc) +
                                  u32(member.zip64 ? ones : data.size()) +
                                  u32(member.zip64 ? ones : member.bytes.size()) + u16(unsigned(member.name.size()));
        std::string sizes, all; // the size, the packed size, and in the list the place
        if (member.zip64) {
            const std::string both = raw(std::uint64_t(member.bytes.size())) + raw(std::uint64_t(data.size()));
            sizes = u16(1) + u16(16) + both;
            all = u16(7) + u16(2) + "xx" + u16(1) + u16(24) + both + raw(std::uint64_t(file.size()));
        }
        rows += "PK\1\2" + u16(20) + facts + u16(unsigned(all.size())) + u16(0) + u16(0) + u16(0) + u32(0) +
                u32(member.zip64 ? ones : file.size());
        rows.append(member.name).append(all);
        file += "PK\3\4" + facts + u16(unsigned(sizes.size()));
        file.append(member.name).append(sizes).append(data);
    }
    const auto count = static_cast<unsigned>(members.size());
    return file + rows + "PK\5\6" + u16(0) + u16(0) + u16(count) + u16(count) + u32(rows.size()) + u32(file.size()) +
           u16(0);
}

std::string npy(const std::string& type, const std::string& shape, const std::string& elements) {
    std::string header = fmt::format("{{'descr': '{}', 'fortran_order': False, 'shape': ({}), }}", type, shape);
    header.resize((header.size() + 74) / 64 * 64 - 11, ' ');
    header += '\n';
    return std::string("\x93NUMPY\x01\x00", 8) + u16(unsigned(header.size())) + header + elements;
}

/// Two frames of 8x6 pixels at 2 m and 3 m.
std::string two_frames() {
    std::vector<std::uint16_t> depth(48, 2000);
    depth.resize(96, 3000);
    return npy("<u2", "2, 6, 8", raw_all(depth));
}

const std::string k = npy("<f8", "3, 3", raw_all<double>({10, 0, 3.5, 0, 10, 2.5, 0, 0, 1}));

class ContainerFiles : public testing::Test {
  protected:
    fs::path file(const std::string& name, const std::string& bytes) { return write_file(folder / name, bytes); }
    tests::TemporaryFolder folder_;
    fs::path folder = folder_.path();
};

// --- zip and NumPy ---

TEST_F(ContainerFiles, an_archive_of_arrays_has_frames_camera_and_unit) {
    std::vector<double> poses;
    for (const double x : {1.0, 2.0})
        for (const double value : {1.0, 0.0, 0.0, x, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0})
            poses.push_back(value);
    const std::vector<std::uint8_t> red(288, 7);
    const Capture capture = open_capture(file("a.npz", zip({{"depth.npy", two_frames()},
                                                            {"K.npy", k, false},
                                                            {"poses.npy", npy("<f8", "2, 4, 4", raw_all(poses))},
                                                            {"depth_scale.npy", npy("<f8", "", raw(500.0))},
                                                            {"rgb.npy", npy("|u1", "2, 6, 8, 3", raw_all(red))}})));
    ASSERT_EQ(capture.entries.size(), 2U);
    const Frame frame = capture.load(1);
    EXPECT_FLOAT_EQ(frame.depth_m(5, 7), 6);
    EXPECT_EQ(frame.camera.pinhole.cx, 3.5);
    ASSERT_TRUE(frame.world_from_camera);
    EXPECT_EQ(frame.world_from_camera->translation().x(), 2);
    ASSERT_EQ(frame.colour.size(), cv::Size(8, 6));
    EXPECT_EQ(frame.colour(3, 3), cv::Vec3b(7, 7, 7));
    EXPECT_TRUE(warned(capture.warnings, "camera to world"));
}

TEST_F(ContainerFiles, an_archive_without_depth_lists_its_keys) {
    const fs::path npz = file("a.npz", zip({{"foo.npy", k}}));
    EXPECT_TRUE(says(refusal([&] { (void)open_capture(npz); }), "foo.npy"));
}

TEST_F(ContainerFiles, damage_in_an_archive_names_member_and_checksum) {
    std::string bytes = zip({{"depth.npy", two_frames(), false}, {"K.npy", k, true}});
    const std::size_t crc_at = bytes.rfind("PK\1\2") + 16;
    bytes[crc_at] = static_cast<char>(bytes[crc_at] ^ 1);
    const std::string message = refusal([&] { (void)open_capture(file("a.npz", bytes)); });
    EXPECT_TRUE(says(message, "K.npy"));
    EXPECT_TRUE(says(message, "checksum"));
}

TEST_F(ContainerFiles, sizes_above_4_gib_have_a_field_of_their_own) {
    // Behind the field of another program. Packed, so that the two sizes differ.
    const std::string bytes = zip({{"K.npy", k}, {"depth.npy", two_frames(), true, true}});
    EXPECT_FLOAT_EQ(open_capture(file("a.npz", bytes)).load(1).depth_m(5, 7), 3);
    const Capture cut = open_capture(file("a.npz", bytes.substr(0, bytes.find("PK\1\2"))));
    EXPECT_FLOAT_EQ(cut.load(1).depth_m(5, 7), 3) << "members have one, too";
}

TEST_F(ContainerFiles, half_floats_are_metres_down_to_the_smallest) {
    // 2.5; the smallest normal number, 2^-14; the smallest of all, 2^-24, without a leading one; infinity and NaN are
    // holes.
    const Capture capture = open_capture(
        file("a.npz", zip({{"depth.npy", npy("<f2", "1, 6",
                                             raw_all<std::uint16_t>({0x4100, 0x0400, 0x0001, 0x7c00, 0x7e00, 0xc000}))},
                           {"K.npy", k}})));
    const cv::Mat1f depth_m = capture.load(0).depth_m;
    EXPECT_EQ(depth_m(0, 0), 2.5F);
    EXPECT_EQ(depth_m(0, 1), std::ldexp(1.0F, -14));
    EXPECT_EQ(depth_m(0, 2), std::ldexp(1.0F, -24));
    for (int u = 3; u < 6; ++u)
        EXPECT_EQ(depth_m(0, u), 0) << u;
}

// --- ScanNet's .sens ---

std::string matrix_of(float f, float cx, float cy, float x) {
    return raw_all<float>({f, 0, cx, x, 0, f, cy, 0, 0, 0, 1, 0, 0, 0, 0, 1});
}

/// Two frames of 3x2 pixels, 1 m and 2 m, with colours of 2x1; the colour camera stands 5 cm along the body's x.
std::string sens(bool packed, std::uint64_t frames_said = 2) {
    std::string bytes = u32(4) + raw(std::uint64_t(4)) + "test" + matrix_of(20, 0.5F, 0, 0) +
                        matrix_of(1, 0, 0, 0.05F) + matrix_of(10, 1, 0.5F, 0) + matrix_of(1, 0, 0, 0);
    bytes += raw(std::int32_t(0)) + raw(std::int32_t(packed ? 1 : 0)) + u32(2) + u32(1) + u32(3) + u32(2) +
             raw(1000.0F) + raw(frames_said);
    for (const unsigned metres : {1U, 2U}) {
        const std::string stored = raw_all(std::vector<std::uint16_t>(6, static_cast<std::uint16_t>(1000 * metres)));
        std::string depth = stored;
        if (packed) {
            uLongf size = compressBound(stored.size());
            depth.resize(size);
            EXPECT_EQ(compress(reinterpret_cast<Bytef*>(depth.data()), &size,
                               reinterpret_cast<const Bytef*>(stored.data()), stored.size()),
                      Z_OK);
            depth.resize(size);
        }
        const std::string colour = "\x0a\x14\x1e\x28\x32\x3c"; // red, green, blue
        bytes += matrix_of(1, 0, 0, static_cast<float>(metres)) + raw(std::uint64_t(1000000 * metres)) +
                 raw(std::uint64_t(1000000 * metres + 4000)) + raw(std::uint64_t(colour.size())) +
                 raw(std::uint64_t(depth.size()));
        bytes.append(colour).append(depth);
    }
    return bytes;
}

TEST_F(ContainerFiles, sens_has_two_cameras_two_clocks_and_poses) {
    for (const bool packed : {false, true}) {
        const Capture capture = open_capture(file("a.sens", sens(packed)));
        ASSERT_EQ(capture.entries.size(), 2U);
        EXPECT_DOUBLE_EQ(*capture.entries[1].stamp_s, 2.004) << "of depth";
        EXPECT_DOUBLE_EQ(*capture.entries[1].colour_stamp_s, 2);
        const Frame frame = capture.load(1);
        ASSERT_EQ(frame.depth_m.size(), cv::Size(3, 2)) << packed;
        EXPECT_EQ(cv::countNonZero(frame.depth_m == 2), 6) << packed;
        EXPECT_EQ(frame.camera.pinhole, (Pinhole{10, 10, 1, 0.5, {3, 2}}));
        ASSERT_TRUE(frame.world_from_camera);
        EXPECT_EQ(frame.world_from_camera->translation().x(), 2);
        ASSERT_TRUE(frame.colour_camera);
        EXPECT_EQ(frame.colour_camera->camera.pinhole.fx, 20);
        // A point before the depth camera is 5 cm to the left of the colour camera.
        EXPECT_NEAR(frame.colour_camera->colour_from_depth.translation().x(), -0.05, 1e-7);
        ASSERT_EQ(frame.colour.size(), cv::Size(2, 1));
        EXPECT_EQ(frame.colour(0, 1), cv::Vec3b(60, 50, 40));
    }
}

TEST_F(ContainerFiles, sens_that_ends_early_keeps_what_is_whole) {
    const std::string bytes = sens(false);
    const Capture cut = open_capture(file("a.sens", bytes.substr(0, bytes.size() - 1)));
    EXPECT_EQ(cut.entries.size(), 1U);
    EXPECT_TRUE(warned(cut.warnings, "frame 1 at byte"));
    EXPECT_EQ(open_capture(file("a.sens", sens(false, 0))).entries.size(), 2U) << "a writer that died says 0";
    EXPECT_TRUE(says(refusal([&] { (void)open_capture(file("a.sens", sens(false, std::uint64_t(1) << 60))); }),
                     "frames according to byte"));
}

TEST_F(ContainerFiles, an_archive_cut_at_its_end_keeps_what_is_whole) {
    const std::string bytes = zip({{"depth.npy", two_frames()}, {"K.npy", k}});
    const Capture capture = open_capture(file("a.npz", bytes.substr(0, bytes.find("PK\1\2") - 10)));
    EXPECT_EQ(capture.entries.size(), 2U);
    EXPECT_FALSE(capture.camera);
    EXPECT_TRUE(warned(capture.warnings, "list of members"));
}

TEST_F(ContainerFiles, every_cut_of_an_archive_is_refused_or_read) {
    const std::string bytes = zip({{"depth.npy", two_frames()}, {"K.npy", k}});
    for (std::size_t size = 4; size < bytes.size(); ++size) {
        const fs::path path = file("a.npz", bytes.substr(0, size));
        const std::string message = refusal([&] { EXPECT_FLOAT_EQ(open_capture(path).load(0).depth_m(0, 0), 2); });
        EXPECT_TRUE(message.empty() || message.find("a.npz") != std::string::npos) << size << ": " << message;
    }
}

TEST_F(ContainerFiles, a_stack_of_frames_needs_no_archive) {
    const Capture capture = open_capture(file("depth.npy", two_frames()));
    ASSERT_EQ(capture.entries.size(), 2U);
    EXPECT_FLOAT_EQ(capture.load(1).depth_m(0, 0), 3);
    const std::string bytes = two_frames();
    EXPECT_TRUE(
        says(refusal([&] { (void)open_capture(file("cut.npy", bytes.substr(0, bytes.size() - 1))); }), "192 bytes"));
}

/// NumPy's arithmetic widens: depth is often saved as int32, int64 or float16.
TEST_F(ContainerFiles, an_array_is_depth_in_any_type_that_holds_it) {
    const auto stored = [&](const std::string& type, const std::string& elements) {
        return stored_depth_in(npy(type, "1, 3", elements), "a.npy");
    };
    const cv::Mat1w counts{0, 2000, 65535};
    const auto is_counts = [&](const cv::Mat& image) {
        return image.type() == CV_16UC1 && cv::norm(image, counts.reshape(1, 1), cv::NORM_INF) == 0;
    };
    EXPECT_TRUE(is_counts(stored("<i4", raw_all<std::int32_t>({-1, 2000, 65535}))));
    EXPECT_TRUE(is_counts(stored("<i8", raw_all<std::int64_t>({0, 2000, 65535}))));
    EXPECT_TRUE(is_counts(stored(">u4", std::string("\0\0\0\0\0\0\7\xd0\0\0\xff\xff", 12))));
    EXPECT_EQ(stored("<i2", raw_all<std::int16_t>({-5, 2000, 1})).at<ushort>(0, 0), 0) << "a mark of holes";
    EXPECT_EQ(stored("<f2", u16(0x4000) + u16(0x3800) + u16(0)).at<float>(0, 1), 0.5F);
    EXPECT_TRUE(says(refusal([&] { (void)stored("<i4", raw_all<std::int32_t>({0, 70000, 1})); }), "70000"));
    EXPECT_TRUE(says(refusal([&] { (void)stored("|u1", "abc"); }), "16 bits or more"));
}

// --- long deflate streams ---

TEST_F(ContainerFiles, parts_of_a_long_stream_are_those_of_the_whole) {
    std::string bytes(6 << 20, '\0');
    std::uint32_t random = 1;
    for (char& c : bytes)
        c = static_cast<char>((random = random * 1664525U + 1013904223U) >> 28);
    const std::string packed = packed_by_zlib(bytes, bare);
    const FileBytes stored(file("long", "before" + packed));
    const InflatedStream stream(stored, 6, packed.size(), bytes.size());
    ASSERT_EQ(stream.size(), bytes.size());
    EXPECT_EQ(stream.damage(), "");
    for (const std::size_t at : {std::size_t(0), std::size_t(1000), (std::size_t(1) << 20) - 1, std::size_t(5000000)})
        EXPECT_EQ(stream.bytes(at, 300000), bytes.substr(at, 300000)) << at;
    EXPECT_TRUE(says(refusal([&] { (void)stream.bytes(bytes.size() - 1, 2); }), "are not there"));
    const InflatedStream cut(stored, 6, packed.size() / 2, bytes.size());
    EXPECT_TRUE(says(cut.damage(), "end early"));
    EXPECT_EQ(cut.bytes(0, cut.size()), bytes.substr(0, cut.size()));
    EXPECT_TRUE(says(refusal([&] { InflatedStream(stored, 6, packed.size(), 1000); }), "more than 1000 bytes"));
}

// --- ScanNet++ ---

constexpr std::size_t pixels = 256 * 192;
constexpr const char* one_camera =
    R"({"frame_000000": {"timestamp": 1, "intrinsic": [[1500,0,959.5],[0,1500,719.5],[0,0,1]],
        "aligned_pose": [[1,0,0,1],[0,1,0,2],[0,0,1,3],[0,0,0,1]]},
        "frame_000001": {"timestamp": 2, "intrinsic": [[1500,0,959.5],[0,1500,719.5],[0,0,1]],
        "aligned_pose": [[1,0,0,1],[0,1,0,2],[0,0,1,3],[0,0,0,1]]}})";

TEST_F(ContainerFiles, depth_bin_is_one_stream_of_floats) {
    std::vector<float> depth(pixels, 2);
    depth.resize(2 * pixels, 3);
    (void)file("pose_intrinsic_imu.json", one_camera);
    const std::string packed = packed_by_zlib(raw_all(depth), bare);
    (void)file("depth.bin", packed);
    const Capture capture = open_capture(folder);
    ASSERT_EQ(capture.entries.size(), 2U);
    const Frame frame = capture.load(1);
    EXPECT_FLOAT_EQ(frame.depth_m(191, 255), 3);
    EXPECT_NEAR(frame.camera.pinhole.fx, 200, 1e-9);
    EXPECT_NEAR(frame.camera.pinhole.cx, 127.5, 1e-9);
    (void)file("depth.bin", packed.substr(0, packed.size() - 40));
    const Capture cut = open_capture(folder);
    EXPECT_EQ(cut.entries.size(), 1U);
    EXPECT_TRUE(warned(cut.warnings, "end early"));
}

TEST_F(ContainerFiles, depth_bin_is_blocks_with_their_sizes) {
    std::string bytes;
    for (const unsigned mm : {2000U, 3000U}) {
        const std::vector<std::uint16_t> depth(pixels, static_cast<std::uint16_t>(mm));
        std::string packed(LZ4_compressBound(2 * pixels), '\0');
        packed.resize(static_cast<std::size_t>(LZ4_compress_default(
            reinterpret_cast<const char*>(depth.data()), packed.data(), 2 * pixels, static_cast<int>(packed.size()))));
        bytes += u32(packed.size()) + packed;
    }
    (void)file("pose_intrinsic_imu.json", one_camera);
    (void)file("depth.bin", bytes);
    EXPECT_FLOAT_EQ(open_capture(folder).load(1).depth_m(0, 0), 3);
    std::string bad = bytes;
    bad[8] = '\x7f'; // a match from before the first byte; one bad frame is one bad frame
    (void)file("depth.bin", bad);
    const Capture capture = open_capture(folder);
    EXPECT_TRUE(says(refusal([&] { (void)capture.load(0); }), "frame 0 at byte 4"));
    EXPECT_FLOAT_EQ(capture.load(1).depth_m(0, 0), 3);
    (void)file("depth.bin", bytes.substr(0, bytes.size() - 3));
    const Capture cut = open_capture(folder);
    EXPECT_EQ(cut.entries.size(), 1U);
    EXPECT_TRUE(warned(cut.warnings, "frame 1"));
    (void)file("depth.bin", "nothing of the kind");
    EXPECT_TRUE(says(refusal([&] { (void)open_capture(folder); }), "depth.bin"));
}

// --- Record3D ---

std::string stored_lzfse(const std::string& bytes) { return "bvx-" + u32(bytes.size()) + bytes + "bvx$"; }

TEST_F(ContainerFiles, record3d_has_its_cameras_in_the_metadata) {
    const std::vector<float> depth(48, 2);
    std::vector<std::uint8_t> sure(48, 2);
    sure[0] = 0;
    const std::string metadata = R"({"w": 16, "h": 12, "dw": 8, "dh": 6, "K": [20,0,0, 0,20,0, 7.5,5.5,1],
        "poses": [[0,0,0,1, 1,2,3]]})";
    std::vector<Member> members{{"metadata", metadata},
                                {"rgbd/0.depth", stored_lzfse(raw_all(depth))},
                                {"rgbd/0.conf", stored_lzfse(raw_all(sure))},
                                {"rgbd/1.depth", "bvxz"}};
    const Capture capture = open_capture(file("a.r3d", zip(members)));
    ASSERT_EQ(capture.entries.size(), 2U);
    const Frame frame = capture.load(0);
    EXPECT_EQ(frame.depth_m(0, 0), 0);
    EXPECT_EQ(frame.depth_m(1, 1), 2);
    EXPECT_EQ(frame.camera.pinhole.fx, 10);
    EXPECT_EQ(frame.camera.pinhole.cx, 3.5);
    ASSERT_TRUE(frame.world_from_camera);
    EXPECT_LT((*frame.world_from_camera * Eigen::Vector3d(0, 0, 1) - Eigen::Vector3d(1, 2, 2)).norm(), 1e-9);
    const std::string message = refusal([&] { (void)capture.load(1); });
    EXPECT_TRUE(says(message, "rgbd/1.depth"));
    EXPECT_TRUE(says(message, "bvxz"));
    std::string damaged = zip(members); // of a pixel, which LZFSE would not notice: the archive's checksum does
    damaged[damaged.find("PK\1\2", damaged.find("PK\1\2") + 1) + 16] ^= 1;
    const Capture changed = open_capture(file("c.r3d", damaged));
    EXPECT_TRUE(says(refusal([&] { (void)changed.load(0); }), "checksum"));
    members.erase(members.begin());
    EXPECT_TRUE(says(refusal([&] { (void)open_capture(file("b.r3d", zip(members))); }), "metadata"));
}

// --- LZFSE ---

TEST(Lzfse, lzvn_copies_what_came_before) {
    // Three literals, then a match of 10 bytes 3 back: its bits are 00MMMDDD DDDDDDDD after 1110LLLL; then one match as
    // far back as that, 1111MMMM.
    const std::string packed = "\xe3"
                               "abc"
                               "\x38\x03"
                               "\xf2" +
                               std::string("\x06\0\0\0\0\0\0\0", 8);
    const std::string block = "bvxn" + u32(15) + u32(packed.size()) + packed;
    EXPECT_EQ(unpacked_lzfse(block + "bvx$", 100), "abcabcabcabcabc");
    EXPECT_TRUE(says(refusal([&] { (void)unpacked_lzfse(block + "bvx$", 14); }), "expected at most 14"));
    EXPECT_TRUE(says(refusal([&] { (void)unpacked_lzfse(block, 100); }), "expected, 0 are left"));
    EXPECT_TRUE(says(refusal([&] { (void)unpacked_lzfse(block + "bvx$.", 100); }), "after the stream's end"));
    std::string far = block;
    far[17] = '\x04'; // a match that begins before the first byte
    EXPECT_TRUE(says(refusal([&] { (void)unpacked_lzfse(far + "bvx$", 100); }), "a match 4 bytes back"));
}

/// Bits in the order in which they are taken from the end backwards, last ones first.
struct Bits {
    std::string bytes;
    unsigned count = 0;
    void put(std::uint32_t value, unsigned bits) {
        for (unsigned i = 0; i < bits; ++i, ++count) {
            if (count % 8 == 0)
                bytes += '\0';
            bytes.back() = static_cast<char>(bytes.back() | (value >> i & 1) << (count % 8));
        }
    }
    /// Of the last byte, that are not used.
    [[nodiscard]] unsigned unused() const { return (8 - count % 8) % 8; }
};

/// Encodes symbols last to first, by search for the state that leads to the one after.
struct Encoder {
    std::vector<std::uint32_t> frequencies;
    std::uint32_t states;

    std::uint32_t before(std::uint32_t next, std::size_t symbol, Bits& bits) const {
        std::uint32_t begin = 0;
        for (std::size_t i = 0; i < symbol; ++i)
            begin += frequencies[i];
        const std::uint32_t f = frequencies[symbol];
        for (std::uint32_t j = 0; j < f; ++j) {
            unsigned most = 0; // floor(log2(states / f)) and one less, for those that go through
            while ((f << (most + 1)) <= 2 * states - 1)
                ++most;
            const std::uint32_t longer = (2 * states >> most) - f;
            const unsigned length = j < longer ? most : most - 1;
            const std::uint32_t from = j < longer ? ((f + j) << most) - states : (j - longer) << (most - 1);
            if (next >= from && next < from + (1U << length)) {
                bits.put(next - from, length);
                return begin + j;
            }
        }
        ADD_FAILURE() << "no state before " << next;
        return 0;
    }
};

/// One block of literals "ab.." and these matches.
std::string entropy_coded(std::size_t bytes) {
    const std::string literals = "abcd";
    struct Step {
        std::uint32_t run, length_symbol, length_more, length_bits, distance_symbol, distance_more, distance_bits;
    };
    // 4 literals, then 20 bytes 4 back (length 16 + 4 in 3 bits; distance 4 + 0 in 1 bit), then 1 as far back as
    // before.
    const std::vector<Step> steps{{4, 16, 4, 3, 4, 0, 1}, {0, 1, 0, 0, 0, 0, 0}};
    std::vector<std::uint32_t> runs(20), lengths(20), distances(64), characters(256);
    runs[4] = 40, runs[0] = 24;
    lengths[16] = 63, lengths[1] = 1;
    distances[4] = 200, distances[0] = 56;
    characters['a'] = 1000, characters['b'] = 7, characters['c'] = 5, characters['d'] = 12;
    const Encoder of_runs{runs, 64}, of_lengths{lengths, 64}, of_distances{distances, 256},
        of_literals{characters, 1024};

    Bits literal_bits, step_bits;
    std::uint32_t states[4] = {0, 0, 0, 0};
    for (std::size_t i = literals.size(); i-- > 0;)
        states[i % 4] = of_literals.before(states[i % 4], static_cast<unsigned char>(literals[i]), literal_bits);
    std::uint32_t run = 0, length = 0, distance = 0;
    for (std::size_t i = steps.size(); i-- > 0;) {
        const Step& step = steps[i];
        step_bits.put(step.distance_more, step.distance_bits);
        distance = of_distances.before(distance, step.distance_symbol, step_bits);
        step_bits.put(step.length_more, step.length_bits);
        length = of_lengths.before(length, step.length_symbol, step_bits);
        run = of_runs.before(run, step.run, step_bits);
    }
    Bits table;
    for (const auto* frequencies : {&runs, &lengths, &distances, &characters})
        for (const std::uint32_t f : *frequencies)
            if (f < 2)
                table.put(f << 1, 2);
            else if (f < 4)
                table.put((f - 2) << 2 | 1, 3);
            else if (f < 8)
                table.put((f - 4) << 3 | 3, 5);
            else if (f < 24)
                table.put((f - 8) << 4 | 7, 8);
            else
                table.put((f - 24) << 4 | 15, 14);
    using Word = std::uint64_t;
    const Word first = Word(literals.size()) | Word(literal_bits.bytes.size()) << 20 | Word(steps.size()) << 40 |
                       Word(7 - literal_bits.unused()) << 60;
    const Word second = Word(states[0]) | Word(states[1]) << 10 | Word(states[2]) << 20 | Word(states[3]) << 30 |
                        Word(step_bits.bytes.size()) << 40 | Word(7 - step_bits.unused()) << 60;
    const Word third = Word(32 + table.bytes.size()) | Word(run) << 32 | Word(length) << 42 | Word(distance) << 52;
    return "bvx2" + u32(bytes) + raw(first) + raw(second) + raw(third) + table.bytes + literal_bits.bytes +
           step_bits.bytes;
}

TEST(Lzfse, entropy_coded_blocks_are_literals_and_matches) {
    EXPECT_EQ(unpacked_lzfse(entropy_coded(25) + "bvx$", 100), "abcdabcdabcdabcdabcdabcda");
    EXPECT_TRUE(says(refusal([&] { (void)unpacked_lzfse(entropy_coded(26) + "bvx$", 100); }), "1 byte early"));
    EXPECT_TRUE(says(refusal([&] { (void)unpacked_lzfse(entropy_coded(24) + "bvx$", 100); }), "more bytes"));
}

TEST(Lzfse, every_cut_and_every_wrong_byte_is_refused_or_bounded) {
    const std::string sound = entropy_coded(25) + "bvx$";
    for (std::size_t i = 0; i < sound.size(); ++i) {
        EXPECT_TRUE(says(refusal([&] { (void)unpacked_lzfse(sound.substr(0, i), 100); }), "LZFSE data"));
        for (const int change : {1, 16, 255}) {
            std::string wrong = sound;
            wrong[i] = static_cast<char>(wrong[i] ^ change);
            (void)refusal([&] { EXPECT_LE(unpacked_lzfse(wrong, 100).size(), 100U); });
        }
    }
}

} // namespace
} // namespace scanshade
