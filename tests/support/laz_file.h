// LAS and LAZ files made in code.
#pragma once

#include "io/clouds/laz/items.h"
#include "io/clouds/laz/laz.h"

#include <array>
#include <string>
#include <vector>

namespace scanshade::tests {

using laz::load, laz::store;

/// Twelve records of format 3 or 7 with four extra bytes; those of format 7 change between two scanner channels.
inline std::string twelve_records(int format) {
    const std::size_t length = format == 3 ? 38 : 40;
    std::string all;
    for (int i = 0; i < 12; ++i) {
        std::string r(length, '\0');
        store(r.data(), 1000 + 37 * i + 5 * (i % 3));
        store(r.data() + 4, 2000 - 11 * i * i);
        store(r.data() + 8, 300 + i * i * i % 97);
        store(r.data() + 12, static_cast<std::uint16_t>(257 * i % 1000));
        const std::uint64_t time =
            0x4112345600000000 + 5000U * static_cast<unsigned>(i) + (i >= 8 ? std::uint64_t(1) << 40 : 0);
        const std::array<std::uint16_t, 3> colour{static_cast<std::uint16_t>(100 + 300 * i),
                                                  static_cast<std::uint16_t>(200 + 300 * i), 50};
        const std::uint16_t source = static_cast<std::uint16_t>(7 + i / 6);
        const int number = i % 3 + 1;
        if (format == 3) {
            r[14] = static_cast<char>(number | 3 << 3);
            r[15] = static_cast<char>(2 + i % 2);
            r[16] = static_cast<char>(i - 5);
            r[17] = static_cast<char>(i / 4);
            store(r.data() + 18, source);
            store(r.data() + 20, time);
        } else {
            r[14] = static_cast<char>(number | 3 << 4);
            r[15] = static_cast<char>((i / 5) % 2 << 4);
            r[16] = static_cast<char>(2 + i % 2);
            r[17] = static_cast<char>(i / 4);
            store(r.data() + 18, static_cast<std::int16_t>(100 * i - 500));
            store(r.data() + 20, source);
            store(r.data() + 22, time);
        }
        store(r.data() + length - 10, colour);
        store(r.data() + length - 4, static_cast<float>(i) / 16);
        all += r;
    }
    return all;
}

inline std::string vlr(const std::string& user, std::uint16_t id, const std::string& data) {
    std::string bytes(54, '\0');
    user.copy(bytes.data() + 2, 16);
    store(bytes.data() + 18, id);
    store(bytes.data() + 20, static_cast<std::uint16_t>(data.size()));
    return bytes + data;
}

/// A LAS 1.4 header for points of `format`; with `packing` one of LAZ.
inline std::string las_header(int format, std::size_t length, std::size_t count, const laz::Packing* packing) {
    const std::string described =
        packing ? vlr(std::string(laz::record_user), laz::record_id, laz::described(*packing)) : "";
    std::string header(375, '\0');
    header.replace(0, 4, "LASF");
    header[24] = 1, header[25] = 4;
    store(header.data() + 94, std::uint16_t(375));
    store(header.data() + 96, static_cast<std::uint32_t>(375 + described.size()));
    store(header.data() + 100, packing ? 1U : 0U);
    header[104] = static_cast<char>(format | (packing ? 0x80 : 0));
    store(header.data() + 105, static_cast<std::uint16_t>(length));
    store(header.data() + 247, static_cast<std::uint64_t>(count));
    for (std::size_t axis = 0; axis < 3; ++axis)
        store(header.data() + 131 + 8 * axis, 0.01);
    return header + described;
}
inline std::string las_file(int format, std::size_t length, const std::string& records) {
    return las_header(format, length, records.size() / length, nullptr) + records;
}
inline std::string laz_file(int format, const laz::Packing& packing, const std::string& records,
                            const std::string& after = "") {
    const std::string header = las_header(format, packing.length, records.size() / packing.length, &packing);
    return header + laz::packed(records, header.size(), packing) + after;
}

inline std::string extended_vlr(const std::string& user, std::uint16_t id, const std::string& data) {
    std::string bytes(60, '\0');
    user.copy(bytes.data() + 2, 16);
    store(bytes.data() + 18, id);
    store(bytes.data() + 20, static_cast<std::uint64_t>(data.size()));
    return bytes + data;
}

struct CopcNode {
    std::array<std::int32_t, 4> key{}; ///< level, x, y, z
    std::uint32_t points = 0;          ///< that follow those of the node before in the file
};
/// Four levels and an empty node; neither in the order of the tree nor of their keys.
inline const std::vector<CopcNode> twelve_points_in_nodes{
    {{2, 2, 0, 0}, 2}, {{0, 0, 0, 0}, 3}, {{1, 0, 0, 0}, 0}, {{3, 5, 1, 0}, 3}, {{1, 1, 0, 0}, 4}};

/// COPC of records of format 7. Levels 2 and more, below the first such node, have a page of their own behind the
/// root's. Records of nobody's stand before and behind the points, the latter around the hierarchy.
inline std::string copc_file(const std::string& records = twelve_records(7),
                             const std::vector<CopcNode>& nodes = twelve_points_in_nodes) {
    std::vector<std::uint32_t> counts;
    std::size_t all = 0;
    for (const CopcNode& node : nodes) {
        all += node.points;
        if (node.points > 0)
            counts.push_back(node.points);
    }
    laz::Packing packing = laz::usual_packing(7, records.size() / all);
    packing.chunk_points = laz::varying_chunks;
    std::string header = las_header(7, packing.length, all, &packing), info(160, '\0');
    header.insert(375, vlr("copc", 1, info));
    header += vlr("ours", 7, "before");
    store(header.data() + 96, static_cast<std::uint32_t>(header.size()));
    store(header.data() + 100, 3U);
    laz::Packer packer(packing, counts);
    const std::string block = laz::packed(records, header.size(), packer), first = extended_vlr("ours", 8, "kept");
    const std::vector<laz::Chunk> chunks = packer.chunks(header.size());
    const std::uint64_t evlrs = header.size() + block.size(), root = evlrs + first.size() + 60;
    std::array<std::string, 2> pages;
    const auto add = [](std::string& page, const auto& key, std::uint64_t offset, std::size_t bytes, int count) {
        std::string entry(32, '\0');
        store(entry.data(), key), store(entry.data() + 16, offset);
        store(entry.data() + 24, static_cast<std::int32_t>(bytes)), store(entry.data() + 28, count);
        page += entry;
    };
    std::size_t next = 0;
    const CopcNode* subtree = nullptr;
    for (const CopcNode& node : nodes) {
        const laz::Chunk chunk = node.points > 0 ? chunks.at(next++) : laz::Chunk();
        if (node.key[0] >= 2 && !subtree)
            subtree = &node;
        add(pages[node.key[0] >= 2], node.key, chunk.begin, chunk.bytes, static_cast<int>(node.points));
    }
    if (subtree)
        add(pages[0], subtree->key, root + pages[0].size() + 32, pages[1].size(), -1);
    store(header.data() + 429, std::array{12.0, 12.0, 12.0, 12.0, 0.2});
    store(header.data() + 429 + 40, root);
    store(header.data() + 429 + 48, static_cast<std::uint64_t>(pages[0].size()));
    store(header.data() + 235, evlrs);
    store(header.data() + 243, 3U);
    return header + block + first + extended_vlr("copc", 1000, pages[0] + pages[1]) + extended_vlr("ours", 9, "last");
}

} // namespace scanshade::tests
