// A glTF again, with images of occlusion in its materials (glTF 2.0, 3.9.3: the red channel, on ambient light alone).
#include "io/clouds/meshes/gltf_file.h"
#include "io/clouds/meshes/mesh_file.h"
#include "io/text.h"

#include <fmt/format.h>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

/// Primitives that name no material get this one.
void give_material(OrderedJson& json, std::size_t material) {
    for (OrderedJson& mesh : json["meshes"])
        for (OrderedJson& primitive : mesh["primitives"])
            if (!primitive.contains("material"))
                primitive["material"] = material;
}

/// The files that buffers and images name.
void add_copies(const OrderedJson& json, LinkedFiles& made) {
    for (const char* table : {"buffers", "images"})
        for (std::size_t i = 0; i < size_of_table(json, table); ++i)
            if (const auto uri = json[table][i].find("uri"); uri != json[table][i].end() && uri->is_string())
                if (const auto path = path_of_uri(uri->get<std::string>()))
                    made.copies.push_back(*path);
}

std::string as_uri(std::string_view name) {
    std::string uri;
    for (const char c : name) {
        const bool plain = (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') ||
                           std::string_view("-._~").find(c) != std::string_view::npos;
        uri += plain ? std::string(1, c) : fmt::format("%{:02X}", static_cast<unsigned char>(c));
    }
    return uri;
}

} // namespace

LinkedFiles linked_gltf(std::string_view bytes, const fs::path& file, const std::string& name, const TexturedMesh& mesh,
                        std::span<const OcclusionLink> links, bool replace) {
    return within(file.string(), [&] {
        GltfFile gltf = gltf_file(bytes, file, false);
        LinkedFiles made;
        OrderedJson& json = gltf.json;
        add_copies(json, made);
        for (std::size_t i = 0; i < size_of_table(json, "materials"); ++i)
            if (const std::string mode = json["materials"][i].value("alphaMode", "OPAQUE"); mode != "OPAQUE")
                made.notes.push_back(fmt::format("material {} is drawn as alphaMode {}, but its faces occlude as "
                                                 "solid ones do.",
                                                 in_quotes(json["materials"][i].value("name", "")), mode));
        std::string bin = gltf.has_bin ? gltf.buffers[0] : "";
        if (gltf.has_bin) // what the chunk has beyond is padding
            bin.resize(std::min(bin.size(), whole_in(json["buffers"][0], "byteLength")));
        else if (gltf.binary && size_of_table(json, "buffers") == 0)
            json["buffers"] = OrderedJson::array({{{"byteLength", 0}}});
        const bool inside = gltf.binary && (gltf.has_bin || !json["buffers"][0].contains("uri"));
        for (const OcclusionLink& link : links) {
            if (mesh.materials[link.material].set && !replace)
                throw Error(fmt::format("material {} has an occlusionTexture already; --overwrite-occlusion "
                                        "replaces it",
                                        in_quotes(mesh.materials[link.material].name)));
            if (link.material == size_of_table(json, "materials"))
                give_material(json, appended(json, "materials", OrderedJson::object()));
            const std::size_t image =
                inside
                    ? appended(json, "images", {{"bufferView", stored(json, bin, link.png)}, {"mimeType", "image/png"}})
                    : appended(json, "images", {{"uri", as_uri(link.image)}});
            const std::size_t texture = appended(json, "textures", {{"source", image}});
            OrderedJson& occlusion = json["materials"][link.material]["occlusionTexture"];
            occlusion = {{"index", texture}, {"texCoord", link.set}, {"strength", 1}};
        }
        made.files.push_back({name + (gltf.binary ? ".glb" : ".gltf"),
                              gltf.binary ? glb_bytes(json, std::move(bin), gltf.chunks) : json.dump(2)});
        return made;
    });
}

} // namespace scanshade
