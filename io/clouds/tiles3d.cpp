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
#include <cstring>
#include <fmt/format.h>
#include <fstream>
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

/// As a share of the cube's side, 0 .. 1.
Vector3d in_cube(const Vector3d& point, const Cube& cube) {
    return ((point - cube.low) / cube.side).cwiseMax(0).cwiseMin(std::nextafter(1.0, 0.0));
}
std::size_t octant_of(const Vector3d& point, const Cube& cube) {
    const Vector3d at = in_cube(point, cube);
    return (at.x() < 0.5 ? 0U : 1U) + (at.y() < 0.5 ? 0U : 2U) + (at.z() < 0.5 ? 0U : 4U);
}

/// Of points by their numbers, those of a coarse tile: nearest to the middle of each cell.
class CoarsePoints {
  public:
    explicit CoarsePoints(const Cube& cube) : cube_(cube) {}

    void look_at(const Vector3d& point, std::size_t number) {
        const Vector3d at = in_cube(point, cube_) * cells, cell = at.array().floor();
        const auto key = static_cast<std::uint64_t>((cell.z() * cells + cell.y()) * cells + cell.x());
        const double distance2 = (at - cell - Vector3d::Constant(0.5)).squaredNorm();
        if (const auto [found, is_new] = best_.try_emplace(key, Best{number, distance2});
            !is_new && distance2 < found->second.distance2)
            found->second = {number, distance2};
    }
    /// Ascending; no more than `most`, spread over the cube.
    [[nodiscard]] std::vector<std::size_t> chosen(std::size_t most) const {
        std::vector<std::pair<std::uint64_t, std::size_t>> all;
        all.reserve(best_.size());
        for (const auto& [key, each] : best_)
            all.emplace_back(mixed(key), each.number);
        std::ranges::sort(all);
        all.resize(std::min(all.size(), most));
        std::vector<std::size_t> numbers(all.size());
        std::ranges::transform(all, numbers.begin(), [](const auto& each) { return each.second; });
        std::ranges::sort(numbers);
        return numbers;
    }

  private:
    struct Best {
        std::size_t number;
        double distance2;
    };
    Cube cube_;
    std::unordered_map<std::uint64_t, Best> best_;
};

/// Points that a tile chooses; others may be added that are too few for tiles of their own.
std::size_t most_chosen(const TilesetOptions& options) { return options.most_points - options.most_points / tenth; }
bool are_few(std::size_t points, const TilesetOptions& options) {
    return points < options.most_points / (tenth * tenth);
}

void adopt(Tile& parent, Tile child) {
    parent.box.extend(child.box);
    parent.tiles += child.tiles;
    parent.points += child.points;
    parent.children.push_back(std::move(child));
}

/// Makes tiles from the top down, each file once its points are known.
class Octree {
  public:
    Octree(const fs::path& folder, const TilesetScene& scene, const TilesetOptions& options)
        : folder_(folder), scene_(scene), options_(options) {}

    [[nodiscard]] Tile tile(Indices points, const Cube& cube, const std::string& name, int level) const {
        std::array<Indices, 8> below;
        if (points.size() > options_.most_points && level < deepest)
            points = coarse(std::move(points), cube, below);
        for (Indices& each : below)
            if (are_few(each.size(), options_)) {
                points.insert(points.end(), each.begin(), each.end());
                each.clear();
            }
        Tile made = written(points, cube, name);
        Indices().swap(points);
        std::array<std::optional<Tile>, 8> children;
        tbb::parallel_for(0, 8, [&](int octant) {
            const auto k = static_cast<std::size_t>(octant);
            if (!below[k].empty())
                children[k] = tile(std::move(below[k]), cube.child(octant), name + std::to_string(octant), level + 1);
        });
        for (std::optional<Tile>& child : children)
            if (child)
                adopt(made, *std::move(child));
        return made;
    }

    /// A tile of these points, without children.
    [[nodiscard]] Tile written(const Indices& points, const Cube& cube, const std::string& name) const {
        write(points, name);
        Tile made{.name = name, .box = {}, .spacing = cube.spacing(), .points = points.size(), .children = {}};
        for (const std::uint32_t i : points)
            made.box.extend(scene_.points[i]);
        return made;
    }

  private:
    /// All points that are not chosen go to `below`, by octant.
    [[nodiscard]] Indices coarse(Indices points, const Cube& cube, std::array<Indices, 8>& below) const {
        CoarsePoints best(cube);
        for (std::size_t k = 0; k < points.size(); ++k)
            best.look_at(scene_.points[points[k]], k);
        const std::vector<std::size_t> chosen = best.chosen(most_chosen(options_));
        Indices own;
        own.reserve(options_.most_points);
        auto next = chosen.begin();
        for (std::size_t k = 0; k < points.size(); ++k)
            if (next != chosen.end() && *next == k) {
                own.push_back(points[k]);
                ++next;
            } else {
                below[octant_of(scene_.points[points[k]], cube)].push_back(points[k]);
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

fs::path part_of(const fs::path& folder) { return folder.parent_path() / ("." + folder.filename().string() + ".part"); }

Cube cube_about(const AlignedBox3d& box) {
    constexpr double smallest = 1e-3;
    return {box.min(), std::max(box.sizes().maxCoeff(), smallest)};
}

/// Names the tiles that are there, and puts all in place.
TilesWritten published(const fs::path& folder, const Tile& root, const TilesetOptions& options,
                       const std::optional<Eigen::Isometry3d>& placed) {
    constexpr double whole = 16; // of the spacing
    const fs::path part = part_of(folder);
    Tilesets tilesets(part, options);
    tilesets.write(root, whole * root.spacing, "tileset.json", placed);
    TilesWritten written;
    written.points = root.points;
    written.tiles = root.tiles;
    written.levels = levels_of(root);
    written.files = tilesets.files();
    std::rotate(written.files.begin(), written.files.end() - 1, written.files.end());
    remove_folder(folder);
    fs::rename(part, folder);
    return written;
}

constexpr const char* no_points = "no point has coordinates, so there are no tiles";

/// Some points with what they carry.
struct PointArrays {
    std::vector<Vector3d> points;
    std::vector<cv::Vec3b> colours;
    std::vector<std::vector<float>> values;

    [[nodiscard]] TilesetScene scene(const std::vector<std::string>& fields) const {
        TilesetScene scene{.points = points, .colours = colours};
        for (std::size_t k = 0; k < fields.size(); ++k)
            scene.fields.push_back({fields[k], values[k]});
        return scene;
    }
    [[nodiscard]] Indices all() const {
        Indices all(points.size());
        std::iota(all.begin(), all.end(), 0U);
        return all;
    }
};

/// Points in a file, one record after the other: coordinates, values, colour.
class PointFile {
  public:
    PointFile(fs::path path, std::size_t fields)
        : path_(std::move(path)), fields_(fields), stream_(path_, std::ios::binary | std::ios::trunc) {
        require_good();
    }
    [[nodiscard]] std::size_t count() const { return count_; }
    [[nodiscard]] std::string record(const TilesetScene& scene, std::size_t i) const {
        std::string bytes(record_bytes(), '\0');
        std::memcpy(bytes.data(), scene.points[i].data(), sizeof(Vector3d));
        for (std::size_t k = 0; k < fields_; ++k)
            std::memcpy(bytes.data() + at_value(k), &scene.fields[k].values[i], sizeof(float));
        std::memcpy(bytes.data() + at_value(fields_), scene.colours[i].val, sizeof(cv::Vec3b));
        return bytes;
    }
    void add(std::string_view record) {
        stream_.write(record.data(), static_cast<std::streamsize>(record.size()));
        ++count_;
    }
    static Vector3d point_of(std::string_view record) {
        Vector3d point;
        std::memcpy(point.data(), record.data(), sizeof point);
        return point;
    }
    /// visit(number, record). After it, nothing is added.
    template <class Visit>
    void pass(const Visit& visit) {
        if (stream_.is_open())
            stream_.close();
        require_good();
        std::ifstream from(path_, std::ios::binary);
        constexpr std::size_t at_once = 1 << 14;
        std::string block(at_once * record_bytes(), '\0');
        for (std::size_t first = 0; first < count_; first += at_once) {
            const std::size_t some = std::min(at_once, count_ - first);
            if (!from.read(block.data(), static_cast<std::streamsize>(some * record_bytes())))
                throw Outage(path_.string() + ": not read again");
            for (std::size_t k = 0; k < some; ++k)
                visit(first + k, std::string_view(block).substr(k * record_bytes(), record_bytes()));
        }
    }
    void append(std::string_view record, PointArrays& to) const {
        to.points.push_back(point_of(record));
        to.values.resize(fields_);
        for (std::size_t k = 0; k < fields_; ++k)
            std::memcpy(&to.values[k].emplace_back(), record.data() + at_value(k), sizeof(float));
        std::memcpy(to.colours.emplace_back().val, record.data() + at_value(fields_), sizeof(cv::Vec3b));
    }
    void load(PointArrays& to) {
        pass([&](std::size_t, std::string_view record) { append(record, to); });
    }
    void remove() {
        stream_.close();
        std::error_code none;
        fs::remove(path_, none);
    }

  private:
    static std::size_t at_value(std::size_t k) { return sizeof(Vector3d) + k * sizeof(float); }
    [[nodiscard]] std::size_t record_bytes() const { return at_value(fields_) + sizeof(cv::Vec3b); }
    void require_good() const {
        if (!stream_)
            throw Outage(path_.string() + ": not written; is the disk full?");
    }

    fs::path path_;
    std::size_t fields_, count_ = 0;
    std::ofstream stream_;
};

} // namespace

TilesWritten write_tiles3d(const fs::path& folder, const TilesetScene& scene, const TilesetOptions& options) {
    return during(folder.string(), [&] {
        Indices points = indices_where(scene.points.size(), [&](std::size_t i) { return scene.points[i].allFinite(); });
        if (points.empty())
            throw Error(no_points);
        constexpr std::uint64_t bytes_each = 40; // indices twice, and what tiles under work hold
        require_memory(bytes_each * points.size(), fmt::format("tiles of {}", counted(points.size(), "point")));
        AlignedBox3d box;
        for (const std::uint32_t i : points)
            box.extend(scene.points[i]);
        const std::size_t left_out = scene.points.size() - points.size();
        const fs::path part = part_of(folder);
        remove_folder(part);
        const Tile root = Octree(part, scene, options).tile(std::move(points), cube_about(box), "r", 0);
        TilesWritten written = published(folder, root, options, scene.earth_from_tiles);
        written.left_out = left_out;
        return written;
    });
}

struct LargeTileset::Parts {
    fs::path folder, part;
    TilesetOptions options;
    std::size_t at_once, left_out = 0;
    std::vector<std::string> fields;
    std::optional<PointFile> all;
    AlignedBox3d box;

    [[nodiscard]] PointFile file(const std::string& name) const { return {part / ("." + name), fields.size()}; }

    [[nodiscard]] Tile tile(PointFile points, const Cube& cube, const std::string& name, int level) const {
        if (points.count() <= std::max(at_once, options.most_points) || level >= deepest) {
            PointArrays arrays;
            points.load(arrays);
            points.remove();
            const TilesetScene scene = arrays.scene(fields);
            return Octree(part, scene, options).tile(arrays.all(), cube, name, level);
        }
        std::array<std::optional<PointFile>, 8> below;
        PointArrays own = coarse(points, cube, name, below);
        points.remove();
        for (std::optional<PointFile>& each : below)
            if (each && are_few(each->count(), options)) {
                each->load(own);
                each->remove();
                each.reset();
            }
        const TilesetScene scene = own.scene(fields);
        Tile made = Octree(part, scene, options).written(own.all(), cube, name);
        for (int octant = 0; octant < 8; ++octant)
            if (std::optional<PointFile>& each = below[static_cast<std::size_t>(octant)])
                adopt(made, tile(*std::move(each), cube.child(octant), name + std::to_string(octant), level + 1));
        return made;
    }

    [[nodiscard]] PointArrays coarse(PointFile& points, const Cube& cube, const std::string& name,
                                     std::array<std::optional<PointFile>, 8>& below) const {
        CoarsePoints best(cube);
        points.pass(
            [&](std::size_t number, std::string_view record) { best.look_at(PointFile::point_of(record), number); });
        const std::vector<std::size_t> chosen = best.chosen(most_chosen(options));
        PointArrays own;
        auto next = chosen.begin();
        points.pass([&](std::size_t number, std::string_view record) {
            if (next != chosen.end() && *next == number) {
                points.append(record, own);
                ++next;
                return;
            }
            const std::size_t octant = octant_of(PointFile::point_of(record), cube);
            if (!below[octant])
                below[octant] = file(name + std::to_string(octant));
            below[octant]->add(record);
        });
        return own;
    }
};

LargeTileset::LargeTileset(fs::path folder, TilesetOptions options, std::size_t at_once)
    : parts_(std::make_unique<Parts>()) {
    parts_->part = part_of(folder);
    parts_->folder = std::move(folder);
    parts_->options = options;
    parts_->at_once = at_once;
    remove_folder(parts_->part);
}
LargeTileset::~LargeTileset() { remove_folder(parts_->part); }

void LargeTileset::add(const TilesetScene& some) {
    Parts& parts = *parts_;
    if (!parts.all) {
        for (const AddedField& field : some.fields)
            parts.fields.push_back(field.name);
        std::error_code seen_by_the_file;
        fs::create_directories(parts.part, seen_by_the_file);
        parts.all.emplace(parts.file("r"));
    }
    for (std::size_t i = 0; i < some.points.size(); ++i) {
        if (!some.points[i].allFinite()) {
            ++parts.left_out;
            continue;
        }
        parts.box.extend(some.points[i]);
        parts.all->add(parts.all->record(some, i));
    }
}

TilesWritten LargeTileset::finish(const std::optional<Eigen::Isometry3d>& earth_from_tiles) {
    Parts& parts = *parts_;
    return during(parts.folder.string(), [&] {
        if (!parts.all || parts.all->count() == 0)
            throw Error(no_points);
        const Tile root = parts.tile(*std::move(parts.all), cube_about(parts.box), "r", 0);
        TilesWritten written = published(parts.folder, root, parts.options, earth_from_tiles);
        written.left_out = parts.left_out;
        return written;
    });
}

} // namespace scanshade
