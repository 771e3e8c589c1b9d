// Tilesets of 3D Tiles, read again by a reader of the tests' own, with the checks that hold for each.
#pragma once

#include "tests/support/glb_file.h"

#include <Eigen/Geometry>
#include <map>
#include <vector>

namespace scanshade::tests {

/// What all tiles have, in the order in which they are met.
struct Tileset {
    std::vector<Eigen::Vector3d> points;              ///< in the tiles' axes, z up
    std::map<std::string, std::vector<float>> fields; ///< by attribute
    std::vector<std::uint16_t> colours;               ///< four of each point
    std::vector<std::size_t> sizes;                   ///< points of each tile
    std::size_t documents = 0, most_in_document = 0;  ///< files of JSON, and tiles of one
    double most_step = 0;                             ///< of the floats that positions are stored in
    std::optional<Eigen::Matrix4d> transform;         ///< the root's
};

class TilesetReader {
  public:
    explicit TilesetReader(std::filesystem::path folder) : folder_(std::move(folder)) {}
    Tileset read() {
        (void)document("tileset.json", 1e300);
        return std::move(all_);
    }

  private:
    using json = nlohmann::json;
    using Box = Eigen::AlignedBox3d;

    static Box box_of(const json& tile) {
        const auto b = tile.at("boundingVolume").at("box").get<std::vector<double>>();
        EXPECT_EQ(b.size(), 12u);
        for (const std::size_t zero : {4U, 5U, 6U, 8U, 9U, 10U})
            EXPECT_EQ(b[zero], 0) << "along the axes";
        const Eigen::Vector3d middle(b[0], b[1], b[2]), half(b[3], b[7], b[11]);
        EXPECT_GT(half.minCoeff(), 0);
        return {middle - half, middle + half};
    }

    /// Returns the box of all its points.
    Box document(const std::string& name, double error_above) {
        const json whole = json::parse(file_bytes(folder_ / name));
        EXPECT_EQ(whole["asset"]["version"], "1.1");
        EXPECT_GE(whole["geometricError"].get<double>(), whole["root"]["geometricError"].get<double>());
        EXPECT_LE(whole["geometricError"].get<double>(), error_above);
        EXPECT_EQ(whole["root"]["refine"], "ADD");
        if (whole["root"].contains("transform")) {
            EXPECT_EQ(name, "tileset.json");
            all_.transform = Eigen::Matrix4d(whole["root"]["transform"].get<std::vector<double>>().data());
        }
        ++all_.documents;
        std::size_t tiles = 0;
        const Box found = tile(whole["root"], error_above, tiles);
        all_.most_in_document = std::max(all_.most_in_document, tiles);
        return found;
    }

    Box tile(const json& tile_json, double error_above, std::size_t& tiles) {
        ++tiles;
        const Box box = box_of(tile_json);
        const double error = tile_json.at("geometricError");
        EXPECT_LT(error, error_above);
        const std::string uri = tile_json.at("content").at("uri");
        EXPECT_EQ(std::filesystem::path(uri).filename(), uri) << "in the folder";
        const bool has_children = tile_json.contains("children"), external = uri.ends_with(".json");
        Box found = external ? document(uri, 2 * error) : points_of(uri);
        EXPECT_TRUE(!has_children || !tile_json["children"].empty());
        EXPECT_EQ(error == 0, !has_children && !external) << uri;
        for (const json& child : has_children ? tile_json["children"] : json::array()) {
            EXPECT_TRUE(box.contains(box_of(child))) << "children are within " << uri;
            found.extend(tile(child, error, tiles));
        }
        EXPECT_TRUE(box.contains(found)) << uri;
        return found;
    }

    Box points_of(const std::string& uri) {
        const Gltf glb = gltf_in(folder_ / uri);
        const json& node = glb.text["nodes"][0];
        const auto t = node.value("translation", std::vector<double>{0, 0, 0});
        EXPECT_FALSE(node.contains("rotation"));
        const auto stored = glb.attribute<float>("POSITION");
        Box box;
        for (std::size_t i = 0; i < stored.size(); i += 3) {
            const double x = stored[i] + t[0], y = stored[i + 1] + t[1], z = stored[i + 2] + t[2];
            all_.points.emplace_back(x, -z, y); // glTF's y is up, tiles' z
            box.extend(all_.points.back());
            for (const std::size_t k : {0U, 1U, 2U})
                all_.most_step = std::max(all_.most_step, static_cast<double>(std::abs(stored[i + k])) * 0x1p-24);
        }
        all_.sizes.push_back(stored.size() / 3);
        const json& properties =
            glb.text["extensions"]["EXT_structural_metadata"]["schema"]["classes"]["point"]["properties"];
        for (const auto& [name, accessor] : glb.text["meshes"][0]["primitives"][0]["attributes"].items())
            if (name.starts_with('_')) {
                const auto values = glb.attribute<float>(name);
                EXPECT_EQ(values.size(), all_.sizes.back());
                all_.fields[name].insert(all_.fields[name].end(), values.begin(), values.end());
            }
        EXPECT_EQ(properties.size(), all_.fields.size());
        const auto colours = glb.attribute<std::uint16_t>("COLOR_0");
        all_.colours.insert(all_.colours.end(), colours.begin(), colours.end());
        return box;
    }

    std::filesystem::path folder_;
    Tileset all_;
};

} // namespace scanshade::tests
