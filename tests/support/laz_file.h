// LAS and LAZ files made in code.
#pragma once

#include "io/clouds/laz/items.h"
#include "io/clouds/laz/laz.h"

#include <array>
#include <string>

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

/// Three nodes of an octree as chunks of 1, 5 and 6 points.
inline std::string copc_file() {
    laz::Packing packing = laz::usual_packing(7, 40);
    packing.chunk_points = laz::varying_chunks;
    const std::string records = twelve_records(7), copc = vlr("copc", 1, std::string(160, '\0'));
    std::string header = las_header(7, 40, 12, &packing);
    header.insert(375, copc);
    store(header.data() + 96, static_cast<std::uint32_t>(header.size()));
    store(header.data() + 100, 2U);
    std::string block(8, '\0'), table(8, '\0');
    laz::Encoder encoder;
    laz::IntegerCoder numbers(32, 2);
    std::uint32_t points_before = 0, bytes_before = 0;
    for (const auto& [first, count] : {std::pair(0U, 1U), {1U, 5U}, {6U, 6U}}) {
        const laz::Packing usual = laz::usual_packing(7, 40);
        const std::string whole = laz::packed(records.substr(40 * first, 40 * count), 0, usual);
        const std::string chunk = whole.substr(8, load<std::uint64_t>(whole.data()) - 8);
        numbers.code(encoder, points_before, count, 0);
        numbers.code(encoder, bytes_before, static_cast<std::uint32_t>(chunk.size()), 1);
        points_before = count, bytes_before = static_cast<std::uint32_t>(chunk.size());
        block += chunk;
    }
    store(block.data(), static_cast<std::uint64_t>(header.size() + block.size()));
    table[4] = 3;
    const std::string behind = table + encoder.finish();
    std::string hierarchy(60, '\0'), kept(60, '\0');
    std::string_view("copc").copy(hierarchy.data() + 2, 4);
    store(hierarchy.data() + 20, std::uint64_t(96));
    std::string_view("ours").copy(kept.data() + 2, 4);
    store(kept.data() + 20, std::uint64_t(4));
    store(header.data() + 235, static_cast<std::uint64_t>(header.size() + block.size() + behind.size()));
    store(header.data() + 243, 2U);
    return header + block + behind + hierarchy + std::string(96, '\0') + kept + "kept";
}

} // namespace scanshade::tests
