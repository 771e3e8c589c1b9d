// Tars made in code, byte by byte, sound and unsound.
#pragma once

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

namespace scanshade::tests {

/// A header of 512 bytes. `size` in base 256 where octal digits do not hold it.
inline std::string tar_header(const std::string& name, std::uint64_t size, char kind = '0',
                              const std::string& link = "", const std::string& prefix = "") {
    std::string block(512, '\0');
    const auto put = [&](std::size_t at, const std::string& text) { block.replace(at, text.size(), text); };
    put(0, name.substr(0, 100));
    put(100, "0000644");
    put(108, "0000000");
    put(116, "0000000");
    if (size < std::uint64_t(1) << 33) {
        put(124, fmt::format("{:011o}", size));
    } else {
        block[124] = '\x80';
        for (std::size_t i = 0; i < 8; ++i)
            block[135 - i] = static_cast<char>(size >> (8 * i));
    }
    put(136, "00000000000");
    put(148, "        ");
    block[156] = kind;
    put(157, link.substr(0, 100));
    put(257, std::string("ustar\0"
                         "00",
                         8));
    put(345, prefix);
    std::uint32_t sum = 0;
    for (const char c : block)
        sum += static_cast<unsigned char>(c);
    put(148, fmt::format("{:06o}", sum) + std::string("\0 ", 2));
    return block;
}

inline std::string tar_padded(std::string bytes) {
    bytes.resize((bytes.size() + 511) / 512 * 512);
    return bytes;
}

inline std::string tar_member(const std::string& name, const std::string& bytes, char kind = '0') {
    return tar_header(name, bytes.size(), kind) + tar_padded(bytes);
}

/// A pax header for the next member: "LENGTH KEY=VALUE\n".
inline std::string tar_pax(const std::vector<std::pair<std::string, std::string>>& facts) {
    std::string records;
    for (const auto& [key, value] : facts) {
        const std::size_t rest = key.size() + value.size() + 3;
        std::size_t length = rest;
        while (length != rest + std::to_string(length).size())
            length = rest + std::to_string(length).size();
        records += fmt::format("{} {}={}\n", length, key, value);
    }
    return tar_member("PaxHeaders/x", records, 'x');
}

inline std::string tar_end() { return std::string(1024, '\0'); }

/// All files below a folder, in the order of their names.
inline std::string tar_of(const std::filesystem::path& folder) {
    std::vector<std::filesystem::path> files;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder))
        if (entry.is_regular_file())
            files.push_back(entry.path());
    std::ranges::sort(files);
    std::string all;
    for (const auto& file : files) {
        std::ifstream stream(file, std::ios::binary);
        all += tar_member(file.lexically_relative(folder).string(), {std::istreambuf_iterator<char>(stream), {}});
    }
    return all + tar_end();
}

} // namespace scanshade::tests
