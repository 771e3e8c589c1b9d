// LAZ: the points of a LAS file in compressed chunks. This room knows the block of points and the record that describes
// it; io/clouds/las.cpp knows the rest of the file. All failures throw Error, naming chunk, point and byte, not the
// file.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

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

struct Unpacked {
    std::string points;  ///< record after record, as an uncompressed file has them
    std::size_t end = 0; ///< of the block, as an offset in the file
};
/// `file` is the whole file, whose block of points begins at `begin` and ends at `end` at the latest. Chunks are
/// decoded on all cores. Memory is taken for what chunks can hold, in steps where the number of points is beyond common
/// sense.
[[nodiscard]] Unpacked unpacked(std::string_view file, std::size_t begin, std::size_t end, std::size_t count,
                                const Packing& packing);

/// The block of points for a file in which it begins at `begin`. The bytes do not depend on the number of cores.
[[nodiscard]] std::string packed(std::string_view points, std::size_t begin, const Packing& packing);

} // namespace scanshade::laz
