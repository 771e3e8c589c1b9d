// LAZ: the coder against known streams, chunks against known bytes, random records there and back, and damaged files.
#include "io/clouds/cloud_file.h"
#include "io/clouds/cloud_records.h"
#include "io/clouds/laz/layered.h"
#include "io/clouds/laz/laz.h"
#include "io/clouds/laz/pointwise.h"
#include "tests/support/files.h"
#include "tests/support/laz_file.h"

#include <cmath>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <random>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using namespace tests;
using laz::load, laz::store;

std::string hex(std::string_view bytes) {
    std::string text;
    for (const char c : bytes)
        text += fmt::format("{:02x}", static_cast<unsigned char>(c));
    return text;
}
std::string unhex(std::string_view text) {
    std::string bytes;
    for (std::size_t i = 0; i + 1 < text.size(); i += 2)
        bytes += static_cast<char>(std::stoi(std::string(text.substr(i, 2)), nullptr, 16));
    return bytes;
}

// --- the coder; streams computed by another implementation ---

/// Encodes, compares with `expected`, decodes: `code` is called with both coders and the values, and returns them.
template <class Value, class Make>
void both_ways(const std::vector<Value>& values, const std::string& expected, Make&& make) {
    laz::Encoder encoder;
    auto coding = make();
    for (std::size_t i = 0; i < values.size(); ++i)
        coding(encoder, i, values);
    const std::string bytes = encoder.finish();
    EXPECT_EQ(hex(bytes), expected);
    laz::Decoder decoder(bytes, 0);
    auto decoding = make();
    std::vector<Value> found = values;
    for (std::size_t i = 0; i < values.size(); ++i) {
        found[i] = 0;
        found[i] = static_cast<Value>(decoding(decoder, i, found));
    }
    EXPECT_EQ(found, values);
    EXPECT_EQ(decoder.position(), bytes.size()) << "a stream is read to its last byte";
}

TEST(LazCoder, symbols_bits_and_integers_have_known_streams) {
    EXPECT_EQ(hex(laz::Encoder().finish()), "01000000");
    using Numbers = std::vector<std::uint32_t>;
    const auto symbols = [](unsigned size) {
        return [size] {
            return [model = laz::SymbolModel(size)](auto& coder, std::size_t i, const Numbers& v) mutable {
                return coder.symbol(model, v[i]);
            };
        };
    };
    Numbers four, many, one_in_five;
    for (std::uint32_t i = 0; i < 40; ++i)
        four.push_back(i * i % 4 == 1 ? 3 : i % 3);
    for (std::uint32_t i = 0; i < 20; ++i)
        many.push_back(37 * i % 256);
    for (std::uint32_t i = 0; i < 64; ++i)
        one_in_five.push_back(i % 5 == 0 ? 1 : 0);
    both_ways(four, "3b6e6e46147af643c2a9000000", symbols(4));
    both_ways(many, "00254a5cef8213a6394bde71039527bacd5ff28433000000", symbols(256));
    both_ways(one_in_five, "87b7172b11aa88000000", [] {
        return [model = laz::BitModel()](auto& coder, std::size_t i, const Numbers& v) mutable {
            return coder.bit(model, v[i] != 0) ? 1U : 0U;
        };
    });
    both_ways(Numbers{100, 300000, 0xdeadbeef, 0xabcde}, "c92063eafd07ccc17aca000000", [] {
        return [](auto& coder, std::size_t i, const Numbers& v) {
            return coder.bits(std::array{7U, 19U, 32U, 20U}[i], v[i]);
        };
    });
    const auto integers = [](unsigned bits, unsigned contexts) {
        return [bits, contexts] {
            return [coding = laz::IntegerCoder(bits, contexts), contexts](auto& coder, std::size_t i,
                                                                          const Numbers& v) mutable {
                return coding.code(coder, i == 0 ? 0 : v[i - 1], v[i], static_cast<unsigned>(i % contexts));
            };
        };
    };
    both_ways(Numbers{0, 1, ~0U, 2, 100, ~0U - 99, 70000, 0x80000000, 0x7fffffff, 5},
              "00100a29eb83d84cc32369daca32401cd5ec22690000", integers(32, 2));
    both_ways(Numbers{0, 65535, 1, 40000, 7}, "0077c8a9353500000000", integers(16, 1));
}

TEST(LazCoder, times_have_a_known_stream) {
    std::vector<std::uint64_t> times;
    std::uint64_t time = 0x4112345600000000;
    const std::int64_t large = std::int64_t(1) << 40;
    for (const std::int64_t step :
         {std::int64_t(0), std::int64_t(5000), std::int64_t(5000), std::int64_t(5001), std::int64_t(10000),
          std::int64_t(0), std::int64_t(-5000), std::int64_t(2600000), large, std::int64_t(7), -large, std::int64_t(3)})
        times.push_back(time += static_cast<std::uint64_t>(step));
    both_ways(times, "0a0abb04610faad115cc473015c9dfb5ce29ed552fbe5d998c5067ab43000000", [] {
        return [coding = laz::Times<false>(0x4112345600000000)](auto& coder, std::size_t i,
                                                                const std::vector<std::uint64_t>& v) mutable {
            return coding.code(coder, v[i]);
        };
    });
}

TEST(LazCoder, blue_is_predicted_from_the_steps_of_red_and_green) {
    // Red steps by 10, green by 16: green is predicted 10 higher than it was, blue (10 + 16) / 2 = 13. What is coded
    // is how far each is off, behind a symbol that tells which bytes change, 1 + 4 + 16 for the lower ones and 64 for a
    // colour that is not grey.
    laz::Encoder encoder;
    laz::SymbolModel used(128), red(256), green(256), blue(256);
    encoder.symbol(used, 85);
    encoder.symbol(red, 10);
    encoder.symbol(green, 216 - (200 + 10));
    encoder.symbol(blue, 70 - (50 + 13));
    const std::string bytes = encoder.finish();
    const laz::Colours::Colour last{100, 200, 50}, value{110, 216, 70};
    laz::Decoder decoder(bytes, 0);
    EXPECT_EQ(laz::Colours().code(decoder, last, {}), value);
    laz::Encoder again;
    (void)laz::Colours().code(again, last, value);
    EXPECT_EQ(hex(again.finish()), hex(bytes));
}

TEST(LazCoder, the_running_median_drops_largest_and_smallest_in_turn) {
    laz::Median median;
    std::vector<std::int32_t> found;
    for (const std::int32_t value : {5, 1, 9, 3, 3, 7, -2, 8, 0, 4}) {
        median.add(value);
        found.push_back(median.get());
    }
    EXPECT_EQ(found, (std::vector<std::int32_t>{0, 0, 1, 3, 3, 3, 3, 3, 3, 3}));
}

// --- chunks ---

// Written by the format's reference implementation from the same records.
const std::string chunk_of_format_3 = "e8030000d00700002c01000000001902fb00070000000000563412416400c800320000000000f069"
                                      "b6f097782b5f52b468e8253fc54d90000046ea40440f9c46cdfec47e60c0"
                                      "3fc5fdca1297d600eb038f5c3d000a4b02d15e4188b079d5d0330000030ccbd673f91e5fe1f25d29"
                                      "fbf9792c9b6642457800a2026096333be8ff9cecca969282531d0d000000"
                                      "21a100cf14c607ce76acabfdf05bba01dbc400000578a919f657c0da971303580477ff0bf3910000"
                                      "00f22757b7985670cb6ab429a458f74662a0800fdacbeb7a17440668e368"
                                      "284949bb2f62d236ac428cbbe7f1a00000071a6ab50198258ed3cdf464c55517ec48e318004e849b"
                                      "9e49141d8a07236e1f52ff075ec20000006c21000000";
const std::string chunk_of_format_7 = "e8030000d00700002c0100000000310002000cfe070000000000563412416400c800320000000000"
                                      "0c0000002f000000110000000f0000000000000016000000130000000f00"
                                      "000005000000250000003900000000000000000000000f0000000f0000003266d9bc7da6e3c29120"
                                      "15fe8f5b182e44e50f77e6be82fcc2d837e16323a6fd46deeda4f506afdd"
                                      "caa3ed9400000004550eac83c0cf06a63a996ae4a800000003020181018101810181017f0000008f"
                                      "1222e66746777dffc8917ccb66396ed4ecdb000000751b8f9f829c1ab41c"
                                      "79ba822264f5010000000000000101008081818100ff00000007c0000000151ccaa21b3bd4c3f2ce"
                                      "bac7bf053b5a0c664bb6c005481b965175a041500105437e0000009e579c"
                                      "ff813c60d882e577c1affe04f183778615e706bff813c60d7ff027b810ffa04f183628b75df06bff"
                                      "813c60de017d79c1affe01000000808000000000500fe00007f80000003d"
                                      "00e17f80000000ffff8001000000";

Cloud read(const fs::path& file) {
    std::vector<std::string> warnings; // of boxes that the header does not have
    return read_cloud(file, warnings);
}

TEST(Laz, chunks_have_the_bytes_of_the_reference) {
    for (const auto& [format, expected] : {std::pair(3, chunk_of_format_3), {7, chunk_of_format_7}}) {
        const std::string records = twelve_records(format), chunk = unhex(expected);
        const laz::Packing packing = laz::usual_packing(format, records.size() / 12);
        const std::string block = laz::packed(records, 1000, packing);
        EXPECT_EQ(hex(block.substr(8, chunk.size())), expected) << format;
        EXPECT_EQ(load<std::uint64_t>(block.data()), 1008 + chunk.size());
        EXPECT_EQ(hex(block.substr(8 + chunk.size())),
                  format == 3 ? "000000000100000049eb000000" : "00000000010000004b50000000");
        const laz::Unpacked back =
            laz::unpacked(std::string(1000, '\0') + block, 1000, 1000 + block.size(), 12, packing);
        EXPECT_EQ(hex(back.points), hex(records));
        EXPECT_EQ(back.end, 1000 + block.size());
    }
}

/// Records in which every field sometimes stays, steps or jumps.
std::string random_records(int format, std::size_t length, std::size_t count, unsigned seed, unsigned channels = 4) {
    std::mt19937 random(seed);
    std::string all, record(length, '\0');
    for (std::size_t i = 0; i < count; ++i) {
        for (std::size_t at = 0; at < length; ++at)
            if (random() % 8 == 0)
                record[at] = static_cast<char>(random() % 3 == 0 ? random() : static_cast<unsigned>(record[at]) + 1);
        if (format >= 6 && channels < 4)
            record[15] = static_cast<char>((record[15] & 0xcf) | static_cast<char>(random() % channels << 4));
        all += record;
    }
    return all;
}

TEST(Laz, random_records_return_from_every_format_and_chunk_size) {
    constexpr std::array<std::size_t, 9> own{20, 28, 26, 34, 0, 0, 30, 36, 38};
    const TemporaryFolder folder;
    unsigned seed = 0;
    for (const int format : {0, 1, 2, 3, 6, 7, 8})
        for (const std::size_t extra : {0U, 1U, 5U})
            for (const std::uint32_t chunk_points : {1U, 7U, 50000U})
                for (const std::size_t count : {0U, 1U, 7U, 8U, 500U})
                    for (const unsigned channels : {1U, 2U, 4U}) {
                        if (format < 6 && channels > 1)
                            continue;
                        SCOPED_TRACE(fmt::format("format {}, {} extra, chunks of {}, {} points", format, extra,
                                                 chunk_points, count));
                        const std::size_t length = own[static_cast<std::size_t>(format)] + extra;
                        laz::Packing packing = laz::usual_packing(format, length);
                        packing.chunk_points = chunk_points;
                        const std::string records = random_records(format, length, count, ++seed, channels);
                        const std::string file = laz_file(format, packing, records, "behind");
                        const Cloud cloud = read(write_file(folder / "a.laz", file));
                        ASSERT_EQ(hex(cloud.records->points), hex(records));
                        EXPECT_EQ(cloud.records->after, "behind");
                        EXPECT_EQ(extension(*cloud.records), ".laz");
                    }
}

TEST(Laz, ambient_occlusion_is_added_as_to_las) {
    const TemporaryFolder folder;
    for (const int format : {0, 1, 2, 3, 6, 7, 8}) {
        constexpr std::array<std::size_t, 9> own{20, 28, 26, 34, 0, 0, 30, 36, 38};
        SCOPED_TRACE(format);
        const std::size_t length = own[static_cast<std::size_t>(format)] + 3, count = 700;
        std::string records = random_records(format, length, count, 5);
        records[records.size() - length + 15] = records[records.size() - length + 16] = 1; // neither noise nor withheld
        const Cloud las = read(write_file(folder / "a.las", las_file(format, length, records)));
        const std::string packed = laz_file(format, laz::usual_packing(format, length), records);
        const Cloud laz = read(write_file(folder / "a.laz", packed));
        std::vector<float> visibility(count), confidence(count);
        for (std::size_t i = 0; i < count; ++i)
            visibility[i] = static_cast<float>(i) / count, confidence[i] = i % 3 == 0 ? NAN : 0.5F;
        const std::vector<AddedField> added{{"ambient_occlusion", visibility}, {"ao_confidence", confidence}};
        write_cloud(folder / "b.las", las, added);
        write_cloud(folder / "b.laz", laz, added);
        const Cloud las_back = read(folder / "b.las"), laz_back = read(folder / "b.laz");
        EXPECT_EQ(laz_back.records->stride, length + 8);
        EXPECT_TRUE(laz_back.records->points == las_back.records->points);
        EXPECT_TRUE(laz_back.records->field_named("ao_confidence"));
        EXPECT_EQ(laz_back.points.back(), las_back.points.back());
        write_cloud(folder / "same.laz", laz, {});
        EXPECT_EQ(file_bytes(folder / "same.laz"), packed);
        // Written twice, fields are replaced and the same records packed again.
        write_cloud(folder / "c.laz", laz_back, {{"ambient_occlusion", confidence}});
        const Cloud again = read(folder / "c.laz");
        EXPECT_EQ(again.records->stride, length + 8);
        EXPECT_TRUE(again.records->record(7).substr(0, length) == laz.records->record(7));
    }
}

TEST(Laz, unusual_containers_are_read) {
    const TemporaryFolder folder;
    const std::string records = twelve_records(3);
    laz::Packing packing = laz::usual_packing(3, 38);
    packing.chunk_points = 5;
    const std::string usual = laz_file(3, packing, records);
    const std::size_t begin = load<std::uint32_t>(usual.data() + 96);
    std::string late = usual + usual.substr(begin, 8); // the position comes last
    store(late.data() + begin, ~std::uint64_t(0));
    EXPECT_EQ(hex(read(write_file(folder / "late.laz", late)).records->points), hex(records));

    laz::Packing one_stream = laz::usual_packing(3, 38);
    one_stream.compressor = 1;
    const std::string bare = las_header(3, 38, 12, &one_stream) + unhex(chunk_of_format_3);
    EXPECT_EQ(hex(read(write_file(folder / "bare.laz", bare)).records->points), hex(records));
}

std::string refused(const fs::path& file, const std::string& bytes) {
    std::vector<std::string> warnings;
    return refusal([&] { (void)read_cloud(write_file(file, bytes), warnings); });
}

TEST(Laz, damage_is_named_with_chunk_point_and_byte) {
    const TemporaryFolder folder;
    laz::Packing packing = laz::usual_packing(3, 38);
    packing.chunk_points = 5;
    const std::string sound = laz_file(3, packing, twelve_records(3));
    const std::size_t begin = load<std::uint32_t>(sound.data() + 96), body = 375 + 54;
    const auto with = [&](std::size_t at, const std::string& bytes) {
        std::string damaged = sound;
        damaged.replace(at, bytes.size(), bytes);
        return refused(folder / "a.laz", damaged);
    };
    EXPECT_TRUE(says(with(375 + 2, "someone else"), "records that describe it"));
    EXPECT_TRUE(says(with(body, "\x09"), "LAZ compressor 9"));
    EXPECT_TRUE(says(with(body + 36, "\x13"), "LAZ items add up to 37 bytes, the record length is 38"));
    EXPECT_TRUE(says(with(body + 38, "\x01"), "LAZ item 6 version 1"));
    EXPECT_TRUE(says(with(104, "\xc3"), "early experimental LAZ"));
    EXPECT_TRUE(says(with(begin, std::string("\xff\xff\xff\0\0\0\0\0", 8)), "the file is cut short"));
    EXPECT_TRUE(says(with(247, "\x0b"), "a.laz"));
    const std::string message = with(begin + 8 + 38, "\xff\xff\xff\xff");
    EXPECT_TRUE(says(message, "a.laz: chunk 0"));
    EXPECT_TRUE(says(message, fmt::format("byte {}", begin + 8 + 38)));
    for (std::size_t length = 0; length < sound.size(); ++length)
        EXPECT_NE(refused(folder / "a.laz", sound.substr(0, length)), "") << length;
}

TEST(Laz, any_changed_byte_is_refused_or_changes_values_only) {
    const TemporaryFolder folder;
    for (const int format : {3, 7}) {
        const std::size_t length = format == 3 ? 38 : 40;
        laz::Packing packing = laz::usual_packing(format, length);
        packing.chunk_points = 5;
        const std::string sound = laz_file(format, packing, twelve_records(format));
        const std::size_t header = load<std::uint32_t>(sound.data() + 96);
        for (std::size_t at = 94; at < sound.size(); ++at)
            for (const std::string& change : {std::string("\xff\xff\xff\xff"), std::string(1, '\x55')}) {
                std::string damaged = sound;
                damaged.replace(at, change.size(), change.substr(0, sound.size() - at));
                write_file(folder / "a.laz", damaged);
                Cloud cloud;
                if (!refusal([&] { cloud = read(folder / "a.laz"); }).empty() || at < header)
                    continue;
                EXPECT_EQ(cloud.records->points.size(), 12 * length) << at;
            }
    }
}

TEST(Laz, millions_of_equal_points_fit_in_a_small_file_and_return) {
    const TemporaryFolder folder;
    const std::string record(20, '\x07');
    std::string records;
    for (int i = 0; i < 4'000'000; ++i)
        records += record;
    laz::Packing packing = laz::usual_packing(0, 20);
    packing.chunk_points = 1'000'000;
    const std::string file = laz_file(0, packing, records);
    EXPECT_LT(file.size(), 20000U) << "4000 times smaller: read step by step";
    EXPECT_TRUE(read(write_file(folder / "a.laz", file)).records->points == records);
}

// --- files recorded by others ---

/// A file in SCANSHADE_DATA; none where it is absent.
fs::path recorded(const std::string& name) {
    const char* data = std::getenv("SCANSHADE_DATA");
    const fs::path file = fs::path(data ? data : "") / "las" / name;
    return data && fs::exists(file) ? file : fs::path();
}

TEST(Laz, a_recorded_cloud_equals_its_uncompressed_twin) {
    const fs::path packed = recorded("autzen_trim.laz"), plain = recorded("autzen_trim.las");
    if (packed.empty() || plain.empty())
        GTEST_SKIP() << "no recorded LAZ; SCANSHADE_DATA names the folder of recorded data";
    const Cloud laz = read(packed), las = read(plain);
    ASSERT_EQ(laz.records->point_count, 110000U);
    EXPECT_TRUE(laz.records->points == las.records->points);
    EXPECT_TRUE(laz.colours == las.colours);
    const laz::Packing packing = laz::usual_packing(3, 34);
    EXPECT_TRUE(laz::packed(laz.records->points, laz.records->header.size(), packing) == laz.records->packed)
        << "packed again, the bytes are those of the other writer";
}

TEST(Laz, a_recorded_scan_has_the_known_sums) {
    const fs::path file = recorded("lone-star.laz");
    if (file.empty())
        GTEST_SKIP() << "no recorded LAZ; SCANSHADE_DATA names the folder of recorded data";
    const Cloud cloud = read(file);
    std::array<std::int64_t, 3> sums{};
    std::int64_t intensity = 0;
    for (std::size_t i = 0; i < cloud.records->point_count; ++i) {
        const char* const record = cloud.records->record(i).data();
        for (std::size_t axis = 0; axis < 3; ++axis)
            sums[axis] += load<std::int32_t>(record + 4 * axis);
        intensity += load<std::uint16_t>(record + 12);
    }
    EXPECT_EQ(sums, (std::array<std::int64_t, 3>{-8049933934, 37263650435, 9701551762}));
    EXPECT_EQ(intensity, 562919835);
    EXPECT_TRUE(laz::packed(cloud.records->points, cloud.records->header.size(), laz::usual_packing(1, 28)) ==
                cloud.records->packed);
}

} // namespace
} // namespace scanshade
