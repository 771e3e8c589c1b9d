// Binary glTF as its bytes say it, read by a reader of the tests' own.
#pragma once

#include "tests/support/files.h"

#include <cstdint>
#include <cstring>
#include <nlohmann/json.hpp>

namespace scanshade::tests {

/// The file's JSON and its numbers.
struct Gltf {
    nlohmann::json text;
    std::string buffer;

    template <class Number>
    [[nodiscard]] std::vector<Number> numbers(std::size_t accessor) const {
        const nlohmann::json& view = text["bufferViews"][text["accessors"][accessor]["bufferView"].get<std::size_t>()];
        std::vector<Number> values(view["byteLength"].get<std::size_t>() / sizeof(Number));
        std::memcpy(values.data(), buffer.data() + view["byteOffset"].get<std::size_t>(),
                    values.size() * sizeof(Number));
        return values;
    }
    template <class Number>
    [[nodiscard]] std::vector<Number> attribute(const std::string& name) const {
        return numbers<Number>(text["meshes"][0]["primitives"][0]["attributes"][name].get<std::size_t>());
    }
};

inline Gltf gltf_in(const std::filesystem::path& file) {
    const std::string bytes = file_bytes(file);
    const auto word = [&](std::size_t at) {
        std::uint32_t value{};
        std::memcpy(&value, bytes.data() + at, sizeof value);
        return value;
    };
    EXPECT_EQ(bytes.substr(0, 4), "glTF");
    EXPECT_EQ(word(8), bytes.size());
    const std::size_t length = word(12);
    EXPECT_EQ(length % 4, 0u);
    Gltf all{nlohmann::json::parse(bytes.substr(20, length)), ""};
    if (20 + length < bytes.size()) {
        EXPECT_EQ(bytes.substr(24 + length, 4), std::string("BIN\0", 4));
        all.buffer = bytes.substr(28 + length);
        EXPECT_EQ(all.buffer.size(), word(20 + length));
        EXPECT_EQ(all.text["buffers"][0]["byteLength"], all.buffer.size());
    }
    return all;
}

} // namespace scanshade::tests
