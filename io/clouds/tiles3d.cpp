#include "io/clouds/tiles3d.h"

#include "io/clouds/glb.h"
#include "io/output_file.h"
#include "io/text.h"
#include "projection/base/error.h"
#include "projection/base/indices_where.h"
#include "projection/base/memory.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <numeric>
#include <tbb/parallel_for.h>
#include <unordered_map>

namespace scanshade {

namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d, Eigen::AlignedBox3d;
using Json = nlohmann::ordered_json;
using Indices = std::vector<std::uint32_t>;

constexpr int cells = 128;        // along a side of a tile: its points are a cell apart
constexpr int deepest = 24;       // levels; floats about a tile's middle tell no more apart
constexpr std::size_t tenth = 10; // that part of a tile's points may be those too few for tiles of their own

struct Cube {
    Vector3d low;
    double side;
    [[nodiscard]] Cube child(int octant) const {
        const double half = side / 2;
        return {low + half * Vector3d(octant & 1, octant >> 1 & 1, octant >> 2), half};
    }
    [[nodiscard]] double spacing() const { return side / cells; }
};

struct Tile {
    std::string name;
    AlignedBox3d box;                  ///< of its points and those below
    double spacing = 0;                ///< of its cube's cells
    std::size_t points = 0, tiles = 1; ///< itself, and all below
    std::vector<Tile> children;
};

/// Spreads whole numbers evenly (Steele, Lea, Flood, "Fast splittable pseudorandom number generators", 2014).
std::uint64_t mixed(std::uint64_t value) {
    value = (value ^ value >> 30) * 0xbf58476d1ce4e5b9U;
    value = (value ^ value >> 27) * 0x94d049bb133111ebU;
    return value ^ value >> 31;
}

/// Makes tiles from the top down, each file once its points are known.
class Octree {
  public:
    Octree(const fs::path& folder, const TilesetScene& scene, const TilesetOptions& options)
        : folder_(folder), scene_(scene), options_(options) {}

    [[nodiscard]] Tile tile(Indices points, const Cube& cube, const std::string& name, int level) const {
        Tile made{.name = name, .box = {}, .spacing = cube.spacing(), .children = {}};
        std::array<Indices, 8> below;
        if (points.size() > options_.most_points && level < deepest)
            points = coarse(std::move(points), cube, below);
        for (Indices& each : below)
            if (each.size() < options_.most_points / (tenth * tenth)) {
                points.insert(points.end(), each.begin(), each.end());
                each.clear();
            }
        write(points, name);
        made.points = points.size();
        for (const std::uint32_t i : points)
            made.box.extend(scene_.points[i]);
        Indices().swap(points);
        std::array<std::optional<Tile>, 8> children;
        tbb::parallel_for(0, 8, [&](int octant) {
            const auto k = static_cast<std::size_t>(octant);
            if (!below[k].empty())
                children[k] = tile(std::move(below[k]), cube.child(octant), name + std::to_string(octant), level + 1);
        });
        for (std::optional<Tile>& child : children)
            if (child) {
                made.box.extend(child->box);
                made.tiles += child->tiles;
                made.points += child->points;
                made.children.push_back(*std::move(child));
            }
        return made;
    }

  private:
    /// The point nearest to the middle of each cell, at most 9 in 10 of those that a tile takes, spread over it. All
    /// others go to `below`, by octant.
    [[nodiscard]] Indices coarse(Indices points, const Cube& cube, std::array<Indices, 8>& below) const {
        struct Best {
            std::size_t which; ///< of `points`
            double distance2;
        };
        std::unordered_map<std::uint64_t, Best> best;
        const auto in_cube = [&](std::uint32_t i) {
            return ((scene_.points[i] - cube.low) / cube.side).cwiseMax(0).cwiseMin(std::nextafter(1.0, 0.0)).eval();
        };
        for (std::size_t k = 0; k < points.size(); ++k) {
            const Vector3d at = in_cube(points[k]) * cells, cell = at.array().floor();
            const auto key = static_cast<std::uint64_t>((cell.z() * cells + cell.y()) * cells + cell.x());
            const double distance2 = (at - cell - Vector3d::Constant(0.5)).squaredNorm();
            if (const auto [found, is_new] = best.try_emplace(key, Best{k, distance2});
                !is_new && distance2 < found->second.distance2)
                found->second = {k, distance2};
        }
        std::vector<std::pair<std::uint64_t, std::size_t>> chosen;
        chosen.reserve(best.size());
        for (const auto& [key, each] : best)
            chosen.emplace_back(mixed(key), each.which);
        std::ranges::sort(chosen);
        chosen.resize(std::min(chosen.size(), options_.most_points - options_.most_points / tenth));
        std::vector<char> is_chosen(points.size(), 0);
        for (const auto& each : chosen)
            is_chosen[each.second] = 1;
        Indices own;
        own.reserve(options_.most_points);
        for (std::size_t k = 0; k < points.size(); ++k) {
            const Vector3d at = in_cube(points[k]);
            const unsigned octant = (at.x() < 0.5 ? 0U : 1U) + (at.y() < 0.5 ? 0U : 2U) + (at.z() < 0.5 ? 0U : 4U);
            (is_chosen[k] ? own : below[octant]).push_back(points[k]);
        }
        return own;
    }

    /// In glTF's axes, y up.
    void write(const Indices& which, const std::string& name) const {
        std::vector<Vector3d> points(which.size());
        std::ranges::transform(which, points.begin(), [&](std::uint32_t i) {
            const Vector3d& p = scene_.points[i];
            return Vector3d(p.x(), p.z(), -p.y());
        });
        std::vector<cv::Vec3b> colours(which.size());
        std::ranges::transform(which, colours.begin(), [&](std::uint32_t i) { return scene_.colours[i]; });
        std::vector<std::vector<float>> values;
        std::vector<AddedField> fields;
        values.reserve(scene_.fields.size());
        for (const AddedField& field : scene_.fields) {
            auto& own = values.emplace_back(which.size());
            std::ranges::transform(which, own.begin(), [&](std::uint32_t i) { return field.values[i]; });
            fields.push_back({field.name, own});
        }
        (void)write_glb(folder_ / (name + ".glb"),
                        {.name = name, .points = points, .colours = colours, .fields = fields, .tile = true});
    }

    const fs::path& folder_;
    const TilesetScene& scene_;
    const TilesetOptions& options_;
};

/// Its own half spacing wider than all that is in it, so that it holds the boxes below.
Json volume_of(const Tile& tile) {
    const Vector3d middle = tile.box.center(), half = tile.box.sizes() / 2 + Vector3d::Constant(tile.spacing / 2);
    return {{"box", {middle.x(), middle.y(), middle.z(), half.x(), 0, 0, 0, half.y(), 0, 0, 0, half.z()}}};
}

double error_of(const Tile& tile) { return tile.children.empty() ? 0 : tile.spacing; }

/// The files that name tiles.
class Tilesets {
  public:
    Tilesets(const fs::path& folder, const TilesetOptions& options) : folder_(folder), options_(options) {}

    /// `error`: what is missing where nothing of it is drawn.
    void write(const Tile& root, double error, const std::string& file,
               const std::optional<Eigen::Isometry3d>& placed) {
        Json json{{"asset", {{"version", "1.1"}, {"generator", std::string("scanshade ") + SCANSHADE_VERSION}}},
                  {"geometricError", error},
                  {"root", described(root)}};
        json["root"]["refine"] = "ADD";
        if (placed) {
            const Eigen::Matrix4d matrix = placed->matrix(); // column by column
            json["root"]["transform"] = std::vector<double>(matrix.data(), matrix.data() + matrix.size());
        }
        write_atomically(folder_ / file, json.dump());
        files_.emplace_back(file);
    }
    [[nodiscard]] std::vector<fs::path> files() { return std::move(files_); }

  private:
    [[nodiscard]] Json described(const Tile& tile) {
        Json json{{"boundingVolume", volume_of(tile)}, {"geometricError", error_of(tile)}};
        json["content"] = {{"uri", tile.name + ".glb"}};
        files_.emplace_back(tile.name + ".glb");
        for (const Tile& child : tile.children)
            if (tile.tiles > options_.most_tiles && child.tiles <= options_.most_tiles && !child.children.empty()) {
                write(child, child.spacing, child.name + ".json", std::nullopt);
                json["children"].push_back({{"boundingVolume", volume_of(child)},
                                            {"geometricError", error_of(child)},
                                            {"content", {{"uri", child.name + ".json"}}}});
            } else {
                json["children"].push_back(described(child));
            }
        return json;
    }

    const fs::path& folder_;
    const TilesetOptions& options_;
    std::vector<fs::path> files_;
};

int levels_of(const Tile& tile) {
    int below = 0;
    for (const Tile& child : tile.children)
        below = std::max(below, levels_of(child));
    return 1 + below;
}

void remove_folder(const fs::path& folder) {
    std::error_code none;
    fs::remove_all(folder, none);
}

} // namespace

TilesWritten write_tiles3d(const fs::path& folder, const TilesetScene& scene, const TilesetOptions& options) {
    return during(folder.string(), [&] {
        Indices points = indices_where(scene.points.size(), [&](std::size_t i) { return scene.points[i].allFinite(); });
        if (points.empty())
            throw Error("no point has coordinates, so there are no tiles");
        constexpr std::uint64_t bytes_each = 40; // indices twice, and what tiles under work hold
        require_memory(bytes_each * points.size(), fmt::format("tiles of {}", counted(points.size(), "point")));
        TilesWritten written;
        written.points = points.size();
        written.left_out = scene.points.size() - points.size();
        AlignedBox3d box;
        for (const std::uint32_t i : points)
            box.extend(scene.points[i]);
        constexpr double smallest = 1e-3;
        const Cube cube{box.min(), std::max(box.sizes().maxCoeff(), smallest)};
        const fs::path part = folder.parent_path() / ("." + folder.filename().string() + ".part");
        remove_folder(part);
        const Tile root = Octree(part, scene, options).tile(std::move(points), cube, "r", 0);
        Tilesets tilesets(part, options);
        constexpr double whole = 16; // of the spacing
        tilesets.write(root, whole * root.spacing, "tileset.json", scene.earth_from_tiles);
        written.tiles = root.tiles;
        written.levels = levels_of(root);
        written.files = tilesets.files();
        std::rotate(written.files.begin(), written.files.end() - 1, written.files.end());
        remove_folder(folder);
        fs::rename(part, folder);
        return written;
    });
}

} // namespace scanshade
