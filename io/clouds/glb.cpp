#include "io/clouds/glb.h"

#include "io/output_file.h"
#include "io/text.h"
#include "projection/base/error.h"
#include "projection/base/memory.h"
#include "projection/srgb.h"

#include <algorithm>
#include <bit>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <Eigen/Geometry>
#include <fmt/format.h>
#include <limits>
#include <nlohmann/json.hpp>

namespace scanshade {

namespace {

using Eigen::Vector3d;
using Json = nlohmann::ordered_json;

static_assert(std::endian::native == std::endian::little, "glTF's numbers are little-endian");

// glTF's words (section 5.1.3 and on).
constexpr int float32 = 5126, uint32 = 5125, uint16 = 5123, for_vertices = 34962, for_indices = 34963, points_mode = 0,
              triangles_mode = 4;

/// Whether a point of a cloud is written, or may be a corner of a mesh.
std::vector<bool> kept_points(const GlbScene& scene, GlbWritten& written) {
    std::vector<bool> kept(scene.points.size());
    for (std::size_t i = 0; i < kept.size(); ++i) {
        const bool known =
            std::ranges::none_of(scene.fields, [&](const AddedField& f) { return std::isnan(f.values[i]); });
        kept[i] = scene.points[i].allFinite() && (known || !scene.triangles.empty());
        written.points += kept[i];
        written.unknown += kept[i] && !known;
    }
    written.left_out = kept.size() - written.points;
    return kept;
}

Eigen::AlignedBox3d box_of(std::span<const Vector3d> points, const std::vector<bool>& kept) {
    Eigen::AlignedBox3d box;
    for (std::size_t i = 0; i < points.size(); ++i)
        if (kept[i])
            box.extend(points[i]);
    return box;
}

/// Whole numbers amid the points where floats would round them by more than a quarter of a millimetre.
Vector3d origin_of(std::span<const Vector3d> points, const std::vector<bool>& kept) {
    constexpr double far_away = 4096;
    const Eigen::AlignedBox3d box = box_of(points, kept);
    if (box.isEmpty() || std::max(box.min().cwiseAbs().maxCoeff(), box.max().cwiseAbs().maxCoeff()) <= far_away)
        return Vector3d::Zero();
    return box.center().array().round();
}

/// How the node turns: x, y, z, w of a quaternion.
std::array<double, 4> turn_of(UpAxis up) {
    const double half = std::sqrt(0.5);
    switch (up) {
    case UpAxis::z: // a quarter about x
        return {-half, 0, 0, half};
    case UpAxis::minus_y: // half about x: from z forward to glTF's cameras, which look along -z
        return {1, 0, 0, 0};
    case UpAxis::unknown:
        break;
    }
    return {0, 0, 0, 1};
}

/// The same turn, without rounding.
Vector3d turned(const Vector3d& point, UpAxis up) {
    switch (up) {
    case UpAxis::z:
        return {point.x(), point.z(), -point.y()};
    case UpAxis::minus_y:
        return {point.x(), -point.y(), -point.z()};
    case UpAxis::unknown:
        break;
    }
    return point;
}

/// A file on its way: each attribute is a view of the one buffer.
class Glb {
  public:
    Glb(const GlbScene& scene, GlbWritten& written) : scene_(scene), kept_(kept_points(scene, written)) {
        count_ = written.points;
        if (count_ > 0)
            add_all(written);
    }

    [[nodiscard]] std::string bytes() {
        json_["asset"] = {{"version", "2.0"}, {"generator", std::string("scanshade ") + SCANSHADE_VERSION}};
        json_["scene"] = 0;
        json_["scenes"] = {{{"name", scene_.name}}};
        if (count_ > 0)
            describe_scene();
        constexpr auto replace = Json::error_handler_t::replace;
        std::string text = json_.dump(-1, ' ', false, replace);
        text.resize((text.size() + whole() - 1) / whole() * whole(), ' ');
        constexpr std::size_t head = 12, chunk_head = 8;
        const std::size_t total = head + chunk_head + text.size() + (buffer_.empty() ? 0 : chunk_head + buffer_.size());
        std::string all;
        all.reserve(total);
        all += "glTF";
        append(all, std::uint32_t(2));
        append(all, static_cast<std::uint32_t>(total));
        append(all, static_cast<std::uint32_t>(text.size()));
        all += "JSON" + text;
        if (!buffer_.empty()) {
            append(all, static_cast<std::uint32_t>(buffer_.size()));
            all += std::string("BIN\0", 4);
            all += buffer_;
        }
        return all;
    }

  private:
    /// Bytes that chunks have a multiple of.
    [[nodiscard]] std::size_t whole() const { return scene_.tile ? 8 : 4; }

    template <class Number>
    static void append(std::string& bytes, Number value) {
        const auto raw = std::bit_cast<std::array<char, sizeof value>>(value);
        bytes.append(raw.data(), raw.size());
    }

    void add_all(GlbWritten& written) {
        const std::vector<std::uint32_t> indices = indices_of(written);
        const bool normals = has_normals();
        written.has_normals = normals;
        require_room(indices.size(), normals);
        add_positions();
        if (normals)
            add_view("NORMAL", float32, "VEC3", count_, [&](std::size_t i) {
                const Vector3d normal = scene_.normals[i].normalized();
                for (const double axis : normal)
                    append(buffer_, static_cast<float>(axis));
            });
        if (!scene_.colours.empty())
            add_view("COLOR_0", uint16, "VEC4", count_, [&](std::size_t i) { append_colour(scene_.colours[i]); });
        if (!scene_.colours.empty())
            accessors_.back()["normalized"] = true;
        for (const AddedField& field : scene_.fields)
            add_view(field.name, float32, "SCALAR", count_,
                     [&](std::size_t i) { append(buffer_, std::isnan(field.values[i]) ? -1.0F : field.values[i]); });
        if (scene_.tile)
            describe_fields();
        if (indices.empty())
            return buffer_.resize((buffer_.size() + whole() - 1) / whole() * whole(), '\0');
        primitive_["indices"] = accessors_.size();
        describe_view(uint32, "SCALAR", indices.size(), for_indices, [&] {
            for (const std::uint32_t index : indices)
                append(buffer_, index);
        });
    }

    /// Refused before anything is made.
    void require_room(std::size_t indices, bool normals) const {
        const std::size_t floats = 3 + (normals ? 3 : 0) + (scene_.colours.empty() ? 0 : 2) + scene_.fields.size();
        const std::uint64_t bytes = (std::uint64_t(count_) * floats + indices) * sizeof(float);
        constexpr std::uint64_t most = std::numeric_limits<std::uint32_t>::max(), heads = 1 << 16;
        if (bytes > most - heads)
            throw Error(fmt::format("{} would take {}, but glTF's files end at 4 GiB", counted(count_, "point"),
                                    counted(bytes, "byte")));
        require_memory(2 * bytes, fmt::format("glTF of {}", counted(count_, "point")));
    }

    /// All kept points have a direction.
    [[nodiscard]] bool has_normals() const {
        if (scene_.normals.empty())
            return false;
        constexpr double least = 1e-6;
        for (std::size_t i = 0; i < kept_.size(); ++i)
            if (kept_[i] && !(scene_.normals[i].norm() > least && scene_.normals[i].allFinite()))
                return false;
        return true;
    }

    [[nodiscard]] std::vector<std::uint32_t> indices_of(GlbWritten& written) const {
        std::vector<std::uint32_t> indices;
        if (scene_.triangles.empty())
            return indices;
        std::vector<std::uint32_t> place(kept_.size());
        for (std::uint32_t i = 0, next = 0; i < kept_.size(); ++i)
            place[i] = kept_[i] ? next++ : 0;
        indices.reserve(3 * scene_.triangles.size());
        for (const std::array<int, 3>& triangle : scene_.triangles) {
            const bool whole = std::ranges::all_of(triangle, [&](int corner) {
                return corner >= 0 && static_cast<std::size_t>(corner) < kept_.size() &&
                       kept_[static_cast<std::size_t>(corner)];
            });
            written.triangles += whole;
            written.triangles_left_out += !whole;
            for (const int corner : triangle)
                if (whole)
                    indices.push_back(place[static_cast<std::size_t>(corner)]);
        }
        return indices;
    }

    void add_positions() {
        origin_ = scene_.tile ? Vector3d(box_of(scene_.points, kept_).center()) : origin_of(scene_.points, kept_);
        Eigen::Vector3f low, high;
        low.setConstant(std::numeric_limits<float>::max());
        high.setConstant(std::numeric_limits<float>::lowest());
        add_view("POSITION", float32, "VEC3", count_, [&](std::size_t i) {
            const Eigen::Vector3f point = (scene_.points[i] - origin_).cast<float>();
            low = low.cwiseMin(point);
            high = high.cwiseMax(point);
            for (const float coordinate : point)
                append(buffer_, coordinate);
        });
        accessors_.back()["min"] = {low.x(), low.y(), low.z()};
        accessors_.back()["max"] = {high.x(), high.y(), high.z()};
    }

    void append_colour(const cv::Vec3b& bgr) {
        static const auto linear = [] {
            std::array<std::uint16_t, 256> table{};
            for (std::size_t i = 0; i < table.size(); ++i)
                table[i] =
                    static_cast<std::uint16_t>(std::lround(linear_from_srgb(static_cast<double>(i) / 255) * 65535));
            return table;
        }();
        for (const int channel : {2, 1, 0})
            append(buffer_, linear[bgr[channel]]);
        append(buffer_, std::numeric_limits<std::uint16_t>::max()); // opaque
    }

    /// Fills a view with one element after the other.
    template <class Element>
    void add_view(const std::string& name, int type, const char* shape, std::size_t count, const Element& element) {
        primitive_["attributes"][name] = accessors_.size();
        describe_view(type, shape, count, for_vertices, [&] {
            for (std::size_t i = 0; i < kept_.size(); ++i)
                if (kept_[i])
                    element(i);
        });
    }

    template <class Fill>
    void describe_view(int type, const char* shape, std::size_t count, int target, const Fill& fill) {
        const std::size_t at = buffer_.size();
        fill();
        accessors_.push_back(
            {{"bufferView", views_.size()}, {"componentType", type}, {"count", count}, {"type", shape}});
        views_.push_back({{"buffer", 0}, {"byteOffset", at}, {"byteLength", buffer_.size() - at}, {"target", target}});
    }

    /// _AMBIENT_OCCLUSION is the property ambient_occlusion of each point, and so on.
    void describe_fields() {
        Json described, named;
        for (const AddedField& field : scene_.fields) {
            std::string name = field.name.substr(field.name.find_first_not_of('_'));
            std::ranges::transform(name, name.begin(),
                                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
            described[name] = {{"type", "SCALAR"}, {"componentType", "FLOAT32"}, {"required", true}};
            named[name] = {{"attribute", field.name}};
        }
        json_["extensionsUsed"].push_back("EXT_structural_metadata");
        json_["extensions"]["EXT_structural_metadata"] = {
            {"schema", {{"id", "scanshade"}, {"classes", {{"point", {{"properties", described}}}}}}},
            {"propertyAttributes", Json::array({{{"class", "point"}, {"properties", named}}})}};
        primitive_["extensions"]["EXT_structural_metadata"] = {{"propertyAttributes", {0}}};
    }

    void describe_scene() {
        primitive_["material"] = 0;
        primitive_["mode"] = primitive_.contains("indices") ? triangles_mode : points_mode;
        json_["accessors"] = accessors_;
        json_["bufferViews"] = views_;
        json_["buffers"] = {{{"byteLength", buffer_.size()}}};
        json_["extensionsUsed"].push_back("KHR_materials_unlit");
        json_["materials"] = {{{"name", "colours as stored"},
                               {"pbrMetallicRoughness", {{"metallicFactor", 0}, {"roughnessFactor", 1}}},
                               {"doubleSided", true},
                               {"extensions", {{"KHR_materials_unlit", Json::object()}}}}};
        json_["meshes"] = {{{"name", scene_.name}, {"primitives", {primitive_}}}};
        Json node{{"name", scene_.name}, {"mesh", 0}};
        if (scene_.up != UpAxis::unknown)
            node["rotation"] = turn_of(scene_.up);
        if (!origin_.isZero()) {
            const Vector3d there = turned(origin_, scene_.up);
            node["translation"] = {there.x(), there.y(), there.z()};
        }
        json_["nodes"] = {node};
        json_["scenes"][0]["nodes"] = {0};
    }

    const GlbScene& scene_;
    std::vector<bool> kept_;
    std::size_t count_ = 0;
    Vector3d origin_ = Vector3d::Zero();
    std::string buffer_;
    Json json_, primitive_, accessors_ = Json::array(), views_ = Json::array();
};

} // namespace

GlbWritten write_glb(const std::filesystem::path& file, const GlbScene& scene) {
    GlbWritten written;
    const std::string bytes = during(file.string(), [&] {
        const auto check = [&](const std::string& what, std::size_t count) {
            if (count != scene.points.size())
                throw Error(fmt::format("{} has {} for {}", what, counted(count, "value"),
                                        counted(scene.points.size(), "point")));
        };
        for (const AddedField& field : scene.fields)
            check(field.name, field.values.size());
        if (!scene.colours.empty())
            check("COLOR_0", scene.colours.size());
        if (!scene.normals.empty())
            check("NORMAL", scene.normals.size());
        return Glb(scene, written).bytes();
    });
    write_atomically(file, bytes);
    return written;
}

std::vector<std::string> describe(const GlbWritten& written, UpAxis up, const std::string& file) {
    std::vector<std::string> sentences;
    if (written.left_out > 0)
        sentences.push_back(fmt::format("{}: {} without coordinates or without a value left out.", file,
                                        counted(written.left_out, "point")));
    if (written.unknown > 0)
        sentences.push_back(fmt::format("{}: {} without a value have -1.", file, counted(written.unknown, "point")));
    if (written.triangles_left_out > 0)
        sentences.push_back(fmt::format("{}: {} with missing corners left out.", file,
                                        counted(written.triangles_left_out, "triangle")));
    if (up == UpAxis::unknown)
        sentences.push_back(fmt::format("{}: the up direction is not known; its axes are the cloud's.", file));
    return sentences;
}

} // namespace scanshade
