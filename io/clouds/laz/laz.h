// LAZ: the points of a LAS file in compressed chunks. This room knows the block of points and the record that describes
// it; io/clouds/las.cpp knows the rest of the file. All failures throw Error, naming chunk, point and byte, not the
// file.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace scanshade::laz {

/// User and number of the variable length record that describes the compression.
constexpr std::string_view record_user = "laszip encoded";
constexpr std::uint16_t record_id = 22204;

/// How the records of a file are compressed.
struct Packing {
    int compressor = 2;                 ///< 1: one stream, 2: chunks, 3: chunks of layers
    std::uint32_t chunk_points = 50000; ///< varying_chunks: the table has the numbers
    bool times = false, colours = false, infrared = false;
    std::size_t extra = 0;                     ///< bytes behind the format's own fields
    std::size_t length = 0;                    ///< bytes of a record
    int colour_version = 3, extra_version = 3; ///< of layered items
};
constexpr std::uint32_t varying_chunks = 0xffffffff;

/// From the body of the describing record. Refuses what is not read: point formats 4, 5, 9 and 10 (wave packets),
/// items of version 1.
[[nodiscard]] Packing packing_of(std::string_view body, int point_format, std::size_t record_length);
/// What pack() makes of that format: chunks of 50000 points.
[[nodiscard]] Packing usual_packing(int point_format, std::size_t record_length);
/// The body of the describing record.
[[nodiscard]] std::string described(const Packing& packing);

/// Where a chunk lies in its file, and which points it holds.
struct Chunk {
    std::uint64_t begin = 0, bytes = 0, first = 0, count = 0;
};
/// Reads so many bytes of the file from a place that is in it.
using ReadBytes = std::function<std::string(std::uint64_t at, std::uint64_t count)>;
/// The chunks as the table has them, checked against each other and the number of points. The block of points begins
/// at `begin`; `end`, where it ends at the latest, moves behind the table. Not for compressor 1, which has no chunks.
[[nodiscard]] std::vector<Chunk> chunks_of(const ReadBytes& read, std::uint64_t file_size, std::uint64_t begin,
                                           std::uint64_t& end, std::uint64_t count, const Packing& packing);
/// The points of a chunk from its bytes. `number`: its place in the table.
[[nodiscard]] std::string unpacked_chunk(std::string_view bytes, const Chunk& chunk, std::size_t number,
                                         const Packing& packing);

/// Packs points that come in any portions; the bytes are those of packed().
class Packer {
  public:
    /// `counts`: the points of each chunk, where chunks vary; other chunks have those that `packing` says.
    explicit Packer(const Packing& packing, std::vector<std::uint32_t> counts = {})
        : packing_(packing), counts_(std::move(counts)) {}
    /// What can be written of the block's chunks so far.
    [[nodiscard]] std::string add(std::string_view points);
    /// The rest: the last chunk and the table. The block's first eight bytes, which come before all chunks, are
    /// table().
    [[nodiscard]] std::string finish();
    /// Where the table begins in a file whose block begins at `begin`, as the block's first eight bytes. After
    /// finish().
    [[nodiscard]] std::string table(std::uint64_t begin) const;
    /// Where the chunks lie in that file. After finish().
    [[nodiscard]] std::vector<Chunk> chunks(std::uint64_t begin) const;
    /// Bytes of the block. After finish().
    [[nodiscard]] std::uint64_t size() const { return size_; }

  private:
    [[nodiscard]] std::string pack(bool all);
    [[nodiscard]] std::size_t bytes_of(std::size_t chunk) const;

    Packing packing_;
    std::vector<std::uint32_t> counts_;
    std::string waiting_;
    std::vector<Chunk> chunks_; ///< of a block that begins at 0
    std::uint64_t packed_ = 0, size_ = 0;
};

struct Unpacked {
    std::string points;        ///< record after record, as an uncompressed file has them
    std::size_t end = 0;       ///< of the block, as an offset in the file
    std::vector<Chunk> chunks; ///< as they lie in the file
};
/// `file` is the whole file, whose block of points begins at `begin` and ends at `end` at the latest. Chunks are
/// decoded on all cores. Memory is taken for what chunks can hold, in steps where the number of points is beyond common
/// sense.
[[nodiscard]] Unpacked unpacked(std::string_view file, std::size_t begin, std::size_t end, std::size_t count,
                                const Packing& packing);

/// The block of points for a file in which it begins at `begin`. The bytes do not depend on the number of cores.
[[nodiscard]] std::string packed(std::string_view points, std::size_t begin, Packer& packer);
[[nodiscard]] std::string packed(std::string_view points, std::size_t begin, const Packing& packing);

} // namespace scanshade::laz
