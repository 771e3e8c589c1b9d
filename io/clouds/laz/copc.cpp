// The pages of COPC's hierarchy, checked against the chunks and moved with them.
#include "io/clouds/laz/copc.h"

#include "io/clouds/laz/items.h"
#include "projection/base/error.h"

#include <algorithm>
#include <array>
#include <fmt/format.h>
#include <functional>
#include <limits>
#include <set>

namespace scanshade::laz {

namespace {

constexpr std::size_t entry_size = 32, at_root = 40, at_root_size = 48; // the latter two of info
constexpr std::int32_t deepest_level = 31, another_page = -1;

/// A node, or a page with a subtree, as its page names it.
struct OctreeEntry {
    std::array<std::int32_t, 4> key{}; ///< level, x, y, z
    std::uint64_t offset = 0;
    std::int32_t bytes = 0, count = 0;
    std::uint64_t at = 0; ///< of the entry itself, in the file

    [[nodiscard]] std::string name() const {
        return fmt::format("{} {}-{}-{}-{}", count == another_page ? "page of node" : "node", key[0], key[1], key[2],
                           key[3]);
    }
};

OctreeEntry octree_entry(const char* from, std::uint64_t at) {
    OctreeEntry entry;
    for (std::size_t i = 0; i < 4; ++i)
        entry.key[i] = load<std::int32_t>(from + 4 * i);
    entry.offset = load<std::uint64_t>(from + 16);
    entry.bytes = load<std::int32_t>(from + 24);
    entry.count = load<std::int32_t>(from + 28);
    entry.at = at;
    return entry;
}

/// A cube of the octree that is there at most once.
void check_key(const OctreeEntry& entry, std::set<std::array<std::int32_t, 4>>& seen) {
    const std::int32_t level = entry.key[0];
    if (level < 0 || level > deepest_level)
        throw Error(fmt::format("level {} at byte {}, expected 0 .. {}", level, entry.at, deepest_level));
    for (const std::int32_t place : {entry.key[1], entry.key[2], entry.key[3]})
        if (place < 0 || place >= std::int64_t(1) << level)
            throw Error(fmt::format("{} at byte {} is outside of the octree", entry.name(), entry.at));
    if (entry.count < another_page)
        throw Error(fmt::format("{} at byte {}: {} points", entry.name(), entry.at, entry.count));
    if (!seen.insert(entry.key).second)
        throw Error(fmt::format("{} is there twice, again at byte {}", entry.name(), entry.at));
}

/// Visits the entries of all pages, from the root on.
void walk_pages(std::string_view info, const Hierarchy& hierarchy,
                const std::function<void(const OctreeEntry&)>& visit) {
    struct Page {
        std::uint64_t at, bytes;
    };
    std::set<std::uint64_t> met;
    std::set<std::array<std::int32_t, 4>> nodes, subtrees;
    std::vector<Page> open{
        {load<std::uint64_t>(info.data() + at_root), load<std::uint64_t>(info.data() + at_root_size)}};
    while (!open.empty()) {
        const Page page = open.back();
        open.pop_back();
        const std::uint64_t size = hierarchy.pages.size();
        if (page.at < hierarchy.at || page.at - hierarchy.at > size || page.bytes > size - (page.at - hierarchy.at))
            throw Error(fmt::format("page at byte {} of {} bytes, the hierarchy lies at bytes {} .. {}", page.at,
                                    page.bytes, hierarchy.at, hierarchy.at + size));
        if (page.bytes % entry_size != 0)
            throw Error(fmt::format("page at byte {} has {} bytes, expected a multiple of {}", page.at, page.bytes,
                                    entry_size));
        if (!met.insert(page.at).second)
            throw Error(fmt::format("page at byte {} is met twice", page.at));
        for (std::uint64_t at = page.at; at < page.at + page.bytes; at += entry_size) {
            const OctreeEntry entry = octree_entry(hierarchy.pages.data() + (at - hierarchy.at), at);
            check_key(entry, entry.count == another_page ? subtrees : nodes);
            visit(entry);
            if (entry.count == another_page)
                open.push_back({entry.offset, static_cast<std::uint32_t>(entry.bytes)});
        }
    }
}

std::size_t chunk_at(const std::vector<Chunk>& chunks, std::uint64_t begin) {
    const auto found = std::ranges::lower_bound(chunks, begin, {}, &Chunk::begin);
    return found == chunks.end() || found->begin != begin ? chunks.size()
                                                          : static_cast<std::size_t>(found - chunks.begin());
}

} // namespace

void check_octree(std::string_view info, const Hierarchy& hierarchy, const std::vector<Chunk>& chunks) {
    std::vector<bool> named(chunks.size());
    walk_pages(info, hierarchy, [&](const OctreeEntry& entry) {
        if (entry.count <= 0)
            return;
        const std::size_t i = chunk_at(chunks, entry.offset);
        if (i == chunks.size() || static_cast<std::uint64_t>(entry.bytes) != chunks[i].bytes)
            throw Error(fmt::format("{} has {} bytes from byte {} on, which is no chunk of points (entry at byte {})",
                                    entry.name(), entry.bytes, entry.offset, entry.at));
        if (static_cast<std::uint64_t>(entry.count) != chunks[i].count)
            throw Error(fmt::format("{} has {} points, its chunk {} (entry at byte {})", entry.name(), entry.count,
                                    chunks[i].count, entry.at));
        if (named[i])
            throw Error(fmt::format("{} has the chunk of another node (entry at byte {})", entry.name(), entry.at));
        named[i] = true;
    });
    if (const auto left = std::ranges::find(named, false); left != named.end()) {
        const auto i = static_cast<std::size_t>(left - named.begin());
        throw Error(fmt::format("chunk {} of {} points at byte {} is in no node", i, chunks[i].count, chunks[i].begin));
    }
}

void move_octree(std::string& info, Hierarchy& hierarchy, std::uint64_t to, const std::vector<Chunk>& before,
                 const std::vector<Chunk>& after) {
    std::string moved = hierarchy.pages;
    walk_pages(info, hierarchy, [&](const OctreeEntry& entry) {
        char* const place = moved.data() + (entry.at - hierarchy.at) + 16;
        if (entry.count == another_page) {
            store(place, entry.offset - hierarchy.at + to);
            return;
        }
        const Chunk chunk = entry.count > 0 ? after.at(chunk_at(before, entry.offset)) : Chunk();
        if (chunk.bytes > std::numeric_limits<std::int32_t>::max())
            throw Error(fmt::format("{} gets {} bytes, more than COPC can name", entry.name(), chunk.bytes));
        store(place, chunk.begin);
        store(place + 8, static_cast<std::int32_t>(chunk.bytes));
    });
    store(info.data() + at_root, load<std::uint64_t>(info.data() + at_root) - hierarchy.at + to);
    hierarchy = {std::move(moved), to};
}

} // namespace scanshade::laz
