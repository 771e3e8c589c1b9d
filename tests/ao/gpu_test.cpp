// The device and the pass runner: valid tables compute the right results, broken ones are refused.
#include "ao/gpu/program.h"
#include "projection/base/error.h"

#include <array>
#include <cstdlib>
#include <cstring>
#include <gtest/gtest.h>
#include <numeric>

namespace scanshade {
namespace {

using gpu::BufferRow;
using gpu::PassRow;
using Host = BufferRow::Host;
using Texels = BufferRow::Texels;

constexpr int count = 1000;

/// The runner's own tests always validate, where the layer is installed.
const bool validated = setenv("SCANSHADE_VALIDATE", "1", 1) == 0;

BufferRow words(std::string_view name, Host host = Host::none) { return {name, count * 4, host, Texels::r32ui}; }
PassRow add_one(int from, int to, int step = 1) {
    return {"add", "test/add_one", {from}, {to}, {(count + 63) / 64, 1, 1}, {{0, step}}};
}

TEST(gpu, devices_are_listed_with_what_they_lack) {
    const auto devices = gpu::list_devices();
    ASSERT_FALSE(devices.empty()) << "lavapipe at least";
    for (const auto& device : devices) {
        EXPECT_FALSE(device.name.empty());
        EXPECT_FALSE(device.api.empty());
    }
}

TEST(gpu, a_device_that_is_not_there_is_refused_with_the_list_of_those_that_are) {
    try {
        gpu::Device device("no such card");
        FAIL() << "opened " << device.info().name;
    } catch (const Error& error) {
        EXPECT_NE(std::string(error.what()).find("no such card"), std::string::npos) << error.what();
        EXPECT_NE(std::string(error.what()).find(gpu::list_devices().front().name), std::string::npos) << error.what();
    }
}

TEST(gpu, a_chain_of_passes_sees_each_others_results) {
    // Each pass reads the previous output in reverse order, so a missing barrier gives wrong sums.
    gpu::Device device;
    gpu::Program program(device, {words("in", Host::upload), words("a"), words("b"), words("out", Host::download)},
                         {add_one(0, 1), add_one(1, 2, 10), add_one(2, 1, 100), add_one(1, 3, 1000)}, 4);
    const auto in = program.host_as<std::uint32_t>(0);
    for (int repeat = 0; repeat < 20; ++repeat) {
        std::iota(in.begin(), in.end(), static_cast<std::uint32_t>(repeat));
        const std::int32_t n = count;
        program.run(std::as_bytes(std::span(&n, 1)));
        const auto out = program.host_as<std::uint32_t>(3);
        for (std::size_t i = 0; i < count; ++i)
            ASSERT_EQ(out[i], in[i] + 1111) << i; // four mirrorings: back in place
    }
    EXPECT_EQ(program.timings().size(), 6U) << "upload, four passes, download";
    for (const std::string& message : device.validation_messages())
        ADD_FAILURE() << message;
}

TEST(gpu, passes_wait_for_those_that_read_or_write_before_them) {
    // Results alone tell little: pixels may come out right without any barrier. The validation layer tells each hazard.
    // One after the other: read after write, write after read, write after write, a cleared buffer that is read.
    ASSERT_TRUE(validated);
    if (!gpu::Device().validating())
        GTEST_SKIP() << "the validation layer is not there; tests/run installs it";
    const std::vector<BufferRow> buffers{words("in", Host::upload), words("a"), words("b"),
                                         words("out", Host::download)};
    const PassRow clear_a{"clear", "", {}, {1}, {1, 1, 1}, {}};
    for (const std::vector<PassRow>& passes : {std::vector{add_one(0, 1), add_one(1, 3)},
                                               {add_one(0, 1), add_one(1, 3), add_one(2, 1)},
                                               {add_one(0, 1), add_one(2, 1), add_one(0, 3)},
                                               {add_one(0, 3), clear_a, add_one(1, 3)}}) {
        gpu::Device device;
        std::vector<BufferRow> rows = buffers;
        rows[2].host = Host::upload; // so that every row of `passes` reads something
        gpu::Program program(device, rows, passes, 4);
        const std::int32_t n = count;
        for (int repeat = 0; repeat < 2; ++repeat)
            program.run(std::as_bytes(std::span(&n, 1)));
        (void)program.read_back(1);
        for (const std::string& message : device.validation_messages())
            ADD_FAILURE() << message;
    }
}

TEST(gpu, large_buffers_are_streamed_part_by_part) {
    // Where the host does not reach the buffer itself: three parts and a bit, which items of twelve bytes do not fill.
    gpu::Device device;
    using Item = std::array<std::uint32_t, 3>;
    constexpr std::size_t items = 9'000'001;
    gpu::Program program(device,
                         {{"in", items * sizeof(Item), Host::streamed, Texels::r32ui}, words("out", Host::download)},
                         {add_one(0, 1)}, 4);
    const auto item = [](std::size_t i) {
        const auto n = static_cast<std::uint32_t>(i);
        return Item{3 * n, 3 * n + 1, 3 * n + 2};
    };
    std::size_t filled = 0, seen = 0, wrong = 0;
    program.stream_in(0, sizeof(Item), [&](std::size_t first, std::span<std::byte> to) {
        EXPECT_EQ(first, filled);
        for (std::size_t at = 0; at + sizeof(Item) <= to.size(); at += sizeof(Item), ++filled)
            std::memcpy(&to[at], item(filled).data(), sizeof(Item));
    });
    EXPECT_EQ(filled, items);
    const std::int32_t n = count;
    program.run(std::as_bytes(std::span(&n, 1)));
    EXPECT_EQ(program.host_as<std::uint32_t>(1)[0], static_cast<std::uint32_t>(count)); // the last word and one
    program.stream_out(0, sizeof(Item), [&](std::size_t first, std::span<const std::byte> from) {
        EXPECT_EQ(first, seen);
        for (std::size_t at = 0; at + sizeof(Item) <= from.size(); at += sizeof(Item), ++seen)
            wrong += std::memcmp(&from[at], item(seen).data(), sizeof(Item)) != 0;
    });
    EXPECT_EQ(seen, items);
    EXPECT_EQ(wrong, 0U);
    for (const std::string& message : device.validation_messages())
        ADD_FAILURE() << message;
}

TEST(gpu, two_programs_may_share_a_device) {
    gpu::Device device;
    const std::vector<BufferRow> buffers{words("in", Host::upload), words("out", Host::download)};
    gpu::Program one(device, buffers, {add_one(0, 1, 1)}, 4), two(device, buffers, {add_one(0, 1, 2)}, 4);
    const std::int32_t n = count;
    std::fill_n(one.host_as<std::uint32_t>(0).begin(), count, 5U);
    std::fill_n(two.host_as<std::uint32_t>(0).begin(), count, 7U);
    one.run(std::as_bytes(std::span(&n, 1)));
    two.run(std::as_bytes(std::span(&n, 1)));
    EXPECT_EQ(one.host_as<std::uint32_t>(1)[count - 1], 6U);
    EXPECT_EQ(two.host_as<std::uint32_t>(1)[0], 9U);
}

/// The second program's buffers lie where those of the first were; they begin with zeros all the same.
TEST(gpu, memory_that_programs_gave_back_serves_the_next_ones) {
    gpu::Device device;
    device.keep_memory(1 << 20);
    const std::int32_t n = count;
    for (int program_number = 0; program_number < 3; ++program_number) {
        gpu::Program program(device, {words("in", Host::upload), words("a"), words("out", Host::download)},
                             {add_one(0, 1), add_one(1, 2, 10)}, 4);
        if (program_number > 0) {
            EXPECT_LE(device.kept_memory(), 4096U) << "all is used again but the block of read_back()";
        }
        for (const std::byte byte : program.read_back(1))
            ASSERT_EQ(byte, std::byte{0});
        const auto in = program.host_as<std::uint32_t>(0);
        std::iota(in.begin(), in.end(), static_cast<std::uint32_t>(program_number));
        program.run(std::as_bytes(std::span(&n, 1)));
        const auto out = program.host_as<std::uint32_t>(2);
        for (std::size_t i = 0; i < count; ++i)
            ASSERT_EQ(out[i], in[i] + 11);
    }
    const std::size_t kept = device.kept_memory();
    EXPECT_GT(kept, std::size_t(3 * count * 4));
    device.keep_memory(kept / 2);
    EXPECT_LE(device.kept_memory(), kept / 2);
    device.keep_memory(0);
    EXPECT_EQ(device.kept_memory(), 0U);
    for (const std::string& message : device.validation_messages())
        ADD_FAILURE() << message;
}

TEST(gpu, a_pass_without_a_shader_clears) {
    gpu::Device device;
    gpu::Program program(device, {words("out", Host::download)}, {{"clear", "", {}, {0}, {1, 1, 1}, {}}}, 4);
    std::fill_n(program.host_as<std::uint32_t>(0).begin(), count, 9U);
    program.run({});
    EXPECT_EQ(program.host_as<std::uint32_t>(0)[count / 2], 0U);
}

TEST(gpu, a_broken_table_is_refused_before_anything_runs) {
    const std::vector<BufferRow> buffers{words("in", Host::upload), words("between"), words("out", Host::download)};
    EXPECT_TRUE(gpu::problems(buffers, std::vector{add_one(0, 1), add_one(1, 2)}).empty());
    EXPECT_FALSE(gpu::problems(buffers, std::vector{add_one(1, 2)}).empty()) << "reads what nobody wrote";
    EXPECT_FALSE(gpu::problems(buffers, std::vector{add_one(0, 1)}).empty()) << "the output is never written";
    EXPECT_FALSE(gpu::problems(buffers, std::vector{add_one(0, 3)}).empty()) << "no such buffer";
    PassRow idle = add_one(0, 2);
    idle.groups = {0, 1, 1};
    EXPECT_FALSE(gpu::problems(buffers, std::vector{idle}).empty()) << "dispatches nothing";
    gpu::Device device;
    EXPECT_THROW(gpu::Program(device, buffers, {add_one(1, 2)}, 4), Error);
    PassRow unknown = add_one(0, 2);
    unknown.shader = "no/such";
    EXPECT_THROW(gpu::Program(device, buffers, {unknown}, 4), Error);
}

TEST(gpu, validation_reports_a_wrong_program) {
    // More work groups than any device allows, recorded but never run: the layer must report it, or it is not active.
    gpu::Device device;
    if (!device.validating())
        GTEST_SKIP() << "the validation layer is not there; tests/run installs it";
    PassRow vast = add_one(0, 1);
    vast.groups = {1, 1U << 31, 1};
    const gpu::Program program(device, {words("in", Host::upload), words("out", Host::download)}, {vast}, 4);
    EXPECT_FALSE(device.validation_messages().empty());
}

} // namespace
} // namespace scanshade
