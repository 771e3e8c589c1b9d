// Wavefront OBJ, line by line. Indices are checked when the whole file is known, since faces may come before what they
// name.
#include "io/clouds/meshes/mesh_file.h"

#include "io/text.h"
#include "projection/base/error.h"
#include "projection/base/memory.h"

#include <algorithm>
#include <cmath>
#include <Eigen/Geometry>
#include <fmt/format.h>
#include <limits>
#include <map>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

constexpr int none = -1;

/// What the lines `v`, `vt` or `vn` list, and the largest index of them that a face names.
struct IndexedList {
    const char *word, *things;
    std::size_t count = 0;
    std::size_t largest = 0; ///< index from 1
    int line = 0;            ///< of it
};

/// A corner of a face: indices from 0; none where a face does not say.
struct Corner {
    int point = none, texture = none, normal = none;
};

class ObjReader {
  public:
    ObjReader(const fs::path& file, std::vector<std::string>& warnings) : file_(file), warnings_(warnings) {}

    MeshFile read(std::string_view bytes) {
        std::string joined; // lines that end with a backslash, and the next one
        int number = 0;
        while (!bytes.empty()) {
            const std::size_t end = bytes.find('\n');
            std::string_view line = bytes.substr(0, end);
            bytes.remove_prefix(end == std::string_view::npos ? bytes.size() : end + 1);
            ++number;
            if (line.ends_with('\r'))
                line.remove_suffix(1);
            if (line.ends_with('\\')) {
                joined.append(line.substr(0, line.size() - 1)) += ' ';
                continue;
            }
            line_ = number;
            take(joined.empty() ? line : std::string_view(joined.append(line)));
            joined.clear();
        }
        for (const IndexedList& list : lists_)
            if (list.largest > list.count)
                throw Error(fmt::format("{}: {} {}, the file has {} {}", at_line(file_, list.line), list.word,
                                        list.largest, list.count, list.things));
        warn();
        return std::move(*this).mesh();
    }

  private:
    void take(std::string_view line) {
        line = line.substr(0, line.find('#'));
        const auto all = words(line);
        if (all.empty())
            return;
        if (all[0] == "v")
            take_point(all);
        else if (all[0] == "vt")
            take_coordinates(all);
        else if (all[0] == "vn")
            take_normal(all);
        else if (all[0] == "f" || all[0] == "fo") // its name in old files
            take_face(all);
        else if (all[0] == "usemtl")
            use_material(std::string(trimmed(line.substr(line.find("usemtl") + 6))));
        else if (all[0] == "curv" || all[0] == "surf" || all[0] == "curv2")
            ++surfaces_;
    }

    double number_in(const std::vector<std::string_view>& line, std::size_t word) const {
        if (word >= line.size())
            throw Error(fmt::format("{}: {} with {}, expected at least {}", at_line(file_, line_), line[0],
                                    counted(line.size() - 1, "number"), word));
        const auto value = number(line[word]);
        if (!value)
            throw Error(fmt::format("{}: {} is not a number", at_line(file_, line_), in_quotes(line[word])));
        return *value;
    }

    void take_point(const std::vector<std::string_view>& line) {
        read_.points.emplace_back(number_in(line, 1), number_in(line, 2), number_in(line, 3));
        ++lists_[0].count;
        if (line.size() < 7) // x y z [w]
            return;
        colours_.resize(3 * (read_.points.size() - 1), 0.0F);
        for (std::size_t channel = line.size() == 8 ? 5 : 4, i = 0; i < 3; ++i) // x y z [w] r g b
            colours_.push_back(static_cast<float>(number_in(line, channel + i)));
    }

    void take_coordinates(const std::vector<std::string_view>& line) {
        const double v = line.size() > 2 ? number_in(line, 2) : 0; // images of one row need none
        coordinates_.emplace_back(static_cast<float>(number_in(line, 1)), static_cast<float>(1 - v));
        ++lists_[1].count;
    }

    void take_normal(const std::vector<std::string_view>& line) {
        for (std::size_t i = 1; i <= 3; ++i)
            (void)number_in(line, i);
        normals_.emplace_back(
            Eigen::Vector3d(number_in(line, 1), number_in(line, 2), number_in(line, 3)).cast<float>());
        ++lists_[2].count;
    }

    /// An index from 1, or counted back from the last one; from 0 afterwards.
    int index(std::string_view word, IndexedList& list) const {
        const bool backwards = word.starts_with('-');
        const auto value = whole_number(backwards ? word.substr(1) : word);
        if (!value || *value == 0 || *value > std::numeric_limits<int>::max())
            throw Error(fmt::format("{}: {} is no index of {}", at_line(file_, line_), in_quotes(word), list.things));
        if (backwards && *value > list.count)
            throw Error(fmt::format("{}: {} {}, the file has {} {} so far", at_line(file_, line_), list.word, word,
                                    list.count, list.things));
        const std::size_t from_1 = backwards ? list.count + 1 - *value : *value;
        if (from_1 > list.largest) {
            list.largest = from_1;
            list.line = line_;
        }
        return static_cast<int>(from_1 - 1);
    }

    Corner corner_in(std::string_view word) {
        std::array<int, 3> found{none, none, none};
        for (std::size_t i = 0; i < found.size() && !word.empty(); ++i) {
            const std::size_t slash = word.find('/');
            if (const auto part = word.substr(0, slash); !part.empty())
                found[i] = index(part, lists_[i]);
            word.remove_prefix(slash == std::string_view::npos ? word.size() : slash + 1);
        }
        if (found[0] == none || !word.empty())
            throw Error(fmt::format("{}: a corner of a face names no vertex", at_line(file_, line_)));
        return {found[0], found[1], found[2]};
    }

    void take_face(const std::vector<std::string_view>& line) {
        if (line.size() < 4)
            throw Error(fmt::format("{}: a face of {}, expected 3 or more", at_line(file_, line_),
                                    counted(line.size() - 1, "corner")));
        if (material_ == none)
            use_material("");
        const Corner first = corner_in(line[1]);
        Corner before = corner_in(line[2]);
        for (std::size_t i = 3; i < line.size(); ++i) {
            const Corner here = corner_in(line[i]);
            if (triangles_.size() ==
                triangles_.capacity()) {                 // a corner of a polygon takes as little as two bytes of text
                constexpr std::uint64_t bytes_each = 88; // with the coordinates that come later
                require_memory(2 * bytes_each * triangles_.size(), counted(triangles_.size(), "triangle"));
            }
            triangles_.push_back({first, before, here});
            read_.mesh.material.push_back(material_);
            before = here;
        }
    }

    void use_material(const std::string& name) {
        const auto [row, is_new] = materials_.try_emplace(name, static_cast<int>(materials_.size()));
        material_ = row->second;
        if (is_new)
            read_.mesh.materials.push_back({name});
    }

    void warn() {
        if (surfaces_ > 0)
            warnings_.push_back(fmt::format("{}: {}, which are not read: faces are.", file_.string(),
                                            counted(surfaces_, "line of free-form surfaces")));
    }

    MeshFile mesh() && {
        TexturedMesh& mesh = read_.mesh;
        mesh.tiles = true;
        constexpr float nowhere = std::numeric_limits<float>::quiet_NaN();
        if (!coordinates_.empty())
            mesh.sets.emplace_back();
        mesh.triangles.reserve(triangles_.size());
        for (const auto& corners : triangles_) {
            mesh.triangles.push_back({corners[0].point, corners[1].point, corners[2].point});
            if (!mesh.sets.empty()) {
                TextureCorners& places = mesh.sets[0].emplace_back();
                for (std::size_t i = 0; i < 3; ++i)
                    places[i] = corners[i].texture == none ? Eigen::Vector2f(nowhere, nowhere)
                                                           : coordinates_[static_cast<std::size_t>(corners[i].texture)];
            }
            if (!normals_.empty())
                mesh.reversed.push_back(reversed(corners));
        }
        if (!colours_.empty())
            take_colours();
        return std::move(read_);
    }

    bool reversed(const std::array<Corner, 3>& corners) const {
        Eigen::Vector3d sum = Eigen::Vector3d::Zero();
        std::array<Eigen::Vector3d, 3> at;
        for (std::size_t i = 0; i < 3; ++i) {
            at[i] = read_.points[static_cast<std::size_t>(corners[i].point)];
            if (corners[i].normal != none)
                sum += normals_[static_cast<std::size_t>(corners[i].normal)].cast<double>();
        }
        return is_reversed(at, sum);
    }

    /// Fractions, or bytes if any is above 1.
    void take_colours() {
        colours_.resize(3 * read_.points.size(), 0.0F);
        const float full = *std::ranges::max_element(colours_) > 1 ? 1.0F : 255.0F;
        for (std::size_t i = 0; i < colours_.size(); i += 3)
            read_.colours.emplace_back(cv::saturate_cast<uchar>(full * colours_[i + 2]),
                                       cv::saturate_cast<uchar>(full * colours_[i + 1]),
                                       cv::saturate_cast<uchar>(full * colours_[i]));
    }

    const fs::path& file_;
    std::vector<std::string>& warnings_;
    int line_ = 0;
    std::array<IndexedList, 3> lists_{IndexedList{"vertex", "vertices"}, IndexedList{"vt", "texture coordinates"},
                                      IndexedList{"vn", "normals"}};
    std::vector<float> colours_; ///< red, green, blue
    std::vector<Eigen::Vector2f> coordinates_;
    std::vector<Eigen::Vector3f> normals_;
    std::vector<std::array<Corner, 3>> triangles_;
    std::map<std::string, int> materials_;
    int material_ = none;
    std::size_t surfaces_ = 0;
    MeshFile read_;
};

} // namespace

bool is_reversed(const std::array<Eigen::Vector3d, 3>& corners, const Eigen::Vector3d& normals) {
    return (corners[1] - corners[0]).cross(corners[2] - corners[0]).dot(normals) < 0;
}

std::optional<fs::path> path_within(std::string_view text) {
    std::string slashes(text);
    std::ranges::replace(slashes, '\\', '/');
    const fs::path path = fs::path(slashes).lexically_normal();
    const bool inside = !path.empty() && path.is_relative() && *path.begin() != ".." && path.has_filename() &&
                        slashes.find('\0') == std::string::npos;
    return inside ? std::optional(path) : std::nullopt;
}

MeshFile read_obj(std::string_view bytes, const fs::path& file, std::vector<std::string>& warnings) {
    // A point takes six bytes of text at least and 24 here, a triangle eight and 88.
    require_memory(11 * bytes.size(), fmt::format("{}: a mesh of {}", file.string(), counted(bytes.size(), "byte")));
    return ObjReader(file, warnings).read(bytes);
}

} // namespace scanshade
