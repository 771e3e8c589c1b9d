// COPC stays COPC: octree, order and everything else are kept while each record gains fields; a damaged octree is not.
#include "io/captures/capture.h"
#include "io/clouds/cloud_file.h"
#include "io/clouds/cloud_stream.h"
#include "io/clouds/format.h"
#include "projection/base/error.h"
#include "tests/support/files.h"
#include "tests/support/laz_file.h"

#include <functional>
#include <gtest/gtest.h>
#include <map>
#include <random>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using laz::load, laz::store;
using tests::copc_file, tests::twelve_records;
using tests::file_bytes, tests::write_file, tests::TemporaryFolder, tests::says;

constexpr std::size_t info_at = 429, root_at = info_at + 40, root_size_at = info_at + 48, evlrs_at = 235;

using Key = std::array<std::int32_t, 4>;
struct Node {
    std::uint64_t begin = 0;
    std::string records;
};

/// The nodes of a file, as a program reads them that knows no chunk table: pages from the root on, each node from its
/// own bytes.
std::map<Key, Node> nodes_of(const std::string& file) {
    const laz::Packing packing = laz::usual_packing(file[104] & 63, load<std::uint16_t>(file.data() + 105));
    std::map<Key, Node> nodes;
    const std::function<void(std::uint64_t, std::uint64_t)> page = [&](std::uint64_t begin, std::uint64_t bytes) {
        for (std::uint64_t at = begin; at < begin + bytes; at += 32) {
            const Key key = load<Key>(file.data() + at);
            const auto offset = load<std::uint64_t>(file.data() + at + 16);
            const auto size = load<std::uint32_t>(file.data() + at + 24);
            const auto count = load<std::int32_t>(file.data() + at + 28);
            if (count == -1) {
                page(offset, size);
                continue;
            }
            EXPECT_FALSE(nodes.contains(key));
            Node& node = nodes[key];
            node.begin = offset;
            if (count > 0)
                node.records = laz::unpacked_chunk(std::string_view(file).substr(offset, size),
                                                   {0, size, 0, static_cast<std::uint64_t>(count)}, 0, packing);
            else
                EXPECT_EQ(offset, 0U);
        }
    };
    page(load<std::uint64_t>(file.data() + root_at), load<std::uint64_t>(file.data() + root_size_at));
    return nodes;
}

std::string random_records(std::size_t count) {
    constexpr std::size_t length = 39;
    std::mt19937 random(7);
    std::string all, record(length, '\1');
    for (std::size_t i = 0; i < count; ++i) {
        for (char& byte : record)
            if (random() % 8 == 0)
                byte = static_cast<char>(random() % 3 == 0 ? random() : static_cast<unsigned>(byte) + 1);
        record[15] = record[16] = 1; // neither withheld nor noise
        all += record;
    }
    return all;
}

const std::vector<tests::CopcNode> many_points_in_nodes{{{1, 1, 1, 0}, 700}, {{4, 8, 8, 1}, 1},    {{0, 0, 0, 0}, 40},
                                                        {{2, 2, 2, 0}, 0},   {{3, 4, 4, 0}, 3000}, {{1, 0, 0, 1}, 59}};

std::vector<std::string> test_files() { return {copc_file(), copc_file(random_records(3800), many_points_in_nodes)}; }

Cloud read(const fs::path& file) {
    std::vector<std::string> warnings; // of boxes that the header does not have
    return read_cloud(file, warnings);
}

/// A value that tells its point.
float value_of(std::size_t point) { return static_cast<float>(point) / 4096; }

/// The same written whole and from its blocks; the file's bytes, which must be equal.
std::string written(const fs::path& folder, const fs::path& file, const std::vector<std::string>& names) {
    const Cloud cloud = read(file);
    std::vector<float> values(cloud.points.size());
    for (std::size_t i = 0; i < values.size(); ++i)
        values[i] = value_of(i);
    std::vector<AddedField> added;
    for (const std::string& name : names)
        added.push_back({name, values});
    write_cloud(folder / "whole.laz", cloud, added);
    std::vector<std::string> warnings;
    const CloudStream stream(file, cloud_shape(file, warnings).value());
    EXPECT_EQ(stream.records().octree_damage, cloud.records->octree_damage);
    EXPECT_EQ(written_name("a.copc", stream.records()), written_name("a.copc", *cloud.records));
    stream.write(folder / "blocks.laz", names, [&](std::size_t first, const CloudRecords& block) {
        const auto begin = values.begin() + static_cast<std::ptrdiff_t>(first);
        const std::vector<float> part(begin, begin + static_cast<std::ptrdiff_t>(block.point_count));
        return CloudStream::BlockValues{std::vector(names.size(), part), {}};
    });
    EXPECT_TRUE(file_bytes(folder / "whole.laz") == file_bytes(folder / "blocks.laz"));
    return file_bytes(folder / "whole.laz");
}

TEST(Copc, nodes_keep_their_records_and_gain_fields) {
    const TemporaryFolder folder;
    for (const std::string& before : test_files()) {
        const fs::path file = write_file(folder / "a.copc.laz", before);
        const std::string after = written(folder.path(), file, {"ambient_occlusion", "ao_confidence"});
        const auto old_nodes = nodes_of(before), nodes = nodes_of(after);
        const std::size_t length = load<std::uint16_t>(before.data() + 105);
        EXPECT_EQ(load<std::uint16_t>(after.data() + 105), length + 8);
        EXPECT_TRUE(std::ranges::equal(
            old_nodes, nodes, {}, [](const auto& n) { return n.first; }, [](const auto& n) { return n.first; }));
        std::map<std::uint64_t, Key> order; // in the file
        for (const auto& [key, node] : old_nodes)
            if (!node.records.empty())
                order[node.begin] = key;
        std::size_t point = 0;
        std::uint64_t end = 0;
        for (const auto& [begin, key] : order) {
            const Node& node = nodes.at(key);
            const std::string& records = old_nodes.at(key).records;
            EXPECT_GT(node.begin, end) << "chunks keep their order";
            end = node.begin;
            ASSERT_EQ(node.records.size() / (length + 8), records.size() / length);
            for (std::size_t i = 0; i < records.size() / length; ++i, ++point) {
                const std::string_view record = std::string_view(node.records).substr(i * (length + 8), length + 8);
                ASSERT_EQ(record.substr(0, length), std::string_view(records).substr(i * length, length));
                ASSERT_EQ(load<float>(record.data() + length), value_of(point));
                ASSERT_EQ(load<float>(record.data() + length + 4), value_of(point));
            }
        }
        EXPECT_EQ(point, load<std::uint64_t>(before.data() + 247));
        EXPECT_TRUE(says(describe(*read(folder / "whole.laz").records), "COPC of")) << "table and nodes agree";
    }
}

TEST(Copc, everything_beside_the_points_is_kept) {
    const TemporaryFolder folder;
    for (const std::string& before : test_files()) {
        const std::string after =
            written(folder.path(), write_file(folder / "a.copc.laz", before), {"ambient_occlusion"});
        // But for record length, number of records, and offsets.
        std::string header = after.substr(0, root_at);
        for (const auto& [at, bytes] : {std::pair(96, 8), {105, 2}, {235, 8}})
            header.replace(static_cast<std::size_t>(at), static_cast<std::size_t>(bytes), before,
                           static_cast<std::size_t>(at), static_cast<std::size_t>(bytes));
        EXPECT_TRUE(header == before.substr(0, root_at));
        EXPECT_EQ(after.substr(root_size_at, 112), before.substr(root_size_at, 112));
        EXPECT_EQ(load<std::uint32_t>(after.data() + 100), 4U);
        EXPECT_NE(after.substr(0, load<std::uint32_t>(after.data() + 96)).find("before"), std::string::npos);
        const auto evlrs = load<std::uint64_t>(after.data() + evlrs_at),
                   old = load<std::uint64_t>(before.data() + evlrs_at);
        EXPECT_EQ(after.size() - evlrs, before.size() - old);
        EXPECT_EQ(after.substr(evlrs, 64 + 60), before.substr(old, 64 + 60));
        EXPECT_EQ(after.substr(after.size() - 64), before.substr(before.size() - 64));
        EXPECT_EQ(load<std::uint64_t>(after.data() + root_at) - evlrs,
                  load<std::uint64_t>(before.data() + root_at) - old);
    }
}

TEST(Copc, fields_that_are_there_are_replaced_and_nothing_else) {
    const TemporaryFolder folder;
    const fs::path file = write_file(folder / "a.copc.laz", test_files()[1]);
    const fs::path once = write_file(folder / "once.copc.laz", written(folder.path(), file, {"ambient_occlusion"}));
    EXPECT_TRUE(written(folder.path(), once, {"ambient_occlusion"}) == file_bytes(once));
    const std::vector<float> zero(3800, 0.0F);
    write_cloud(folder / "twice.laz", read(once), {{"ambient_occlusion", zero}});
    const std::string twice = file_bytes(folder / "twice.laz");
    EXPECT_EQ(load<std::uint16_t>(twice.data() + 105), 43);
    for (const auto& [key, node] : nodes_of(twice))
        for (std::size_t at = 39; at < node.records.size(); at += 43)
            ASSERT_EQ(load<float>(node.records.data() + at), 0);
}

/// What is wrong with the octree of a file, which a capture refuses. Without it the points are plain LAZ, under another
/// name.
std::string damage(const fs::path& folder, const std::string& bytes) {
    const fs::path file = write_file(folder / "a.copc.laz", bytes);
    const Cloud cloud = read(file);
    EXPECT_EQ(cloud.records->points, twelve_records(7));
    EXPECT_TRUE(cloud.records->octree.empty());
    EXPECT_EQ(written_name("a.copc", *cloud.records), "a.plain.laz");
    std::string refusal;
    try {
        (void)open_capture(file).load(0);
    } catch (const Error& error) {
        refusal = error.what();
    }
    EXPECT_TRUE(says(refusal, cloud.records->octree_damage)) << refusal;
    EXPECT_TRUE(says(refusal, "--copc no")) << refusal;
    CaptureOptions as_laz;
    as_laz.copc = false;
    EXPECT_TRUE(open_capture(file, as_laz).load(0).cloud->records->octree.empty());
    const std::string plain = written(folder, file, {"ambient_occlusion"});
    EXPECT_EQ(plain.find("copc"), std::string::npos) << "an octree that points nowhere";
    EXPECT_EQ(plain.substr(load<std::uint64_t>(plain.data() + evlrs_at) + 60, 4), "kept");
    EXPECT_EQ(plain.substr(plain.size() - 4), "last");
    const Cloud back = read(folder / "whole.laz");
    EXPECT_EQ(back.records->octree_damage, "");
    for (std::size_t i = 0; i < 12; ++i)
        EXPECT_EQ(back.records->record(i).substr(0, 40), cloud.records->record(i));
    return cloud.records->octree_damage;
}

TEST(Copc, a_damaged_octree_is_refused_and_plain_laz_where_asked) {
    const TemporaryFolder folder;
    const std::string sound = copc_file();
    // Pages: nodes 0-0-0-0, 1-0-0-0 (empty) and 1-1-0-0, page 2-2-0-0; then 2-2-0-0 and 3-5-1-0.
    const auto root = load<std::uint64_t>(sound.data() + root_at), subtree = root + 4 * 32;
    const auto with = [&](std::uint64_t at, auto value) {
        std::string bytes = sound;
        store(bytes.data() + at, value);
        return damage(folder.path(), bytes);
    };
    EXPECT_TRUE(says(with(root + 16, std::uint64_t(1) << 40), "node 0-0-0-0 has"));
    EXPECT_TRUE(says(with(root + 16, std::uint64_t(1) << 40), "bytes from byte 1099511627776 on, which is no chunk"));
    EXPECT_TRUE(says(with(root + 24, 1), "node 0-0-0-0 has 1 bytes"));
    EXPECT_TRUE(says(with(root + 28, 4), "node 0-0-0-0 has 4 points, its chunk 3"));
    EXPECT_TRUE(says(with(root + 28, -2), "node 0-0-0-0 at byte"));
    EXPECT_TRUE(says(with(root + 28, 0), "chunk 1 of 3 points at byte"));
    EXPECT_TRUE(says(with(root + 32, std::array{0, 0, 0, 0}), "node 0-0-0-0 is there twice"));
    EXPECT_TRUE(says(with(root + 64, std::array{32, 0, 0, 0}), "level 32 at byte"));
    EXPECT_TRUE(says(with(root + 64, std::array{1, 2, 0, 0}), "node 1-2-0-0 at byte"));
    EXPECT_TRUE(says(with(root + 96 + 16, root), "is met twice")) << "a circle of pages";
    EXPECT_TRUE(says(with(root + 96 + 24, 63), "has 63 bytes, expected a multiple of 32"));
    EXPECT_TRUE(says(with(root + 96 + 24, 32), "is in no node"));
    EXPECT_TRUE(says(with(root + 96 + 24, 96), "page at byte")) << "beyond the record";
    EXPECT_TRUE(says(with(root_at, std::uint64_t(8)), "page at byte 8"));
    EXPECT_TRUE(says(with(root_at, ~std::uint64_t(31)), "page at byte"));
    EXPECT_TRUE(says(with(root_size_at, std::uint64_t(33)), "has 33 bytes, expected a multiple of 32"));
    EXPECT_TRUE(says(with(subtree + 16, load<std::array<char, 16>>(sound.data() + root + 16)),
                     "node 2-2-0-0 has the chunk of another node"));
    EXPECT_TRUE(says(with(root - 60 + 18, std::uint16_t(10000)), "no hierarchy is among the records"));
    std::string late = sound; // the octree's record behind another
    const std::size_t other = load<std::uint32_t>(sound.data() + 96) - 60;
    late.erase(other, 60).insert(375, sound, other, 60);
    EXPECT_TRUE(says(damage(folder.path(), late), "is not the first, at byte 375"));
}

TEST(Copc, any_changed_byte_is_refused_or_said_or_changes_no_node) {
    const TemporaryFolder folder;
    const std::string sound = copc_file();
    const auto evlrs = load<std::uint64_t>(sound.data() + evlrs_at);
    for (std::size_t at = 375; at < sound.size(); ++at) {
        if (at == 375 + 54 + 160 + 54 + 50) // of records that are not about the octree
            at = evlrs;
        for (const char change : {'\xff', '\x01'}) {
            std::string bytes = sound;
            bytes[at] = static_cast<char>(bytes[at] ^ change);
            Cloud cloud;
            try {
                cloud = read(write_file(folder / "a.copc.laz", bytes));
            } catch (const Error&) {
                continue;
            }
            if (cloud.records->octree.empty())
                continue;
            const std::vector<float> values(12, 0.5F);
            write_cloud(folder / "b.laz", cloud, {{"ambient_occlusion", values}});
            std::size_t points = 0;
            for (const auto& [key, node] : nodes_of(file_bytes(folder / "b.laz")))
                points += node.records.size() / 44;
            EXPECT_EQ(points, 12U) << at;
        }
    }
}

TEST(Copc, plain_laz_loses_a_name_that_says_copc) {
    const TemporaryFolder folder;
    std::vector<std::string> warnings;
    const laz::Packing packing = laz::usual_packing(7, 40);
    const fs::path file = write_file(folder / "a.copc.laz", tests::laz_file(7, packing, twelve_records(7)));
    const Cloud cloud = read_cloud(file, warnings);
    EXPECT_TRUE(tests::warned(warnings, "the name says COPC"));
    EXPECT_EQ(written_name("a.copc", *cloud.records), "a.plain.laz");
    EXPECT_EQ(written_name("b", *cloud.records), "b.laz");
    EXPECT_EQ(written_name("a.copc", *read(write_file(folder / "b.laz", copc_file())).records), "a.copc.laz");
}

} // namespace
} // namespace scanshade
