// CACAO's own tests. Profile `scan` must hold each of its corrections, and `reference` must fail on the same input. The
// shaders must agree with the formulas of AMD's documentation. Tables of passes, kinds of depth and a few golden maps
// follow.
#include "ao/cacao/cacao.h"
#include "ao/gpu/transfer.h"
#include "io/images/image_file.h"
#include "tests/reference/cacao_cpu.h"
#include "tests/support/scenes.h"

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <functional>
#include <gtest/gtest.h>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <set>

namespace scanshade {
namespace {

using namespace tests;
using reference::Around;
using shared::CacaoConstants;

constexpr float nan = std::numeric_limits<float>::quiet_NaN();
const cv::Size usual(160, 120);

/// One device for all tests: opening it takes longer than a frame. It validates where the layer is installed.
gpu::Device& device() {
    static const int asked = setenv("SCANSHADE_VALIDATE", "1", 1);
    static gpu::Device opened;
    return (void)asked, opened;
}

// --- running CACAO and looking inside

/// AO values of one slice of the grid, and the packed edges beside them. NaN at holes.
struct Slice {
    cv::Mat1f ao;
    cv::Mat1b edges;
};

struct Seen {
    cv::Mat1f visibility;
    CacaoConstants k;
    std::array<Slice, 4> raw, blurred;             ///< before and after the blur
    std::array<std::array<cv::Mat1f, 4>, 4> depth; ///< by slice, by mip (above 0 with HIGH and HIGHEST only)
    std::array<cv::Mat3f, 4> normals;              ///< y up, as stored
};

/// The inputs of a run besides depth.
struct Given {
    cv::Mat3f normals{};
    std::function<Slice(int slice, const Slice& made)> ao{}; ///< replaces the result of generate
};

/// The word of an AO texel: the reference stores AMD's 8 bits, scan 16.
std::uint32_t word_of(float ao, int edges, bool scan) {
    return static_cast<std::uint32_t>(std::nearbyint(ao * (scan ? 65535.0F : 255.0F))) |
           static_cast<std::uint32_t>(edges) << 16;
}

Slice slice_of(const std::uint32_t* words, cv::Size size, bool scan) {
    Slice s{cv::Mat1f(size), cv::Mat1b(size)};
    for (int y = 0; y < size.height; ++y)
        for (int x = 0; x < size.width; ++x) {
            const std::uint32_t word = *words++;
            const bool hole = scan && word >> 31;
            s.ao(y, x) = hole ? nan : static_cast<float>(word & 0xffffU) / (scan ? 65535.0F : 255.0F);
            s.edges(y, x) = static_cast<uchar>(word >> 16);
        }
    return s;
}

cv::Vec3f normal_of(std::uint32_t word, bool scan) {
    const int bits = scan ? 10 : 8;
    cv::Vec3f n;
    for (int axis = 0; axis < 3; ++axis) {
        const int value = scan ? static_cast<int>(word >> (axis * bits) & 1023U) - 512
                               : static_cast<int>(word << (32 - (axis + 1) * bits)) >> (32 - bits);
        n[axis] = std::max(-1.0F, static_cast<float>(value) / (scan ? 511.0F : 127.0F));
    }
    return n;
}

/// Programs by their tables. Making pipelines takes most of the time here, so runs that differ only in constants share
/// them.
class Shared {
  public:
    gpu::Program program;
    static Shared& made_for(const CacaoTables& tables) {
        (void)device(); // made before, gone after the programs
        static std::map<std::string, std::unique_ptr<Shared>> all;
        std::string key;
        for (const gpu::BufferRow& row : tables.buffers)
            key += fmt::format("{} {} ", row.bytes, static_cast<int>(row.host));
        for (const gpu::PassRow& row : tables.passes)
            key += fmt::format("{} {} {} {} {} ", row.shader, row.groups, row.reads, row.writes, row.constants);
        auto& one = all[key];
        if (!one)
            one = std::unique_ptr<Shared>(new Shared(tables));
        return *one;
    }

  private:
    explicit Shared(const CacaoTables& t) : program(device(), t.buffers, t.passes, sizeof(CacaoConstants)) {}
};

void upload(gpu::Program& program, int buffer, const cv::Mat& image) {
    ASSERT_EQ(program.host(buffer).size(), image.total() * image.elemSize());
    gpu::upload(image, program.host(buffer));
}

Seen run_tables(const CacaoOptions& o, const CacaoConstants& k, const CacaoTables& tables, const DepthImage& depth,
                const cv::Mat3f& normals, const std::vector<std::uint32_t>& ao) {
    gpu::Program& program = Shared::made_for(tables).program;
    upload(program, cacao_depth_in, depth.z_m);
    if (!normals.empty())
        upload(program, cacao_normals_in, normals);
    if (!ao.empty())
        std::memcpy(program.host(cacao_ping).data(), ao.data(), ao.size() * 4);
    program.run(std::as_bytes(std::span(&k, 1)));

    Seen seen{cv::Mat1f(depth.z_m.size()), k, {}, {}, {}, {}};
    std::memcpy(seen.visibility.data, program.host(cacao_out).data(), seen.visibility.total() * 4);
    const cv::Size size(k.slice.x, k.slice.y);
    const auto read = [&](int buffer) { return program.read_back(buffer); };
    const auto ping = read(cacao_ping), after = read(tables.blurred), normal = read(cacao_normals),
               z = read(cacao_depths);
    for (std::size_t a = 0; a < 4; ++a) {
        const std::size_t first = a * static_cast<std::size_t>(size.area());
        const auto words = [&](const std::vector<std::byte>& bytes) {
            return reinterpret_cast<const std::uint32_t*>(bytes.data()) + first;
        };
        seen.raw[a] = slice_of(words(ping), size, o.scan());
        seen.blurred[a] = slice_of(words(after), size, o.scan());
        seen.normals[a] = cv::Mat3f(size);
        for (int i = 0; i < size.area(); ++i)
            seen.normals[a](i / size.width, i % size.width) = normal_of(words(normal)[i], o.scan());
        for (int m = 0; m < 4; ++m) {
            cv::Mat1f& to = seen.depth[a][static_cast<std::size_t>(m)] =
                cv::Mat1f(std::max(1, size.height >> m), std::max(1, size.width >> m));
            const auto* slice = reinterpret_cast<const float*>(z.data()) + static_cast<int>(a) * k.depth_pitch +
                                k.depth_end - (k.depth_mips >> 2 * m);
            for (int y = 0; y < to.rows; ++y)
                std::copy_n(slice + y * (k.depth_stride >> m), to.cols, to[y]);
        }
    }
    return seen;
}

Seen run(const CacaoOptions& o, const DepthImage& depth, const Given& given = {}) {
    const CacaoConstants k = constants_from(o, depth.camera);
    CacaoTables tables = cacao_tables(o, k, !given.normals.empty());
    if (!given.ao)
        return run_tables(o, k, tables, depth, given.normals, {});
    // All passes but generation, which an upload replaces.
    const Seen made = run_tables(o, k, tables, depth, given.normals, {});
    std::vector<std::uint32_t> words;
    for (int a = 0; a < 4; ++a) {
        const Slice slice = given.ao(a, made.raw[static_cast<std::size_t>(a)]);
        for (int i = 0; i < slice.ao.size().area(); ++i) {
            const int y = i / slice.ao.cols, x = i % slice.ao.cols;
            words.push_back(word_of(slice.ao(y, x), slice.edges(y, x), o.scan()));
        }
    }
    std::erase_if(tables.passes, [](const gpu::PassRow& row) {
        return std::set<std::string_view>{
                   "mips", "clear counter", "base", "importance", "importance blur a", "importance blur b", "generate"}
                   .count(row.name) > 0;
    });
    tables.buffers[cacao_ping].host = gpu::BufferRow::Host::upload;
    return run_tables(o, k, tables, depth, given.normals, words);
}

/// With AMD's tone curve for both profiles: the calibrated one would hide half of each departure.
CacaoOptions options(Quality quality = Quality::high, bool downsampled = false,
                     CacaoProfile profile = CacaoProfile::scan) {
    CacaoOptions o;
    o.profile = profile;
    o.quality = quality;
    o.downsampled = downsampled;
    o.tone_curve = CacaoToneCurve::documented;
    return o;
}

std::string_view name_of(Quality quality) { return word_for(quality, quality_words); }
std::string_view name_of(CacaoProfile profile) { return word_for(profile, cacao_profile_words); }
std::string_view name_of(CacaoDepthInput input) { return word_for(input, cacao_depth_input_words); }
std::string_view name_of(CacaoStorage storage) { return storage == CacaoStorage::images ? "images" : "buffers"; }

/// The same through both profiles.
struct Both {
    Seen scan, reference;
};
Both both(CacaoOptions o, const DepthImage& depth, const Given& given = {}) {
    o.profile = CacaoProfile::scan;
    Seen scan = run(o, depth, given);
    o.profile = CacaoProfile::reference;
    return {std::move(scan), run(o, depth, given)};
}

/// Prints the figures that a test compares.
void measured(std::string_view what, double scan, double reference) {
    fmt::print("             {}: scan {:.4f}, reference {:.4f}\n", what, scan, reference);
}

// --- scenes and figures

Pinhole camera_of(double f, cv::Size size = usual) {
    return {f, f, (size.width - 1) / 2.0, (size.height - 1) / 2.0, size};
}

/// Normals of tilted_plane(), camera space.
cv::Mat3f plane_normals(cv::Size size, double tilt_degrees) {
    const double tilt = tilt_degrees * std::numbers::pi / 180;
    return cv::Mat3f(size, cv::Vec3f(static_cast<float>(std::sin(tilt)), 0, static_cast<float>(-std::cos(tilt))));
}

DepthImage flat(const Pinhole& camera, float z) { return {camera, cv::Mat1f(camera.size, z), {}}; }
/// A wall at z, and left of the middle column another at `left`.
DepthImage step(const Pinhole& camera, float left, float z) {
    DepthImage depth = flat(camera, z);
    depth.z_m.colRange(0, camera.size.width / 2) = left;
    return depth;
}

/// Of the values that are not NaN, where the mask is set.
struct Figures {
    double low = 0, high = 0, average = 0;
};
Figures figures(const cv::Mat1f& v, const cv::Mat& mask = {}) {
    cv::Mat known = v == v;
    if (!mask.empty())
        known &= mask;
    Figures f;
    cv::minMaxLoc(v, &f.low, &f.high, nullptr, nullptr, known);
    f.average = cv::mean(v, known)[0];
    return f;
}
double lowest(const cv::Mat1f& v, const cv::Mat& mask = {}) { return figures(v, mask).low; }
double highest(const cv::Mat1f& v, const cv::Mat& mask = {}) { return figures(v, mask).high; }
double average(const cv::Mat1f& v, const cv::Mat& mask = {}) { return figures(v, mask).average; }
cv::Mat1f difference(const cv::Mat1f& a, const cv::Mat1f& b) {
    cv::Mat1f d;
    cv::absdiff(a, b, d);
    return d;
}

class cacao_scan : public testing::Test {
  protected:
    void TearDown() override { silent(); }
    /// No message of the validation layer since the last look.
    static void silent() {
        static std::size_t read = 0;
        const auto messages = device().validation_messages();
        for (; read < messages.size(); ++read)
            ADD_FAILURE() << messages[read];
    }
};
using cacao_formulas = cacao_scan;
using cacao_passes = cacao_scan;
using cacao_depth_input = cacao_scan;
using cacao_golden = cacao_scan;

// --- A. departures of scan

TEST_F(cacao_scan, visibility_comes_out_as_computed) {
    // All slices say 0.5, so the map must say 0.5. AMD raises it to 2.2 on the way out, but not in every quality.
    const Given half{{}, [](int, const Slice& made) { return Slice{cv::Mat1f(made.ao.size(), 0.5F), made.edges}; }};
    const double dark = std::pow(128.0 / 255, 2.2);
    for (const auto& [quality, expected] : {std::pair(Quality::low, 128.0 / 255), {Quality::high, dark}}) {
        CacaoOptions o = options(quality);
        o.blur_passes = 0;
        const Both maps = both(o, flat(camera_of(125), 3), half);
        measured(name_of(quality), average(maps.scan.visibility), average(maps.reference.visibility));
        EXPECT_NEAR(lowest(maps.scan.visibility), 0.5, 1e-4);
        EXPECT_NEAR(highest(maps.scan.visibility), 0.5, 1e-4);
        EXPECT_NEAR(average(maps.reference.visibility), expected, 0.005);
    }
}

TEST_F(cacao_scan, holes_do_not_occlude_and_have_no_visibility) {
    // A plane with holes is still open. A hole has depth 0, the position of the camera. If that is within the radius,
    // the reference takes the hole for an occluder in front of the plane.
    DepthImage depth = with_holes(flat(camera_of(125), 0.3F), 0.1);
    CacaoOptions o = options();
    o.radius = 2;
    const Both maps = both(o, depth);
    const cv::Mat surface = depth.z_m > 0;
    measured("darkest pixel of a plane with holes", lowest(maps.scan.visibility, surface),
             lowest(maps.reference.visibility, surface));
    EXPECT_GE(lowest(maps.scan.visibility), 0.999);
    EXPECT_LT(lowest(maps.reference.visibility, surface), 0.2);
    EXPECT_EQ(cv::countNonZero((maps.scan.visibility == maps.scan.visibility) != surface), 0)
        << "NaN at holes, only there";
    EXPECT_GT(cv::countNonZero((maps.reference.visibility == maps.reference.visibility) & ~surface), 0);
}

TEST_F(cacao_scan, holes_are_not_open_space) {
    // A corner stays as dark when pixels are removed, at random or one whole slice of the four. Beyond the radius the
    // reference counts a hole as a ray without a hit, and loses a quarter of the darkness. (Scan still loses 1 % where
    // 40 % of the pixels are missing. The tolerance comes from that measurement, not from a derivation.)
    const Pinhole camera = camera_of(125);
    const DepthImage corner = wall_corner(camera);
    DepthImage sliced{camera, corner.z_m.clone(), {}};
    for (int y = 1; y < usual.height; y += 2)
        for (int x = 1; x < usual.width; x += 2)
            sliced.z_m(y, x) = 0;
    cv::Mat3f normals(usual);
    const float s = std::numbers::sqrt2_v<float> / 2;
    for (int x = 0; x < usual.width; ++x)
        normals.col(x) = cv::Vec3f(x < camera.cx ? s : -s, 0, -s);
    CacaoOptions o = options(); // weak and linear: a strong effect brightens where fewer taps make it noisier
    o.shadow_multiplier = 0.5F;
    o.shadow_power = 1;
    const Both whole = both(o, corner, {normals, {}});
    for (const DepthImage& punched : {with_holes(corner, 0.4), sliced}) {
        const Both rest = both(o, punched, {normals, {}});
        cv::Mat near = cv::Mat::zeros(usual, CV_8U);
        near.colRange(60, 100) = 255;
        near &= punched.z_m > 0;
        const auto darkness = [&](const cv::Mat1f& v) { return 1 - average(v, near); };
        const double scan = darkness(rest.scan.visibility) / darkness(whole.scan.visibility);
        const double amd = darkness(rest.reference.visibility) / darkness(whole.reference.visibility);
        measured("darkness of a corner left by holes", scan, amd);
        EXPECT_NEAR(scan, 1, 0.02);
        EXPECT_LT(amd, 0.8);
    }
}

TEST_F(cacao_scan, a_checkerboard_of_holes_changes_nothing) {
    // Every other pixel is missing, so no pixel has a neighbour, and two of the four slices are empty. Scan
    // interpolates 1/z across a hole of one pixel: normals use the pixel beyond it, and the filled hole serves as an
    // occluder.
    const DepthImage corner = wall_corner(test_camera(usual));
    DepthImage board{corner.camera, corner.z_m.clone(), {}};
    for (int y = 0; y < usual.height; ++y)
        for (int x = (y + 1) % 2; x < usual.width; x += 2)
            board.z_m(y, x) = 0;
    const cv::Mat left = board.z_m > 0;
    const auto changed = [&](const Seen& with, const Seen& without) {
        return std::sqrt(cv::norm(with.visibility, without.visibility, cv::NORM_L2SQR, left) / cv::countNonZero(left));
    };
    for (const Quality quality : {Quality::lowest, Quality::low, Quality::high, Quality::highest}) {
        const CacaoOptions o = options(quality);
        const Both whole = both(o, corner), punched = both(o, board);
        measured(fmt::format("{}, RMS change", name_of(quality)), changed(punched.scan, whole.scan),
                 changed(punched.reference, whole.reference));
        EXPECT_LT(changed(punched.scan, whole.scan), 0.005);
        EXPECT_GT(changed(punched.reference, whole.reference), 0.1);
        EXPECT_EQ(cv::countNonZero((punched.scan.visibility == punched.scan.visibility) != left), 0)
            << "holes get no visibility";
    }
}

TEST_F(cacao_scan, a_hole_of_device_depth_is_a_hole) {
    // 0 in the depth image is no surface (projection/maps.h), in device depth, too. With reverse-Z a cleared buffer
    // holds 0, which means infinitely far.
    for (const CacaoDepthInput kind : {CacaoDepthInput::normal_z, CacaoDepthInput::reverse_z})
        for (const Quality quality : {Quality::lowest, Quality::high})
            for (const bool downsampled : {false, true}) {
                CacaoOptions o = options(quality, downsampled);
                o.depth_input = kind;
                o.radius = 2;
                const float d =
                    kind == CacaoDepthInput::normal_z ? 0.66673334F : 0.33326666F; // 0.3 m between 0.1 and 1000 m
                DepthImage depth = flat(camera_of(125), d);
                depth.z_m(cv::Rect(60, 40, 20, 20)) = 0;
                const cv::Mat1f v = run(o, depth).visibility;
                const std::string run_name = fmt::format("{} {} {}", name_of(kind), name_of(quality), downsampled);
                EXPECT_TRUE(std::isnan(v(50, 70))) << run_name << ": " << v(50, 70);
                EXPECT_GE(lowest(v), 0.999) << run_name;
            }
}

TEST_F(cacao_scan, a_hole_does_not_poison_the_mips) {
    // The mean of the known depths of a wall at 3 m is 3 m. The reference takes the nearest of each four, and a hole is
    // nearest: one missing pixel empties 16x16 of them in mip 3.
    DepthImage depth = flat(camera_of(125), 3);
    depth.z_m(40, 40) = 0;
    const Both maps = both(options(), depth);
    for (std::size_t m = 1; m < 4; ++m) {
        EXPECT_EQ(lowest(maps.scan.depth[0][m]), 3) << "mip " << m;
        EXPECT_EQ(lowest(maps.reference.depth[0][m]), 0) << "mip " << m;
    }
    measured("mip 3 over one hole", maps.scan.depth[0][3](2, 2), maps.reference.depth[0][3](2, 2));
}

TEST_F(cacao_scan, mips_know_the_radius) {
    // A scene and radius eight times as large give the same map. Every length scales by a power of two, so not even
    // rounding changes. AMD's mip weight ignores the radius and cuts at one unit: it blends poles 15 cm before a wall
    // with the wall, but not poles 1.2 m before it.
    DepthImage fence = flat(camera_of(125), 0.5F);
    for (int x = 0; x < usual.width; ++x)
        if (x % 12 < 3)
            fence.z_m.col(x) = 0.35F;
    const auto at = [&](float scale) {
        CacaoOptions o = options();
        o.radius = 0.8F * scale;
        return both(o, {fence.camera, cv::Mat1f(fence.z_m * scale), {}});
    };
    const Both one = at(1), large = at(8);
    measured("eight times as large, mean difference", average(difference(one.scan.visibility, large.scan.visibility)),
             average(difference(one.reference.visibility, large.reference.visibility)));
    EXPECT_LE(highest(difference(one.scan.visibility, large.scan.visibility)), 1e-4);
    EXPECT_LE(highest(difference(one.scan.visibility, at(0.125F).scan.visibility)), 1e-4);
    EXPECT_GT(average(difference(one.reference.visibility, large.reference.visibility)), 0.01);
}

TEST_F(cacao_scan, distance_alone_takes_nothing_away) {
    // A hall 400 m away, with the radius scaled alike, gives the same map as a room 2 m away. By default AMD's AO fades
    // out from 50 to 300 m: depths of games, not of scans.
    const DepthImage near = wall_corner(test_camera(usual));
    const auto at = [&](float scale) {
        CacaoOptions o = options();
        o.radius = 0.5F * scale;
        return both(o, {near.camera, cv::Mat1f(near.z_m * scale), {}});
    };
    const Both room = at(1), hall = at(256);
    const auto darkness = [](const cv::Mat1f& v) { return 1 - average(v); };
    measured("256 times as large, darkness left", darkness(hall.scan.visibility) / darkness(room.scan.visibility),
             darkness(hall.reference.visibility) / darkness(room.reference.visibility));
    EXPECT_LE(highest(difference(room.scan.visibility, hall.scan.visibility)), 1e-4);
    EXPECT_GT(darkness(room.reference.visibility), 0.05);
    EXPECT_LT(darkness(hall.reference.visibility), 0.001);
}

TEST_F(cacao_scan, what_lies_outside_the_image_is_unknown) {
    // A plane that recedes out of the image is open up to the rim. The reference repeats the depth of the rim outside
    // the image, which is above the plane.
    const DepthImage depth = tilted_plane(camera_of(200), 60);
    const Both maps = both(options(), depth, {plane_normals(usual, 60), {}});
    const cv::Rect inside(60, 0, 40, 120);
    measured("darkest at the rim", lowest(maps.scan.visibility), lowest(maps.reference.visibility));
    EXPECT_GE(lowest(maps.scan.visibility), 0.999);
    EXPECT_GE(lowest(maps.reference.visibility(inside)), 0.98) << "away from the rim";
    EXPECT_LT(lowest(maps.reference.visibility), 0.8);
}

TEST_F(cacao_scan, taps_look_from_the_texel_they_read) {
    // A tap of mip m reads the mean of 2^m texels across. At the centre of that texel, this depth is on the plane. At
    // the position of the tap, as in the reference, a slope becomes a staircase. Full strength and a horizon angle of 0
    // keep the steps visible.
    const cv::Size size(320, 240);
    const DepthImage depth = tilted_plane(camera_of(693, size), 60);
    const Given given{plane_normals(size, 60), {}};
    CacaoOptions o = options();
    o.radius = 1;
    o.horizon_angle = 0;
    o.shadow_multiplier = 2.3F;
    o.shadow_power = 5;
    const Both maps = both(o, depth, given);
    const cv::Rect inside(155, 0, 10, 240); // no tap of these leaves the image sideways
    o.quality = Quality::medium;
    o.profile = CacaoProfile::reference;
    measured("slope by mips", lowest(maps.scan.visibility(inside)), lowest(maps.reference.visibility(inside)));
    EXPECT_GE(lowest(maps.scan.visibility), 0.999);
    EXPECT_LT(lowest(maps.reference.visibility(inside)), 0.9);
    EXPECT_GE(lowest(run(o, depth, given).visibility(inside)), 0.98) << "the same without mips";
}

TEST_F(cacao_scan, a_grazing_plane_is_one_surface) {
    // 1/z is linear across any plane, so a plane has no edges, however it is tilted; z is not.
    const double tilt = 80;
    const DepthImage depth = tilted_plane(camera_of(125), tilt);
    const Both maps = both(options(), depth);
    const cv::Vec3f truth = plane_normals({1, 1}, tilt)(0, 0);
    const auto found = [&](const Seen& seen) {
        int whole = 0, texels = 0;
        double worst = 0;
        for (std::size_t a = 0; a < 4; ++a)
            for (int y = 1; y + 1 < seen.k.slice.y; ++y)
                for (int x = 2; x + 2 < seen.k.slice.x; ++x) {
                    const cv::Mat1f& z = seen.depth[a][0];
                    if (lowest(z(cv::Rect(x - 2, y - 1, 5, 3))) == 0)
                        continue; // the last texel before a hole has no slope
                    ++texels;
                    whole += seen.raw[a].edges(y, x) == 0xff;
                    const double cosine = cv::normalize(seen.normals[a](y, x)).dot(truth);
                    worst = std::max(worst, std::acos(std::min(1.0, cosine)) * 180 / std::numbers::pi);
                }
        return std::pair(static_cast<double>(whole) / texels, worst);
    };
    const auto [scan_whole, scan_worst] = found(maps.scan);
    const auto [amd_whole, amd_worst] = found(maps.reference);
    measured("share of texels without an edge", scan_whole, amd_whole);
    measured("worst normal, degrees", scan_worst, amd_worst);
    EXPECT_EQ(scan_whole, 1);
    EXPECT_LT(amd_whole, 0.9);
    EXPECT_LT(scan_worst, 1);
    EXPECT_GT(amd_worst, 10);
}

TEST_F(cacao_scan, nothing_leaks_across_a_cut_edge) {
    // Left all open, right all closed, a metre apart in depth: no blur step may mix them. AMD lets 1 - sharpness
    // through every cut edge.
    const DepthImage depth = step(camera_of(125), 1, 3);
    const Given sides{{}, [](int, const Slice& made) {
                          Slice s{cv::Mat1f(made.ao.size(), 0.0F), made.edges};
                          s.ao.colRange(0, s.ao.cols / 2) = 1;
                          return s;
                      }};
    CacaoOptions o = options();
    o.blur_passes = 8;
    o.sharpness = 0.98F;
    const Both maps = both(o, depth, sides);
    const auto leak = [](const Seen& seen) {
        double bright = 1, dark = 0;
        for (const Slice& s : seen.blurred) {
            bright = std::min(bright, lowest(s.ao.colRange(0, s.ao.cols / 2)));
            dark = std::max(dark, highest(s.ao.colRange(s.ao.cols / 2, s.ao.cols)));
        }
        return std::pair(bright, dark);
    };
    measured("bright side after eight passes", leak(maps.scan).first, leak(maps.reference).first);
    measured("dark side after eight passes", leak(maps.scan).second, leak(maps.reference).second);
    EXPECT_EQ(leak(maps.scan), std::pair(1.0, 0.0));
    EXPECT_LT(leak(maps.reference).first, 0.99);
    EXPECT_GT(leak(maps.reference).second, 0.01);
}

/// Replaces generated AO by columns of the AO grid. All edges are open, or those found in depth.
Given columns(const std::function<float(int)>& value, bool found_edges = false) {
    return {{}, [=](int slice, const Slice& made) {
                Slice s{cv::Mat1f(made.ao.size()), found_edges ? made.edges : cv::Mat1b(made.ao.size(), 255)};
                for (int x = 0; x < s.ao.cols; ++x)
                    s.ao.col(x) = value(2 * x + slice % 2);
                return s;
            }};
}

CacaoOptions upsampling(Quality quality) {
    CacaoOptions o = options(quality, true);
    o.blur_passes = 0;
    return o;
}

TEST_F(cacao_scan, the_left_rim_knows_nothing_of_the_right) {
    // AMD's unsigned coordinates wrap: its halo left of the image shows AO of the right rim.
    const Both maps =
        both(upsampling(Quality::high), flat(camera_of(125), 3), columns([](int g) { return g < 70 ? 1.0F : 0.0F; }));
    const cv::Rect left(0, 0, 4, 120);
    measured("left rim, open, with the right rim closed", lowest(maps.scan.visibility(left)),
             lowest(maps.reference.visibility(left)));
    EXPECT_GE(lowest(maps.scan.visibility(left)), 0.9999);
    EXPECT_LT(lowest(maps.reference.visibility(left)), 0.9);
}

TEST_F(cacao_scan, upsampled_ao_stays_where_it_was_computed) {
    // One closed column of the grid must darken the pixels left and right of it alike. AMD's nearest samples fall on
    // texel borders, where the hardware chooses a side, and the map moves by half a grid pixel. (The window of five is
    // lopsided itself, by 0.02, at odd pixels.)
    for (const int column : {34, 35}) {
        const Both maps = both(upsampling(Quality::low), flat(camera_of(125), 3),
                               columns([&](int g) { return g == column ? 0.0F : 1.0F; }));
        const auto lopsided = [&](const Seen& seen) {
            double most = 0;
            for (int d = 1; d <= 4; ++d)
                most = std::max(most, std::abs(average(seen.visibility.col(2 * column - d)) -
                                               average(seen.visibility.col(2 * column + d))));
            return most;
        };
        measured(fmt::format("left against right of grid column {}", column), lopsided(maps.scan),
                 lopsided(maps.reference));
        EXPECT_LT(lopsided(maps.scan), 0.025);
        EXPECT_GT(lopsided(maps.reference), 0.1);
    }
}

TEST_F(cacao_scan, the_upsampler_compares_with_the_depth_of_the_same_column) {
    // A near open surface is left, a far closed one right, and their depths keep them apart. AMD reads the depth of odd
    // columns one slice texel to the right, so it takes the near rim for the far wall.
    const Both maps = both(upsampling(Quality::high), step(camera_of(125), 1, 3),
                           columns([](int g) { return g < 40 ? 1.0F : 0.0F; }, true));
    const cv::Rect left(6, 0, 74, 120), right(80, 0, 74, 120);
    measured("darkest left of the step", lowest(maps.scan.visibility(left)), lowest(maps.reference.visibility(left)));
    measured("brightest right of the step", highest(maps.scan.visibility(right)),
             highest(maps.reference.visibility(right)));
    EXPECT_GE(lowest(maps.scan.visibility(left)), 0.9999);
    EXPECT_LE(highest(maps.scan.visibility(right)), 0.0001);
    EXPECT_GT(highest(maps.reference.visibility(right)), 0.05);
}

TEST_F(cacao_scan, the_last_odd_column_counts) {
    // AMD reads the depth of the last column one column too far right, too. That is outside the image, so the column
    // has no weight.
    const auto closed = [](int column) { return columns([=](int g) { return g == column ? 0.0F : 1.0F; }); };
    const DepthImage depth = flat(camera_of(125), 3);
    const Both last = both(upsampling(Quality::high), depth, closed(79)),
               inner = both(upsampling(Quality::high), depth, closed(39));
    const auto darkening = [](const Seen& seen, int x) { return 1 - average(seen.visibility.col(x)); };
    const double scan = darkening(last.scan, 158) / darkening(inner.scan, 78),
                 amd = darkening(last.reference, 158) / darkening(inner.reference, 78);
    measured("effect of the last column against an inner one", scan, amd);
    EXPECT_GT(scan, 0.9);
    EXPECT_LT(amd, 0.6);
}

TEST_F(cacao_scan, pixels_are_where_they_are_at_odd_sizes) {
    // 33 pixels are 9 slice texels of four, 36 pixels: AMD's kernel squeezes its rays by 33/36, and a plane no longer
    // fits its own normals. At 36 pixels it does.
    const double tilt = 50;
    CacaoOptions o = options(Quality::low, true);
    o.radius = 0.8F;
    o.horizon_angle = 0;
    const auto inner = [&](const Seen& seen) { return lowest(seen.visibility(cv::Rect(12, 12, 9, 9))); };
    const auto of = [&](int width) {
        const cv::Size size(width, width);
        return both(o, tilted_plane(camera_of(40, size), tilt), {plane_normals(size, tilt), {}});
    };
    const Both odd = of(33), even = of(36);
    measured("plane of 33 pixels", inner(odd.scan), inner(odd.reference));
    measured("plane of 36 pixels", inner(even.scan), inner(even.reference));
    EXPECT_GE(lowest(odd.scan.visibility), 0.999);
    EXPECT_GE(inner(even.reference), 0.98);
    EXPECT_LT(inner(odd.reference), 0.95);
}

TEST_F(cacao_scan, depth_is_precise_from_near_to_far) {
    // A plane is open at any tilt and distance. Through a telephoto lens a pixel is 2 cm wide at 65 m. There binary16
    // has steps of 6 cm and AMD's bias covers 5, so a slope becomes a staircase. 32 bits have no such steps.
    CacaoOptions o = options();
    o.fade_from = 1e4F;
    o.fade_to = 1e5F;
    for (const double tilt : {3.0, 45.0, 80.0})
        for (const double z : {0.3, 3.0, 65.0, 100.0}) {
            const DepthImage depth = tilted_plane(camera_of(3200), tilt, z);
            o.profile = CacaoProfile::scan;
            const Seen seen = run(o, depth, {plane_normals(usual, tilt), {}});
            EXPECT_GE(lowest(seen.visibility), 0.999) << tilt << " degrees, " << z << " m";
        }
    const DepthImage slope = tilted_plane(camera_of(3200), 3, 65);
    const Both maps = both(o, slope, {plane_normals(usual, 3), {}});
    const cv::Rect inside(60, 30, 40, 60);
    measured("slope at 65 m", lowest(maps.scan.visibility(inside)), lowest(maps.reference.visibility(inside)));
    const auto error = [&](const Seen& seen) { // of slice 0, even pixels of even rows
        double most = 0;
        for (int y = 0; y < seen.k.slice.y; ++y)
            for (int x = 0; x < seen.k.slice.x; ++x)
                most = std::max<double>(most, std::abs(seen.depth[0][0](y, x) - slope.z_m(2 * y, 2 * x)));
        return most;
    };
    measured("largest error of depth, m", error(maps.scan), error(maps.reference));
    EXPECT_EQ(error(maps.scan), 0);
    EXPECT_GT(error(maps.reference), 0.05);
    EXPECT_LT(lowest(maps.reference.visibility(inside)), 0.98);
}

TEST_F(cacao_scan, the_radius_is_metric_at_close_range) {
    // A step 0.3 m aside and 0.1 m higher shades a wall within a radius of 0.5 m, at half a metre from the camera as
    // at five. The reference shrinks its radius, to less than 0.3 m here, where it would cover much of the screen.
    // How dark is not compared: perspective shows the two cameras different parts of the step.
    const auto aside = [](const Seen& seen, double pixel_m) {
        return average(seen.visibility(cv::Rect(80 + static_cast<int>(0.3 / pixel_m), 40, 1, 40)));
    };
    const Both close = both(options(), step(camera_of(125), 0.4F, 0.5F)),
               far = both(options(), step(camera_of(500), 4.9F, 5));
    measured("0.3 m from a step, camera at 0.5 m", aside(close.scan, 0.004), aside(close.reference, 0.004));
    measured("0.3 m from a step, camera at 5 m", aside(far.scan, 0.01), aside(far.reference, 0.01));
    EXPECT_LT(aside(close.scan, 0.004), 0.96);
    EXPECT_LT(aside(far.scan, 0.01), 0.98);
    EXPECT_LT(aside(far.reference, 0.01), 0.96);
    EXPECT_GE(aside(close.reference, 0.004), 0.999);
}

TEST_F(cacao_scan, pixels_need_not_be_square) {
    // The same view, sampled twice as finely down as across, shows the same shadows. AMD's disc is as high as wide in
    // pixels.
    const cv::Size tall(160, 240);
    const Both square = both(options(), ball_on_floor(camera_of(125)));
    const Both high = both(options(), ball_on_floor({125, 250, 79.5, 119.5, tall}));
    const auto apart = [](const Seen& a, const Seen& b) {
        cv::Mat1f halved;
        cv::resize(b.visibility, halved, a.visibility.size(), 0, 0, cv::INTER_AREA);
        return average(difference(a.visibility, halved).rowRange(70, 110)); // where the floor meets the wall
    };
    measured("mean difference", apart(square.scan, high.scan), apart(square.reference, high.reference));
    EXPECT_LT(apart(square.scan, high.scan), 0.02);
    EXPECT_GT(apart(square.reference, high.reference), 0.03);
}

TEST_F(cacao_scan, lowest_reads_nothing_beyond_an_odd_image) {
    // In an odd image, the last column has no partner in the other slice. AMD loads depth 0 for it, a wall at the
    // camera.
    CacaoOptions o = options(Quality::lowest);
    o.radius = 2;
    const Both odd = both(o, flat(camera_of(40, {41, 31}), 0.3F));
    o.profile = CacaoProfile::reference;
    const Seen even = run(o, flat(camera_of(40, {42, 32}), 0.3F));
    measured("darkest pixel of a plane of 41x31", lowest(odd.scan.visibility), lowest(odd.reference.visibility));
    EXPECT_GE(lowest(odd.scan.visibility), 0.999);
    EXPECT_LT(lowest(odd.reference.visibility), 0.9);
    EXPECT_GE(lowest(even.visibility), 0.98);
}

TEST_F(cacao_scan, normals_beside_holes_are_true_or_absent) {
    // More than half of a slope is missing. A complete quadrant gives the normal of the plane. Without one, scan takes
    // the neighbours' normals, or none. AMD guesses a normal that faces the camera.
    const double tilt = 60;
    const DepthImage depth = with_holes(tilted_plane(camera_of(200), tilt), 0.6);
    const Both maps = both(options(), depth);
    const cv::Vec3f truth = plane_normals({1, 1}, tilt)(0, 0);
    const auto found = [&](const Seen& seen) {
        int wrong = 0, none = 0, texels = 0;
        for (std::size_t a = 0; a < 4; ++a)
            for (int y = 1; y + 1 < seen.k.slice.y; ++y)
                for (int x = 1; x + 1 < seen.k.slice.x; ++x) {
                    if (seen.depth[a][0](y, x) == 0)
                        continue;
                    ++texels;
                    const cv::Vec3f n = seen.normals[a](y, x);
                    none += cv::norm(n) < 0.5;
                    wrong += cv::norm(n) >= 0.5 && cv::normalize(n).dot(truth) < std::cos(2 * std::numbers::pi / 180);
                }
        return std::pair(static_cast<double>(wrong) / texels, static_cast<double>(none) / texels);
    };
    measured("share of wrong normals", found(maps.scan).first, found(maps.reference).first);
    measured("share of absent normals", found(maps.scan).second, found(maps.reference).second);
    EXPECT_EQ(found(maps.scan).first, 0);
    EXPECT_GT(found(maps.reference).first, 0.02);
}

// --- B. the shaders against AMD's documentation

constexpr float near_enough = 1e-6F;

TEST_F(cacao_formulas, every_setting_that_amds_host_takes_is_taken) {
    // Section 2 of the specification: documented ranges, and what the host clamps to where that is wider. A radius of 0
    // is left out, since AMD's constants are then infinite.
    struct Case {
        const char* name;
        std::vector<const char*> values;
    };
    for (const Case& of : {Case{"radius", {"0.0001", "100000"}},
                           {"shadow-multiplier", {"0", "5"}},
                           {"shadow-power", {"0", "10"}},
                           {"shadow-clamp", {"0", "1"}},
                           {"horizon-angle", {"0", "0.3", "1"}},
                           {"fade-to", {"0.001", "1e30"}},
                           {"adaptive-limit", {"0", "1"}},
                           {"blur-passes", {"0", "8"}},
                           {"sharpness", {"0", "1"}},
                           {"detail-strength", {"0", "5", "100"}},
                           {"sigma-squared", {"0.001", "1e6"}},
                           {"depth-sigma-squared", {"1e-9", "1e6"}}})
        for (const char* value : of.values)
            for (const CacaoProfile profile : {CacaoProfile::scan, CacaoProfile::reference}) {
                CacaoOptions o = options(Quality::high, false, profile);
                bool found = false;
                for (const Parameter& row : o.parameters())
                    if (row.name == of.name) {
                        found = true;
                        EXPECT_NO_THROW(set(row, std::string(value))) << of.name << " " << value;
                    }
                EXPECT_TRUE(found) << of.name;
                EXPECT_NO_THROW(Cacao(device(), o)) << of.name << " " << value;
            }
}

TEST_F(cacao_formulas, a_horizon_of_one_occludes_nothing) {
    // No sample is higher above the surface than straight up, whose sine is 1.
    CacaoOptions o = options();
    const DepthImage depth = step(camera_of(125), 1.8F, 2);
    EXPECT_LT(lowest(both(o, depth).scan.visibility), 0.9);
    o.horizon_angle = 1;
    const Both maps = both(o, depth);
    EXPECT_GE(lowest(maps.scan.visibility), 0.999);
    EXPECT_GE(lowest(maps.reference.visibility), 0.999);
}

TEST_F(cacao_formulas, a_power_of_zero_leaves_numbers) {
    // Full strength without a clamp makes visibility 0, and 0 to the power 0 is no number in shaders.
    CacaoOptions o = options();
    o.shadow_multiplier = 5;
    o.shadow_clamp = 1;
    o.shadow_power = 0;
    const DepthImage depth = step(camera_of(125), 1.8F, 2);
    const Both maps = both(o, depth);
    EXPECT_EQ(cv::countNonZero(maps.scan.visibility == maps.scan.visibility), depth.z_m.size().area());
    EXPECT_EQ(cv::countNonZero(maps.reference.visibility == maps.reference.visibility), depth.z_m.size().area());
}

TEST_F(cacao_formulas, the_cpu_reference_has_the_documented_values) {
    // The specification's worked values check the formulas with which the tests below compare the shaders.
    const Around e = reference::edges(2, {2.1F, 1.95F, 2, 3});
    EXPECT_NEAR(e.left, 0.675, 2e-6);
    EXPECT_NEAR(e.right, 0.675, 2e-6);
    EXPECT_EQ(e.top, 1);
    EXPECT_EQ(e.bottom, 0);
    EXPECT_EQ(reference::packed({1, 0.5F, 0.2F, 0}), 228);
    EXPECT_NEAR(reference::nearest_mean({2, 2.5F, 3.2F, 2.1F}, -1), 2.172993, near_enough);
    const Around weights = reference::unpacked(reference::packed({1, 0, 0.6F, 0.3F}), 0.02F);
    EXPECT_NEAR(weights.right, 0.02, near_enough);
    EXPECT_NEAR(weights.top, 0.686667, near_enough);
    EXPECT_NEAR(weights.bottom, 0.353333, near_enough);
    EXPECT_NEAR(reference::blurred(0.8F, {0.7F, 0.2F, 0.9F, 0.4F}, weights), 0.727865, near_enough);
    CacaoConstants k{};
    k.shadow_strength = 4.3F;
    k.shadow_clamp = 0.98F;
    k.shadow_power = 1.5F;
    EXPECT_NEAR(reference::visibility(k, 0.12F, 1), 0.336719, near_enough);
    EXPECT_NEAR(std::pow(reference::visibility(k, 0.12F, 1), 2.2), 0.091199, near_enough);
}

TEST_F(cacao_formulas, constants_follow_the_camera) {
    // Section 7 of the specification works one camera through, section 11.1 one texel and one tap of it.
    CacaoOptions o = options(Quality::high, false, CacaoProfile::reference);
    const Pinhole camera{525, 525, 319.5, 239.5, {640, 480}};
    const CacaoConstants k = constants_from(o, camera);
    EXPECT_NEAR(k.view_mul.x, 1.2190476, near_enough);
    EXPECT_NEAR(k.view_mul.y, -0.9142857, near_enough);
    EXPECT_NEAR(k.view_add.x, -0.6095238, near_enough);
    EXPECT_NEAR(k.view_add.y, 0.4571429, near_enough);
    EXPECT_NEAR(k.near_limit_rec, 0.7619048, near_enough);
    o.quality = Quality::low;
    EXPECT_NEAR(constants_from(o, camera).near_limit_rec, 0.5079365, near_enough);

    const std::array<cv::Mat1f, 4> depth{cv::Mat1f(240, 320, 2.0F), {}, {}, {}};
    const reference::High slice{k, 2, depth, {}};
    const auto t = slice.texel(100, 60);
    EXPECT_NEAR(t.u, 0.3140625, near_enough);
    EXPECT_NEAR(t.v, 0.2520833, near_enough);
    EXPECT_NEAR(t.point[0], -0.453333, near_enough);
    EXPECT_NEAR(t.point[1], 0.453333, near_enough);
    EXPECT_EQ(t.radius, 0.5F);
    EXPECT_NEAR(t.step_x, 0.00761905, near_enough);
    EXPECT_NEAR(t.step_y, -0.00761905, near_enough);
    EXPECT_NEAR(t.disc, 55.78125, 1e-4);
    EXPECT_EQ(t.falloff, -4);
    const reference::Tap& tap = reference::taps_of_high()[0];
    EXPECT_NEAR(slice.offset(tap, t, 100, 60)[0], -44.088, 1e-3);
    EXPECT_NEAR(slice.offset(tap, t, 100, 60)[1], 31.828, 1e-3);
    EXPECT_EQ(reference::High::mip(tap, t), 1);
    const auto d = slice.place(t.u - 44 * k.slice_inv.x, t.v + 32 * k.slice_inv.y, 1.8F) - k.depth_offset * t.point;
    EXPECT_NEAR(d[0], -0.256744, 2e-6);
    EXPECT_NEAR(d[1], -0.264399, 2e-6);
    EXPECT_NEAR(d[2], -0.198400, 2e-6);
    EXPECT_NEAR(reference::obscurance({0, 0, -1}, d, t.falloff, k.horizon), 0.123895, 2e-6);
    EXPECT_EQ(tap.weight, 1.5F);
}

/// Counts of a comparison of many values.
struct Agreement {
    int equal = 0, all = 0;
    void add(bool same) { equal += same, ++all; }
    [[nodiscard]] double share() const {
        fmt::print("             {} of {} agree\n", equal, all);
        return static_cast<double>(equal) / all;
    }
};

TEST_F(cacao_formulas, edges_are_those_of_the_documentation) {
    // Every packed edge byte of a scene, from the depth slices. Ties may round the other way.
    const Both maps = both(options(Quality::medium), ball_on_floor(camera_of(125)));
    for (const Seen* seen : {&maps.scan, &maps.reference}) {
        const bool scan = seen == &maps.scan;
        Agreement agreement;
        for (std::size_t a = 0; a < 4; ++a) {
            const cv::Mat1f& z = seen->depth[a][0];
            for (int y = 1; y + 1 < z.rows; ++y)
                for (int x = 1; x + 1 < z.cols; ++x) {
                    const Around around{z(y, x - 1), z(y, x + 1), z(y - 1, x), z(y + 1, x)};
                    const Around e =
                        scan ? reference::edges_of_inverse(z(y, x), around) : reference::edges(z(y, x), around);
                    agreement.add(reference::packed(e) == seen->raw[a].edges(y, x));
                }
        }
        EXPECT_GE(agreement.share(), 0.999) << (scan ? "scan" : "reference");
    }
}

TEST_F(cacao_formulas, mips_are_means_of_the_nearest_surface) {
    // Mip 1 from the full-precision depth. AMD's weight always assumes a radius of 1, and its stored copies are
    // binary16.
    const DepthImage depth = ball_on_floor(camera_of(125));
    const Both maps = both(options(), depth);
    for (const Seen* seen : {&maps.scan, &maps.reference}) {
        const bool scan = seen == &maps.scan;
        const float phi = scan ? -1 / (0.5F * 0.5F) : -1;
        Agreement agreement;
        for (int a = 0; a < 4; ++a) {
            const cv::Mat1f& mip = seen->depth[static_cast<std::size_t>(a)][1];
            const auto at = [&](int x, int y) { return depth.z_m(2 * y + a / 2, 2 * x + a % 2); };
            for (int y = 0; y < mip.rows; ++y)
                for (int x = 0; x < mip.cols; ++x) {
                    const float expected = reference::nearest_mean(
                        {at(2 * x, 2 * y), at(2 * x, 2 * y + 1), at(2 * x + 1, 2 * y), at(2 * x + 1, 2 * y + 1)}, phi);
                    if (scan)
                        agreement.add(std::abs(mip(y, x) - expected) <= 1e-6F * expected);
                    else
                        agreement.add(mip(y, x) == reference::half_toward_zero(expected));
                }
        }
        EXPECT_GE(agreement.share(), 0.999) << (scan ? "scan" : "reference");
    }
}

TEST_F(cacao_formulas, normals_are_those_of_the_four_quadrants) {
    // Every derived normal of a scene with holes, from depth, up to one step of its storage. The reference replicates
    // depth at the rim and knows no holes (it is given none); scan takes a hole of one pixel to lie on the line of 1/z
    // to what is beyond it, within the block of 2x2 and the pixels around it. It has no normal where no quadrant is
    // whole.
    const DepthImage whole = ball_on_floor(camera_of(125)), punched = with_holes(whole, 0.2);
    for (const bool scan : {true, false}) {
        const DepthImage& depth = scan ? punched : whole;
        const Seen seen =
            run(options(Quality::high, false, scan ? CacaoProfile::scan : CacaoProfile::reference), depth);
        const Pinhole& camera = depth.camera;
        const auto z_at = [&](int x, int y) {
            const bool inside = cv::Rect({0, 0}, usual).contains({x, y});
            if (scan && !inside)
                return 0.0F;
            return depth.z_m(std::clamp(y, 0, usual.height - 1), std::clamp(x, 0, usual.width - 1));
        };
        const auto place = [&](int x, int y, double z) {
            const Eigen::Vector3f point = camera.point(x, y, z).cast<float>();
            return cv::Vec3f(point.x(), -point.y(), point.z());
        };
        Agreement agreement;
        for (int y = 0; y < usual.height; ++y)
            for (int x = 0; x < usual.width; ++x) {
                if (depth.z_m(y, x) == 0)
                    continue;
                const float own = z_at(x, y);
                const auto towards = [&](int dx, int dy) {
                    const float next = z_at(x + dx, y + dy), beyond = z_at(x + 2 * dx, y + 2 * dy);
                    const bool across_the_block = dx == 1 - 2 * (x % 2) || dy == 1 - 2 * (y % 2);
                    return scan && across_the_block && next == 0 && beyond > 0 ? 2 / (1 / own + 1 / beyond) : next;
                };
                const Around z{towards(-1, 0), towards(1, 0), towards(0, -1), towards(0, 1)};
                const Around e = scan ? reference::edges_of_inverse(own, z) : reference::edges(own, z);
                const cv::Vec3f n =
                    reference::normal_of(e, place(x, y, own), place(x - 1, y, z.left), place(x + 1, y, z.right),
                                         place(x, y - 1, z.top), place(x, y + 1, z.bottom));
                if (scan && cv::norm(n) < 0.01)
                    continue; // taken from a neighbour, or absent: another test
                const cv::Vec3f ours = seen.normals[static_cast<std::size_t>(x % 2 + 2 * (y % 2))](y / 2, x / 2);
                agreement.add(cv::norm(cv::normalize(n) - ours, cv::NORM_INF) <= 1.01 / (scan ? 511 : 127));
            }
        EXPECT_GE(agreement.share(), 0.998) << (scan ? "scan" : "reference");
        EXPECT_GT(agreement.all, 10000);
    }
}

TEST_F(cacao_formulas, one_blur_pass_is_the_documented_sum) {
    // From the AO and edges before the blur. The reference mirrors at the rim and rounds to 8 bits. Scan has 16 bits,
    // and nothing passes a cut edge.
    CacaoOptions o = options();
    o.blur_passes = 1;
    const Both maps = both(o, ball_on_floor(camera_of(125)));
    for (const Seen* seen : {&maps.scan, &maps.reference}) {
        const bool scan = seen == &maps.scan;
        Agreement agreement;
        for (std::size_t a = 0; a < 4; ++a) {
            const cv::Mat1f& v = seen->raw[a].ao;
            const auto half = [&](float value) { return scan ? value : reference::half_even(value); };
            for (int y = 0; y < v.rows; ++y)
                for (int x = 0; x < v.cols; ++x) {
                    const auto at = [&](int u, int w) {
                        return half(v(std::clamp(w, 0, v.rows - 1), std::clamp(u, 0, v.cols - 1)));
                    };
                    const int byte = seen->raw[a].edges(y, x);
                    Around e = reference::unpacked(byte, o.sharpness < 1 ? 1 - o.sharpness : 0);
                    if (scan)
                        e = {byte >> 6 & 3 ? e.left : 0, byte >> 4 & 3 ? e.right : 0, byte >> 2 & 3 ? e.top : 0,
                             byte & 3 ? e.bottom : 0};
                    const float expected =
                        reference::blurred(at(x, y), {at(x - 1, y), at(x + 1, y), at(x, y - 1), at(x, y + 1)}, e);
                    const float ours = seen->blurred[a].ao(y, x);
                    if (scan)
                        agreement.add(std::abs(ours - expected) <= 1.01F / 65535);
                    else
                        agreement.add(std::nearbyint(255 * ours) == std::nearbyint(255 * half(expected)));
                    EXPECT_EQ(seen->blurred[a].edges(y, x), byte);
                }
        }
        EXPECT_GE(agreement.share(), 0.999) << (scan ? "scan" : "reference");
    }
}

TEST_F(cacao_formulas, high_is_the_documented_kernel) {
    // Every texel of every slice, from its depth mips and normals: 12 tap pairs, detail shadows, edges,
    // fade. Ties of taps and mips may go the other way.
    const Seen seen = run(options(Quality::high, false, CacaoProfile::reference), ball_on_floor(camera_of(125)));
    Agreement agreement;
    for (int a = 0; a < 4; ++a) {
        const auto i = static_cast<std::size_t>(a);
        const reference::High cpu{seen.k, a, seen.depth[i], seen.normals[i]};
        for (int y = 0; y < seen.k.slice.y; ++y)
            for (int x = 0; x < seen.k.slice.x; ++x)
                agreement.add(std::abs(std::nearbyint(255 * cpu(x, y)) - std::nearbyint(255 * seen.raw[i].ao(y, x))) <=
                              1);
    }
    EXPECT_GE(agreement.share(), 0.999);
}

// --- C. tables and sizes

TEST_F(cacao_passes, every_configuration_is_sound) {
    // Twenty configurations, two profiles, zero to eight blur passes. Passes read only buffers already written, and the
    // last one writes the map.
    for (const auto& [profile_word, profile] : cacao_profile_words)
        for (const auto& [quality_word, quality] : quality_words)
            for (const bool downsampled : {false, true})
                for (const bool supplied : {false, true})
                    for (int blur = 0; blur <= 8; ++blur)
                        for (const cv::Size size : {cv::Size(1, 1), cv::Size(641, 479)}) {
                            CacaoOptions o = options(quality, downsampled, profile);
                            o.blur_passes = blur;
                            const CacaoTables tables =
                                cacao_tables(o, constants_from(o, camera_of(500, size)), supplied);
                            const CacaoTables in_images = cacao_tables(o, constants_from(o, camera_of(500, size)),
                                                                       supplied, CacaoStorage::images);
                            for (const CacaoTables* each : {&tables, &in_images}) {
                                if (each == &in_images && !o.scan())
                                    continue;
                                const auto wrong = gpu::problems(each->buffers, each->passes);
                                EXPECT_TRUE(wrong.empty())
                                    << profile_word << " " << quality_word << ": " << wrong.front();
                                EXPECT_EQ(each->passes.back().writes.front(), cacao_out);
                                EXPECT_EQ(each->buffers.size(), static_cast<std::size_t>(cacao_buffer_count));
                            }
                        }
}

TEST_F(cacao_passes, odd_and_tiny_images_run_without_a_word_of_validation) {
    // Out-of-range accesses and missing barriers show at sizes that no tile divides. TearDown reads the messages.
    if (!device().validating())
        GTEST_SKIP() << "the validation layer is not installed";
    const std::vector<std::pair<Quality, bool>> modes{
        {Quality::highest, true},  {Quality::lowest, true}, {Quality::high, false},   {Quality::medium, true},
        {Quality::highest, false}, {Quality::low, true},    {Quality::lowest, false}, {Quality::high, true}};
    std::size_t next = 0;
    for (const cv::Size size : {cv::Size(1, 1), cv::Size(1, 9), cv::Size(3, 2), cv::Size(641, 479)})
        for (const CacaoProfile profile : {CacaoProfile::scan, CacaoProfile::reference}) {
            const auto& [quality, downsampled] = modes[next++];
            for (const CacaoStorage storage : {CacaoStorage::buffers, CacaoStorage::images}) {
                CacaoOptions o = options(quality, downsampled, profile);
                o.storage = storage;
                Cacao cacao(device(), o);
                const DepthImage depth = flat(camera_of(500, size), 2);
                const cv::Mat1f v = cacao.compute({depth}).visibility;
                EXPECT_EQ(v.size(), size);
                if (o.scan()) {
                    EXPECT_GE(lowest(v), 0.999)
                        << size << " " << name_of(quality) << " in " << name_of(storage) << ": a plane is open";
                }
                silent();
            }
        }
}

TEST_F(cacao_passes, both_storages_make_the_same_map) {
    // Buffers are faster on CPUs, images and fused passes on GPUs, and both run one algorithm. The runs cover holes,
    // odd sizes, and zero to seven blur steps, fused or not.
    const DepthImage depth = with_holes(ball_on_floor(camera_of(125, {161, 119})), 0.05);
    const std::vector<std::pair<Quality, bool>> modes{
        {Quality::lowest, true}, {Quality::lowest, false}, {Quality::low, true},     {Quality::medium, false},
        {Quality::high, true},   {Quality::high, false},   {Quality::highest, true}, {Quality::highest, false}};
    for (std::size_t blur = 0; blur < modes.size(); ++blur) {
        const auto& [quality, downsampled] = modes[blur];
        CacaoOptions o = options(quality, downsampled);
        o.blur_passes = static_cast<int>(blur);
        o.storage = CacaoStorage::buffers;
        const cv::Mat1f expected = Cacao(device(), o).compute({depth}).visibility;
        o.storage = CacaoStorage::images;
        const cv::Mat1f ours = Cacao(device(), o).compute({depth}).visibility;
        EXPECT_EQ(cv::countNonZero((expected == expected) != (ours == ours)), 0)
            << name_of(quality) << ": the same holes";
        const cv::Mat1f apart = difference(ours, expected);
        EXPECT_LE(average(apart), 0.1 / 255) << name_of(quality) << " " << downsampled;
        EXPECT_LE(cv::countNonZero(apart > 2.0 / 255), static_cast<int>(apart.total()) / 500)
            << name_of(quality) << " " << downsampled;
        silent();
    }
}

// --- D. kinds of depth

TEST_F(cacao_depth_input, device_depth_is_the_same_scene) {
    // z = mu / (alpha - d) undoes the projection for both orders of near and far, up to the rounding of d: the same
    // map.
    const DepthImage metric = ball_on_floor(camera_of(125));
    const double n = 0.1, f = 1000;
    for (const CacaoProfile profile : {CacaoProfile::scan, CacaoProfile::reference}) {
        CacaoOptions o = options(Quality::high, false, profile);
        const cv::Mat1f expected = run(o, metric).visibility;
        for (const CacaoDepthInput kind : {CacaoDepthInput::normal_z, CacaoDepthInput::reverse_z}) {
            o.depth_input = kind;
            DepthImage device_depth{metric.camera, cv::Mat1f(usual), {}};
            for (int i = 0; i < usual.area(); ++i) {
                const double z = metric.z_m(i / usual.width, i % usual.width);
                const double d =
                    kind == CacaoDepthInput::normal_z ? f / (f - n) * (1 - n / z) : n / (f - n) * (f / z - 1);
                device_depth.z_m(i / usual.width, i % usual.width) = static_cast<float>(d);
            }
            const cv::Mat1f apart = difference(run(o, device_depth).visibility, expected);
            fmt::print("             {} {}: mean {:.4f}, worst {:.2f} of 255\n", name_of(profile), name_of(kind),
                       255 * average(apart), 255 * highest(apart));
            EXPECT_LE(average(apart), 0.1 / 255) << name_of(profile) << " " << name_of(kind);
            EXPECT_LE(cv::countNonZero(apart > 2.001 / 255), usual.area() / 1000)
                << name_of(profile) << " " << name_of(kind);
        }
    }
}

// --- E. goldens

TEST_F(cacao_golden, maps_are_as_they_were) {
    // A change of a map must not go unnoticed. UPDATE_GOLDEN=1 rewrites the maps, and the change is reviewed with the
    // code. Devices may differ in single pixels; a changed formula differs everywhere.
    namespace fs = std::filesystem;
    struct Case {
        Quality quality;
        bool downsampled;
        CacaoProfile profile;
    };
    const DepthImage whole = ball_on_floor(test_camera({96, 72})), punched = with_holes(whole, 0.1);
    for (const Case& c :
         {Case{Quality::high, false, CacaoProfile::scan}, Case{Quality::highest, true, CacaoProfile::scan},
          Case{Quality::high, false, CacaoProfile::reference}, Case{Quality::low, true, CacaoProfile::reference}}) {
        const std::string name = fmt::format("cacao_{}_{}{}.png", name_of(c.profile), name_of(c.quality),
                                             c.downsampled ? "_downsampled" : "");
        const fs::path file = fs::path(SCANSHADE_SOURCE) / "tests/golden" / name;
        CacaoOptions o = options(c.quality, c.downsampled, c.profile);
        o.radius = 1;
        Cacao cacao(device(), o);
        const bool scan = o.scan();
        const cv::Mat1f ours = cacao.compute({scan ? punched : whole}).visibility;
        if (const char* update = std::getenv("UPDATE_GOLDEN"); update && std::string(update) == "1")
            write_ao(file, ours, AoFormat::png16);
        const cv::Mat1f golden = read_ao(file);
        ASSERT_EQ(golden.size(), ours.size()) << name;
        EXPECT_EQ(cv::countNonZero((golden == golden) != (ours == ours)), 0) << name << ": the same holes";
        const cv::Mat1f apart = difference(golden, ours);
        // From one driver to another AMD's own shaders break ties of texels differently, most in the plain upsampler.
        const bool ties = !scan && device().info().kind != "CPU";
        if (average(apart) <= 0.3 / 255 && (ties || highest(apart) <= 6.0 / 255))
            continue;
        const fs::path folder = fs::path(SCANSHADE_PROGRAM).parent_path() / "golden_failures";
        fs::create_directories(folder);
        write_ao(folder / name, ours, AoFormat::png16);
        write_ao(folder / ("difference_" + name), cv::Mat1f(cv::min(apart * 16, 1.0)), AoFormat::png16);
        ADD_FAILURE() << fmt::format(
            "{}: mean difference {:.2f}, worst {:.1f} of 255; map and 16 times the difference in {}", name,
            255 * average(apart), 255 * highest(apart), folder.string());
    }
}

} // namespace
} // namespace scanshade
