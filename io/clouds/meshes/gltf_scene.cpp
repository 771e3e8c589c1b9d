// The scene of a glTF: which nodes it shows, and where (Khronos, "glTF 2.0", sections 3.5 and 3.12).
#include "io/clouds/meshes/gltf_file.h"
#include "io/text.h"

#include <algorithm>
#include <array>
#include <fmt/format.h>
#include <set>
#include <utility>

namespace scanshade {

namespace {

/// Extensions that change no positions, triangles or coordinates.
bool is_harmless(std::string_view extension) {
    constexpr std::array<std::string_view, 8> harmless{"KHR_materials_",
                                                       "KHR_texture_",
                                                       "EXT_texture_",
                                                       "KHR_lights_",
                                                       "KHR_mesh_quantization",
                                                       "KHR_xmp",
                                                       "EXT_structural_metadata",
                                                       "EXT_mesh_features"};
    return extension == splat_extension ||
           std::ranges::any_of(harmless, [&](std::string_view name) { return extension.starts_with(name); });
}

template <std::size_t Count>
std::array<double, Count> numbers_in(const OrderedJson& node, const char* key, std::array<double, Count> usual) {
    const auto found = node.find(key);
    if (found == node.end())
        return usual;
    if (!found->is_array() || found->size() != Count)
        throw Error(fmt::format("\"{}\" is no array of {} numbers", key, Count));
    for (std::size_t i = 0; i < Count; ++i)
        usual[i] = (*found)[i].get<double>();
    return usual;
}

Eigen::Affine3d placed_by(const OrderedJson& node) {
    Eigen::Affine3d place = Eigen::Affine3d::Identity();
    if (node.contains("matrix")) {
        const auto m = numbers_in<16>(node, "matrix", {});
        place.matrix() = Eigen::Map<const Eigen::Matrix4d>(m.data()); // column by column
        return place;
    }
    const auto t = numbers_in<3>(node, "translation", {0, 0, 0}), s = numbers_in<3>(node, "scale", {1, 1, 1});
    const auto q = numbers_in<4>(node, "rotation", {0, 0, 0, 1});
    const Eigen::Quaterniond rotation(q[3], q[0], q[1], q[2]);
    if (!(rotation.norm() > 0))
        throw Error("\"rotation\" is no quaternion");
    return place.translate(Vector3d(t[0], t[1], t[2])).rotate(rotation.normalized()).scale(Vector3d(s[0], s[1], s[2]));
}

/// Of the default scene; where the file has no scene, nodes that are nobody's children.
std::vector<std::size_t> roots_of(const OrderedJson& json) {
    std::vector<std::size_t> found;
    if (size_of_table(json, "scenes") > 0) {
        const OrderedJson& scene = element_of(json, "scenes", whole_in(json, "scene", 0));
        for (std::size_t i = 0; i < size_of_table(scene, "nodes"); ++i)
            found.push_back(scene["nodes"][i].get<std::size_t>());
        return found;
    }
    std::set<std::size_t> children;
    for (std::size_t i = 0; i < size_of_table(json, "nodes"); ++i)
        for (std::size_t k = 0; k < size_of_table(json["nodes"][i], "children"); ++k)
            children.insert(json["nodes"][i]["children"][k].get<std::size_t>());
    for (std::size_t i = 0; i < size_of_table(json, "nodes"); ++i)
        if (!children.contains(i))
            found.push_back(i);
    return found;
}

} // namespace

void refuse_extensions(const OrderedJson& json) {
    for (std::size_t i = 0; i < size_of_table(json, "extensionsRequired"); ++i)
        if (const auto name = json["extensionsRequired"][i].get<std::string>(); !is_harmless(name))
            throw Error(fmt::format("the file requires {}, which is not read; export it without", in_quotes(name)));
}

void visit_nodes(const OrderedJson& json,
                 const std::function<void(const OrderedJson& node, const Eigen::Affine3d& place)>& visit) {
    std::vector<bool> visited(size_of_table(json, "nodes"));
    std::vector<std::pair<std::size_t, Eigen::Affine3d>> left;
    const std::vector<std::size_t> roots = roots_of(json);
    for (std::size_t i = roots.size(); i-- > 0;)
        left.emplace_back(roots[i], Eigen::Affine3d::Identity());
    while (!left.empty()) {
        const auto [index, above] = left.back();
        left.pop_back();
        within(fmt::format("node {}", index), [&, at = index, parent = above] {
            const OrderedJson& node = element_of(json, "nodes", at);
            if (visited[at])
                throw Error("met twice, but nodes have one parent");
            visited[at] = true;
            const Eigen::Affine3d place = parent * placed_by(node);
            if (node.contains("extensions") && node["extensions"].contains("EXT_mesh_gpu_instancing"))
                throw Error("EXT_mesh_gpu_instancing is not read");
            visit(node, place);
            for (std::size_t i = size_of_table(node, "children"); i-- > 0;)
                left.emplace_back(node["children"][i].get<std::size_t>(), place);
        });
    }
}

} // namespace scanshade
