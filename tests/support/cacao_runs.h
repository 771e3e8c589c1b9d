// CACAO run with a look inside: what each pass leaves, through either profile, and the scenes and figures of its tests.
#pragma once

#include "ao/cacao/cacao.h"
#include "ao/gpu/transfer.h"
#include "projection/maps.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <functional>
#include <gtest/gtest.h>
#include <limits>
#include <map>
#include <memory>
#include <numbers>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace scanshade::tests {

using shared::CacaoConstants;

inline constexpr float nan = std::numeric_limits<float>::quiet_NaN();
inline const cv::Size usual(160, 120);

/// One device for all tests: opening it takes longer than a frame. It validates where the layer is installed.
inline gpu::Device& device() {
    static const int asked = setenv("SCANSHADE_VALIDATE", "1", 1);
    static gpu::Device opened;
    return (void)asked, opened;
}

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
inline std::uint32_t word_of(float ao, int edges, bool scan) {
    return static_cast<std::uint32_t>(std::nearbyint(ao * (scan ? 65535.0F : 255.0F))) |
           static_cast<std::uint32_t>(edges) << 16;
}

inline Slice slice_of(const std::uint32_t* words, cv::Size size, bool scan) {
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

inline cv::Vec3f normal_of(std::uint32_t word, bool scan) {
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

inline void upload(gpu::Program& program, int buffer, const cv::Mat& image) {
    ASSERT_EQ(program.host(buffer).size(), image.total() * image.elemSize());
    gpu::upload(image, program.host(buffer));
}

inline Seen run_tables(const CacaoOptions& o, const CacaoConstants& k, const CacaoTables& tables,
                       const DepthImage& depth, const cv::Mat3f& normals, const std::vector<std::uint32_t>& ao) {
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

inline Seen run(const CacaoOptions& o, const DepthImage& depth, const Given& given = {}) {
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
inline CacaoOptions options(Quality quality = Quality::high, bool downsampled = false,
                            CacaoProfile profile = CacaoProfile::scan) {
    CacaoOptions o;
    o.profile = profile;
    o.quality = quality;
    o.downsampled = downsampled;
    o.tone_curve = CacaoToneCurve::documented;
    return o;
}

inline std::string_view name_of(Quality quality) { return word_for(quality, quality_words); }
inline std::string_view name_of(CacaoProfile profile) { return word_for(profile, cacao_profile_words); }
inline std::string_view name_of(CacaoDepthInput input) { return word_for(input, cacao_depth_input_words); }
inline std::string_view name_of(CacaoStorage storage) { return storage == CacaoStorage::images ? "images" : "buffers"; }

/// The same through both profiles.
struct Both {
    Seen scan, reference;
};
inline Both both(CacaoOptions o, const DepthImage& depth, const Given& given = {}) {
    o.profile = CacaoProfile::scan;
    Seen scan = run(o, depth, given);
    o.profile = CacaoProfile::reference;
    return {std::move(scan), run(o, depth, given)};
}

/// Prints the figures that a test compares.
inline void measured(std::string_view what, double scan, double reference) {
    fmt::print("             {}: scan {:.4f}, reference {:.4f}\n", what, scan, reference);
}

// --- scenes and figures

inline Pinhole camera_of(double f, cv::Size size = usual) {
    return {f, f, (size.width - 1) / 2.0, (size.height - 1) / 2.0, size};
}

/// Normals of tilted_plane(), camera space.
inline cv::Mat3f plane_normals(cv::Size size, double tilt_degrees) {
    const double tilt = tilt_degrees * std::numbers::pi / 180;
    return cv::Mat3f(size, cv::Vec3f(static_cast<float>(std::sin(tilt)), 0, static_cast<float>(-std::cos(tilt))));
}

inline DepthImage flat(const Pinhole& camera, float z) { return {camera, cv::Mat1f(camera.size, z), {}}; }
/// A wall at z, and left of the middle column another at `left`.
inline DepthImage step(const Pinhole& camera, float left, float z) {
    DepthImage depth = flat(camera, z);
    depth.z_m.colRange(0, camera.size.width / 2) = left;
    return depth;
}

/// Of the values that are not NaN, where the mask is set.
struct Figures {
    double low = 0, high = 0, average = 0;
};
inline Figures figures(const cv::Mat1f& v, const cv::Mat& mask = {}) {
    cv::Mat known = v == v; // NOLINT(misc-redundant-expression): false for NaN
    if (!mask.empty())
        known &= mask;
    Figures f;
    cv::minMaxLoc(v, &f.low, &f.high, nullptr, nullptr, known);
    f.average = cv::mean(v, known)[0];
    return f;
}
inline double lowest(const cv::Mat1f& v, const cv::Mat& mask = {}) { return figures(v, mask).low; }
inline double highest(const cv::Mat1f& v, const cv::Mat& mask = {}) { return figures(v, mask).high; }
inline double average(const cv::Mat1f& v, const cv::Mat& mask = {}) { return figures(v, mask).average; }
inline cv::Mat1f difference(const cv::Mat1f& a, const cv::Mat1f& b) {
    cv::Mat1f d;
    cv::absdiff(a, b, d);
    return d;
}

class CacaoTest : public testing::Test {
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

} // namespace scanshade::tests
