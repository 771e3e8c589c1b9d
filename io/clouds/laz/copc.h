// COPC 1.0 (copc.io): the octree whose nodes are the chunks of a LAZ file. This unit knows the pages of its hierarchy
// and the record that names the first one; io/clouds/las.cpp finds them in the file.
#pragma once

#include "io/clouds/laz/laz.h"

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace scanshade::laz {

/// User of the first variable length record and of the extended one that holds the hierarchy; their numbers; bytes of
/// the first one's body.
constexpr std::string_view octree_user = "copc";
constexpr std::uint16_t octree_id = 1, hierarchy_id = 1000;
constexpr std::size_t octree_info_size = 160;

/// All pages, and where they lie.
struct Hierarchy {
    std::string pages;    ///< body of the extended record
    std::uint64_t at = 0; ///< its place in the file
};

/// Checks that the nodes are the chunks: each chunk is one node's, with the table's place, bytes and number of points.
/// `info` is the first record's body. Throws Error naming page or node, and byte, where anything does not fit.
void check_octree(std::string_view info, const Hierarchy& hierarchy, const std::vector<Chunk>& chunks);

/// Info and pages of a checked octree, for a hierarchy at another place and chunks `after` in place of `before`, in the
/// same order. Keys, numbers of points, and the pages' places among each other stay. Throws Error for a chunk of more
/// bytes than an entry can name.
void move_octree(std::string& info, Hierarchy& hierarchy, std::uint64_t to, const std::vector<Chunk>& before,
                 const std::vector<Chunk>& after);

} // namespace scanshade::laz
