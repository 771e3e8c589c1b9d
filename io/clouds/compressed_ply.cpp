// PLY of splats as PlayCanvas and SuperSplat pack it: what lies in 32 bits, high bits first, is a share of the way
// between the limits of a chunk of 256 splats.
#include "io/clouds/packed_splats.h"
#include "io/clouds/splats.h"
#include "projection/base/error.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <limits>
#include <numbers>
#include <optional>
#include <tbb/parallel_for.h>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

using Eigen::Vector3f;

constexpr std::size_t per_chunk = 256;
constexpr float full_byte = 255;

/// `bits` bits from `shift` on, as 0 .. 1.
float share(std::uint32_t word, unsigned shift, unsigned bits) {
    const std::uint32_t most = (1U << bits) - 1;
    return static_cast<float>(word >> shift & most) / static_cast<float>(most);
}
/// Of 11, 10 and 11 bits.
Vector3f shares(std::uint32_t word) { return {share(word, 21, 11), share(word, 11, 10), share(word, 0, 11)}; }

/// Two bits tell the largest of w x y z; the others follow in order.
Eigen::Quaternionf packed_rotation(std::uint32_t word) {
    const std::uint32_t largest = word >> 30;
    std::array<float, 4> wxyz{};
    float rest = 1;
    unsigned shift = 20;
    for (std::uint32_t k = 0; k < wxyz.size(); ++k)
        if (k != largest) {
            wxyz[k] = (share(word, shift, 10) - 0.5F) * std::numbers::sqrt2_v<float>;
            rest -= wxyz[k] * wxyz[k];
            shift -= 10;
        }
    wxyz[largest] = std::sqrt(std::max(rest, 0.0F));
    return {wxyz[0], wxyz[1], wxyz[2], wxyz[3]};
}

float coefficient_of(unsigned char code) {
    constexpr float reach = 4;
    if (code == 0 || code == full_byte)
        return code == 0 ? -reach : reach;
    return ((static_cast<float>(code) + 0.5F) / 256 - 0.5F) * 2 * reach;
}
unsigned char code_of(double coefficient) {
    return static_cast<unsigned char>(std::clamp(std::floor((coefficient / 8 + 0.5) * 256), 0.0, 255.0));
}

/// Where everything lies in the file.
struct Layout {
    PlyTable chunks, splats;
    std::optional<PlyTable> rest; ///< f_rest_0 ..., a byte each
    std::array<std::size_t, 3> position_low, position_high, scale_low, scale_high;
    std::optional<std::array<std::size_t, 3>> colour_low, colour_high; ///< none: 0 .. 1
    std::size_t position, rotation, scale, colour;
};

std::array<std::size_t, 3> offsets(const PlyTable& table, const std::string& prefix, std::string_view axes) {
    std::array<std::size_t, 3> found;
    for (std::size_t k = 0; k < 3; ++k)
        found[k] = table.offset_of(prefix + axes[k], Scalar::float32);
    return found;
}

const PlyTable* table_named(const std::vector<PlyTable>& tables, std::string_view name) {
    const auto found = std::ranges::find(tables, name, &PlyTable::name);
    return found == tables.end() ? nullptr : &*found;
}

Layout layout_of(std::string_view bytes, const fs::path& file) {
    const std::vector<PlyTable> tables = ply_tables(bytes, file);
    const PlyTable *chunks = table_named(tables, "chunk"), *splats = table_named(tables, "vertex");
    const PlyTable* rest = table_named(tables, "sh");
    if (!chunks || !splats)
        throw Error(
            fmt::format("{}: no element {}, which packed splats have", file.string(), chunks ? "vertex" : "chunk"));
    return during(file.string(), [&] {
        if (const std::size_t needed = (splats->rows + per_chunk - 1) / per_chunk; chunks->rows != needed)
            throw Error(fmt::format("{} chunks, {} splats need {}", chunks->rows, splats->rows, needed));
        if (const std::size_t end = tables.back().end(); end < bytes.size())
            throw Error(fmt::format("{} bytes after the last element", bytes.size() - end));
        if (rest && (rest->rows != splats->rows || (rest->stride != 9 && rest->stride != 24 && rest->stride != 45)))
            throw Error(fmt::format("element sh has {} rows of {} bytes, expected {} of 9, 24 or 45", rest->rows,
                                    rest->stride, splats->rows));
        for (std::size_t k = 0; rest && k < rest->stride; ++k)
            if (rest->offset_of(fmt::format("f_rest_{}", k), Scalar::uint8) != k)
                throw Error(fmt::format("f_rest_{} is not in its place in element sh", k));
        Layout layout{.chunks = *chunks,
                      .splats = *splats,
                      .rest = rest ? std::optional(*rest) : std::nullopt,
                      .position_low = offsets(*chunks, "min_", "xyz"),
                      .position_high = offsets(*chunks, "max_", "xyz"),
                      .scale_low = offsets(*chunks, "min_scale_", "xyz"),
                      .scale_high = offsets(*chunks, "max_scale_", "xyz"),
                      .colour_low = std::nullopt,
                      .colour_high = std::nullopt,
                      .position = splats->offset_of("packed_position", Scalar::uint32),
                      .rotation = splats->offset_of("packed_rotation", Scalar::uint32),
                      .scale = splats->offset_of("packed_scale", Scalar::uint32),
                      .colour = splats->offset_of("packed_color", Scalar::uint32)};
        constexpr std::size_t with_colours = 18 * sizeof(float);
        if (chunks->stride == with_colours) {
            layout.colour_low = offsets(*chunks, "min_", "rgb");
            layout.colour_high = offsets(*chunks, "max_", "rgb");
        }
        return layout;
    });
}

/// Reads the file's rows.
class Rows {
  public:
    Rows(std::string_view bytes, const Layout& layout) : bytes_(bytes), layout_(layout) {}

    [[nodiscard]] std::uint32_t word(std::size_t splat, std::size_t offset) const {
        return static_cast<std::uint32_t>(
            decoded(bytes_.data() + layout_.splats.at + splat * layout_.splats.stride + offset, Scalar::uint32, false));
    }
    [[nodiscard]] Vector3f limit(std::size_t splat, const std::array<std::size_t, 3>& offsets) const {
        const char* const row = bytes_.data() + layout_.chunks.at + splat / per_chunk * layout_.chunks.stride;
        Vector3f values;
        for (int k = 0; k < 3; ++k)
            values[k] = static_cast<float>(decoded(row + offsets[static_cast<std::size_t>(k)], Scalar::float32, false));
        return values;
    }
    [[nodiscard]] Vector3f between(std::size_t splat, const std::array<std::size_t, 3>& low,
                                   const std::array<std::size_t, 3>& high, const Vector3f& shares) const {
        const Vector3f from = limit(splat, low);
        return from + (limit(splat, high) - from).cwiseProduct(shares);
    }
    [[nodiscard]] Vector3f colour(std::size_t splat) const {
        const std::uint32_t bits = word(splat, layout_.colour);
        const Vector3f shares(share(bits, 24, 8), share(bits, 16, 8), share(bits, 8, 8));
        return layout_.colour_low ? between(splat, *layout_.colour_low, *layout_.colour_high, shares) : shares;
    }

  private:
    std::string_view bytes_;
    const Layout& layout_;
};

/// Puts the colours of a chunk in place, between new limits.
void put_colours(std::string& bytes, const Layout& layout, std::size_t first, std::span<const Vector3f> colours) {
    Vector3f low = Vector3f::Zero(), high = Vector3f::Ones();
    if (layout.colour_low) {
        low = high = colours.front();
        for (const Vector3f& colour : colours)
            low = low.cwiseMin(colour), high = high.cwiseMax(colour);
        char* const row = bytes.data() + layout.chunks.at + first / per_chunk * layout.chunks.stride;
        for (std::size_t k = 0; k < 3; ++k) {
            std::memcpy(row + (*layout.colour_low)[k], &low[static_cast<int>(k)], sizeof(float));
            std::memcpy(row + (*layout.colour_high)[k], &high[static_cast<int>(k)], sizeof(float));
        }
    }
    for (std::size_t i = 0; i < colours.size(); ++i) {
        char* const at = bytes.data() + layout.splats.at + (first + i) * layout.splats.stride + layout.colour;
        for (int k = 0; k < 3; ++k) { // red has the highest byte, which comes last
            const float width = high[k] - low[k], part = width > 0 ? (colours[i][k] - low[k]) / width : 0;
            at[3 - k] = static_cast<char>(cv::saturate_cast<unsigned char>(full_byte * part));
        }
    }
}

} // namespace

CloudRecords read_compressed_ply(std::string_view bytes, const fs::path& file, std::vector<std::string>&) {
    const Layout layout = layout_of(bytes, file);
    const Rows rows(bytes, layout);
    SplatTable table(layout.splats.rows, file);
    tbb::parallel_for(std::size_t(0), layout.splats.rows, [&](std::size_t i) {
        table.set(
            i, {.position =
                    rows.between(i, layout.position_low, layout.position_high, shares(rows.word(i, layout.position))),
                .colour = rows.colour(i),
                .log_sigma = rows.between(i, layout.scale_low, layout.scale_high, shares(rows.word(i, layout.scale))),
                .opacity = share(rows.word(i, layout.colour), 0, 8),
                .rotation = packed_rotation(rows.word(i, layout.rotation))});
    });
    return std::move(table).records(std::string(bytes));
}

std::string shaded_compressed_ply(const CloudRecords& records, std::span<const float> visibility, double strength) {
    std::string bytes = records.packed;
    const Layout layout = layout_of(records.packed, "the file that was read");
    const Rows rows(records.packed, layout);
    tbb::parallel_for(std::size_t(0), layout.chunks.rows, [&](std::size_t chunk) {
        const std::size_t first = chunk * per_chunk, end = std::min(first + per_chunk, layout.splats.rows);
        std::vector<Vector3f> colours;
        bool changed = false;
        for (std::size_t i = first; i < end; ++i) {
            const double light = light_of(visibility[i], strength);
            const Vector3f colour = rows.colour(i);
            changed |= light != 1;
            colours.push_back(light == 1 ? colour : colour.unaryExpr([&](float c) {
                return static_cast<float>(shaded_channel(static_cast<double>(c), light));
            }));
            for (std::size_t k = 0; light != 1 && layout.rest && k < layout.rest->stride; ++k) {
                char& code = bytes[layout.rest->at + i * layout.rest->stride + k];
                const auto channel = static_cast<int>(k / (layout.rest->stride / 3));
                const double factor = shaded_factor(static_cast<double>(colour[channel]), light);
                code = static_cast<char>(
                    code_of(factor * static_cast<double>(coefficient_of(static_cast<unsigned char>(code)))));
            }
        }
        if (changed)
            put_colours(bytes, layout, first, colours);
    });
    return bytes;
}

} // namespace scanshade
