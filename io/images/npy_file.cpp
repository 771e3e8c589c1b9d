#include "io/images/npy_file.h"

#include "io/output_file.h"
#include "projection/base/error.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <functional>
#include <numeric>

namespace scanshade {

void write_npy(const std::filesystem::path& file, const std::string& type, const std::vector<int>& shape,
               std::span<const std::byte> data) {
    const auto elements = std::accumulate(shape.begin(), shape.end(), std::size_t(1), [](std::size_t product, int n) {
        return product * static_cast<std::size_t>(n);
    });
    const std::size_t wanted = elements * static_cast<std::size_t>(type.back() - '0');
    if (data.size() != wanted)
        throw Error(fmt::format("{}: {} bytes expected of {} {}, not {}", file.string(), wanted, type,
                                fmt::join(shape, "x"), data.size()));
    std::string header =
        fmt::format("{{'descr': '<{}', 'fortran_order': False, 'shape': ({},), }}", type, fmt::join(shape, ", "));
    constexpr std::size_t before = 10, alignment = 64; // magic, version, length; the array begins at a multiple of 64
    header.resize((before + header.size() + alignment) / alignment * alignment - before - 1, ' ');
    header += '\n';
    std::string bytes("\x93NUMPY\x01\x00", 8);
    bytes += static_cast<char>(header.size() & 0xff);
    bytes += static_cast<char>(header.size() >> 8);
    bytes += header;
    bytes.append(reinterpret_cast<const char*>(data.data()), data.size());
    write_atomically(file, bytes);
}

} // namespace scanshade
