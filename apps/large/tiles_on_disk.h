// Tiles of a large cloud in a folder: points and values that outlive the process, so that a killed run is resumed.
#pragma once

#include "ao/cloud/large_cloud.h"

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace scanshade {

/// Files in the folder: `points`, all tiles' records in chunks; `index`, where the chunks are, written when all points
/// are there; `values-N`, written when tile N is done; `lock-N`, held by the process that computes tile N. All but the
/// last chunk of each tile are full, so that reading and writing are runs of many bytes.
class TilesOnDisk final : public TileStore {
  public:
    /// `key`: what the points and settings are; files of another key are removed. `source_points` of the cloud.
    /// `buffers` bytes wait in memory. `say` gets a sentence about the space before it is taken. `helps`: another
    /// process has made the files and finishes the cloud.
    TilesOnDisk(std::filesystem::path folder, std::string key, std::size_t source_points, std::uint64_t output_bytes,
                std::size_t buffers, std::function<void(const std::string&)> say, bool helps = false);
    ~TilesOnDisk() override;
    TilesOnDisk(const TilesOnDisk&) = delete;
    TilesOnDisk& operator=(const TilesOnDisk&) = delete;

    /// Throws Error where the folder's disk has too little space, before anything is written; Outage where this process
    /// helps and the files are of other points or settings.
    bool begin(const std::string& plan, std::size_t tiles, bool normals, double copies, std::string& decided) override;
    void add(std::size_t tile, std::uint32_t number, const Eigen::Vector3d& point, const Eigen::Vector3f& normal,
             bool core) override;
    void decide(const std::string& decided) override;
    [[nodiscard]] std::size_t count(std::size_t tile) const override;
    [[nodiscard]] TilePoints points(std::size_t tile) override;
    [[nodiscard]] std::optional<TileValues> values(std::size_t tile) override;
    void keep(std::size_t tile, TileValues values) override;
    /// Where the storage has no locks, a process is alone.
    [[nodiscard]] bool claim(std::size_t tile) override;
    void release() override;
    [[nodiscard]] bool helps() const override { return helps_; }

    [[nodiscard]] std::size_t tiles() const { return tiles_.size(); }
    [[nodiscard]] std::filesystem::path values_file(std::size_t tile) const;

  private:
    struct Chunk {
        std::uint64_t at = 0;
        std::uint32_t count = 0;
    };
    struct Tile {
        std::vector<Chunk> chunks;
        std::string waiting; ///< records
    };
    void flush(Tile& tile);
    void open(bool anew);
    [[nodiscard]] bool read_index(const std::string& key, std::string& decided);
    void require_space(double copies) const;
    [[nodiscard]] std::size_t record_bytes() const;

    std::filesystem::path folder_;
    std::string key_, whole_key_;
    std::size_t source_points_;
    std::uint64_t output_bytes_;
    std::size_t buffers_;
    std::function<void(const std::string&)> say_;
    std::vector<Tile> tiles_;
    std::size_t chunk_bytes_ = 0;
    bool normals_ = false;
    bool helps_;
    int handle_ = -1, lock_ = -1; ///< of the points, and of the tile that this process computes
    std::uint64_t end_ = 0;
};

/// Values of all points in the order of their numbers, from the files of all tiles.
class ValuesInOrder {
  public:
    explicit ValuesInOrder(const TilesOnDisk& tiles);
    /// For the points first .. first + count - 1. Numbers must rise from call to call, else seek() comes before.
    void read(std::size_t first, std::size_t count, std::vector<float>& visibility, std::vector<float>& error);
    void seek(std::size_t first);

    struct Shown {
        std::uint32_t number;
        Eigen::Vector3f normal;
    };
    /// The points with normals among these numbers, in order.
    [[nodiscard]] std::vector<Shown> shown(std::size_t first, std::size_t end) const;

  private:
    class Cursor;
    std::vector<std::shared_ptr<Cursor>> cursors_;
};

} // namespace scanshade
