// glTF 2.0: the meshes of the default scene as one, placed by their nodes, in glTF's axes (y up).
#include "io/clouds/meshes/gltf_file.h"
#include "io/clouds/meshes/mesh_file.h"
#include "io/text.h"
#include "projection/base/memory.h"
#include "projection/srgb.h"

#include <algorithm>
#include <array>
#include <Eigen/Geometry>
#include <fmt/format.h>
#include <limits>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

using Eigen::Vector3d;

constexpr std::size_t points_mode = 0, triangles_mode = 4, strip_mode = 5, fan_mode = 6;

void refuse_splats(const OrderedJson& primitive) {
    const auto extensions = primitive.find("extensions");
    if (extensions == primitive.end() || !extensions->contains("KHR_gaussian_splatting"))
        return;
    const std::string kernel = (*extensions)["KHR_gaussian_splatting"].value("kernel", "");
    throw Error(fmt::format("Gaussian splats (KHR_gaussian_splatting, kernel {}) are read from .glb, PLY, .splat and "
                            ".spz, not from JSON with files beside it",
                            in_quotes(kernel)));
}

class SceneReader {
  public:
    SceneReader(const GltfFile& gltf, const fs::path& file, std::vector<std::string>& warnings)
        : gltf_(gltf), json_(gltf.json), file_(file), warnings_(warnings) {}

    MeshFile read() {
        refuse_extensions(json_);
        for (std::size_t i = 0; i < size_of_table(json_, "materials"); ++i)
            read_.mesh.materials.push_back(material_of(json_["materials"][i]));
        read_.mesh.materials.push_back({""}); // of primitives that name none
        visit_nodes(json_, [&](const OrderedJson& node, const Eigen::Affine3d& place) {
            skins_ += node.contains("skin");
            if (node.contains("mesh"))
                add_mesh(element_of(json_, "meshes", whole_in(node, "mesh")), place);
        });
        if (!colours_known_)
            read_.colours.clear();
        for (auto& set : read_.mesh.sets) // primitives without so many sets
            set.resize(read_.mesh.triangles.size(), no_place());
        read_.mesh.reversed.resize(normals_known_ ? read_.mesh.triangles.size() : 0); // the last may have no normals
        warn();
        return std::move(read_);
    }

  private:
    static TextureCorners no_place() {
        constexpr float nan = std::numeric_limits<float>::quiet_NaN();
        return {Eigen::Vector2f(nan, nan), Eigen::Vector2f(nan, nan), Eigen::Vector2f(nan, nan)};
    }

    static MeshMaterial material_of(const OrderedJson& material) {
        MeshMaterial found{material.value("name", "")};
        if (const auto texture = material.find("occlusionTexture"); texture != material.end())
            found.set = whole_in(*texture, "texCoord", 0);
        return found;
    }

    void add_mesh(const OrderedJson& mesh, const Eigen::Affine3d& place) {
        for (std::size_t i = 0; i < size_of_table(mesh, "primitives"); ++i)
            within(fmt::format("primitive {}", i), [&] {
                const OrderedJson& primitive = mesh["primitives"][i];
                refuse_splats(primitive);
                skins_ += primitive.contains("targets");
                const std::size_t mode = whole_in(primitive, "mode", triangles_mode);
                if (mode == points_mode || (mode >= triangles_mode && mode <= fan_mode))
                    add_primitive(primitive, mode, place);
                else
                    ++lines_;
            });
    }

    void add_primitive(const OrderedJson& primitive, std::size_t mode, const Eigen::Affine3d& place) {
        const OrderedJson& attributes = primitive.at("attributes");
        const Accessor positions(gltf_, whole_in(attributes, "POSITION"));
        if (positions.width() != 3)
            throw Error("POSITION has no three numbers");
        const std::size_t first = read_.points.size();
        constexpr std::uint64_t most = 0x7fffffff, bytes_each = 200; // vertex, and two triangles
        if (first + positions.count() > most)
            throw Error(fmt::format("{}, at most {} are read", counted(first + positions.count(), "vertex"), most));
        require_memory(bytes_each * positions.count(), counted(positions.count(), "point"));
        for (std::size_t i = 0; i < positions.count(); ++i)
            read_.points.push_back(place * Vector3d(positions(i, 0), positions(i, 1), positions(i, 2)));
        add_colours(attributes, first);
        if (mode == points_mode)
            return;
        const std::vector<std::array<std::size_t, 3>> triangles = triangles_of(primitive, mode, positions.count());
        const bool mirrored = place.linear().determinant() < 0;
        const std::size_t material = whole_in(primitive, "material", read_.mesh.materials.size() - 1);
        if (material >= read_.mesh.materials.size())
            throw Error(fmt::format("material {}, the file has {}", material, read_.mesh.materials.size() - 1));
        add_coordinates(attributes, triangles, mirrored, positions.count());
        add_sides(attributes, triangles, mirrored, first, place);
        for (std::array<std::size_t, 3> triangle : triangles) {
            if (mirrored) // glTF 2.0, 3.7.4: then the order of corners is the other one
                std::swap(triangle[1], triangle[2]);
            read_.mesh.triangles.push_back({static_cast<int>(first + triangle[0]),
                                            static_cast<int>(first + triangle[1]),
                                            static_cast<int>(first + triangle[2])});
            read_.mesh.material.push_back(static_cast<int>(material));
        }
    }

    std::vector<std::array<std::size_t, 3>> triangles_of(const OrderedJson& primitive, std::size_t mode,
                                                         std::size_t vertices) const {
        std::vector<std::size_t> corners;
        if (primitive.contains("indices")) {
            const Accessor indices(gltf_, whole_in(primitive, "indices"));
            if (!indices.is_unsigned() || indices.width() != 1)
                throw Error("its indices are no whole numbers without a sign");
            require_memory(sizeof(std::size_t) * indices.count(), counted(indices.count(), "index"));
            corners.reserve(indices.count());
            for (std::size_t i = 0; i < indices.count(); ++i) {
                corners.push_back(indices.whole(i));
                if (corners.back() >= vertices)
                    throw Error(fmt::format("index {} names vertex {} of {}", i, corners.back(), vertices));
            }
        } else {
            for (std::size_t i = 0; i < vertices; ++i)
                corners.push_back(i);
        }
        constexpr std::uint64_t bytes_each = 80; // strips have a triangle for each corner; coordinates come later
        require_memory(bytes_each * corners.size(), counted(corners.size(), "corner"));
        std::vector<std::array<std::size_t, 3>> triangles;
        if (mode == triangles_mode)
            for (std::size_t i = 2; i < corners.size(); i += 3)
                triangles.push_back({corners[i - 2], corners[i - 1], corners[i]});
        for (std::size_t i = 2; mode != triangles_mode && i < corners.size(); ++i)
            if (mode == fan_mode)
                triangles.push_back({corners[i - 1], corners[i], corners[0]});
            else
                triangles.push_back({corners[i - 2], corners[i - 1 + i % 2], corners[i - i % 2]});
        return triangles;
    }

    void add_coordinates(const OrderedJson& attributes, const std::vector<std::array<std::size_t, 3>>& triangles,
                         bool mirrored, std::size_t vertices) {
        for (std::size_t set = 0;; ++set) {
            const std::string name = fmt::format("TEXCOORD_{}", set);
            if (!attributes.contains(name))
                return;
            const Accessor places(gltf_, whole_in(attributes, name.c_str()));
            if (places.width() != 2 || places.count() != vertices)
                throw Error(fmt::format("{} of {} pairs for {}", name, places.count(), counted(vertices, "point")));
            if (set == read_.mesh.sets.size())
                read_.mesh.sets.emplace_back();
            std::vector<TextureCorners>& all = read_.mesh.sets[set];
            require_memory(2 * sizeof(TextureCorners) * (read_.mesh.triangles.size() + triangles.size()),
                           fmt::format("{} of {}", name, counted(triangles.size(), "triangle")));
            all.resize(read_.mesh.triangles.size(), no_place());
            for (const auto& triangle : triangles) {
                TextureCorners& corners = all.emplace_back();
                for (std::size_t i = 0; i < 3; ++i)
                    corners[i] = {static_cast<float>(places(triangle[i], 0)),
                                  static_cast<float>(places(triangle[i], 1))};
                if (mirrored)
                    std::swap(corners[1], corners[2]);
            }
        }
    }

    /// The order of corners as the file has it, against its normals: both turn with a mirrored node.
    void add_sides(const OrderedJson& attributes, const std::vector<std::array<std::size_t, 3>>& triangles,
                   bool mirrored, std::size_t first, const Eigen::Affine3d& place) {
        std::vector<bool>& reversed = read_.mesh.reversed;
        reversed.resize(read_.mesh.triangles.size());
        if (!attributes.contains("NORMAL"))
            return;
        const Accessor normals(gltf_, whole_in(attributes, "NORMAL"));
        if (normals.width() != 3 || first + normals.count() != read_.points.size())
            throw Error(fmt::format("NORMAL of {}", counted(normals.count(), "vector")));
        normals_known_ = true;
        const Eigen::Matrix3d turn = place.linear().inverse().transpose();
        for (const auto& triangle : triangles) {
            std::array<Vector3d, 3> at;
            Vector3d sum = Vector3d::Zero();
            for (std::size_t i = 0; i < 3; ++i) {
                at[i] = read_.points[first + triangle[i]];
                sum += turn * Vector3d(normals(triangle[i], 0), normals(triangle[i], 1), normals(triangle[i], 2));
            }
            if (mirrored)
                std::swap(at[1], at[2]);
            reversed.push_back(is_reversed(at, sum));
        }
    }

    /// Linear light, which stored colours are not.
    void add_colours(const OrderedJson& attributes, std::size_t first) {
        read_.colours.resize(read_.points.size(), cv::Vec3b(255, 255, 255));
        if (!attributes.contains("COLOR_0"))
            return;
        const Accessor colours(gltf_, whole_in(attributes, "COLOR_0"));
        if (colours.width() < 3 || colours.width() > 4 || first + colours.count() != read_.points.size())
            throw Error(fmt::format("COLOR_0 of {}", counted(colours.count(), "colour")));
        colours_known_ = true;
        for (std::size_t i = 0; i < colours.count(); ++i)
            for (std::size_t channel = 0; channel < 3; ++channel)
                read_.colours[first + i][static_cast<int>(2 - channel)] =
                    cv::saturate_cast<uchar>(255 * srgb_from_linear(std::clamp(colours(i, channel), 0.0, 1.0)));
    }

    void warn() {
        if (lines_ > 0)
            warnings_.push_back(
                fmt::format("{}: {} of lines, which are left out.", file_.string(), counted(lines_, "primitive")));
        if (skins_ > 0)
            warnings_.push_back(
                fmt::format("{}: skins and morph targets are not applied: the mesh is at rest.", file_.string()));
        if (read_.points.empty())
            warnings_.push_back(fmt::format("{}: its scene shows no mesh.", file_.string()));
    }

    const GltfFile& gltf_;
    const OrderedJson& json_;
    const fs::path& file_;
    std::vector<std::string>& warnings_;
    std::size_t lines_ = 0, skins_ = 0;
    bool colours_known_ = false, normals_known_ = false;
    MeshFile read_;
};

} // namespace

MeshFile read_gltf(std::string_view bytes, const fs::path& file, std::vector<std::string>& warnings) {
    return within(file.string(), [&] {
        const GltfFile gltf = gltf_file(bytes, file);
        return SceneReader(gltf, file, warnings).read();
    });
}

} // namespace scanshade
