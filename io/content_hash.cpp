// Hashes and stamps of input files.
#include "io/content_hash.h"

#include "projection/base/error.h"

#define XXH_INLINE_ALL
#include <array>
#include <fmt/format.h>
#include <fstream>
#include <memory>
#include <sys/stat.h>
#include <xxhash.h>

namespace scanshade {
namespace {

std::string digits(XXH128_hash_t hash) { return fmt::format("{:016x}{:016x}", hash.high64, hash.low64); }

} // namespace

std::string hash_of(std::string_view bytes) { return digits(XXH3_128bits(bytes.data(), bytes.size())); }

std::string hash_of_file(const std::filesystem::path& file) {
    const std::unique_ptr<XXH3_state_t, XXH_errorcode (*)(XXH3_state_t*)> state(XXH3_createState(), &XXH3_freeState);
    XXH3_128bits_reset(state.get());
    std::ifstream stream(file, std::ios::binary);
    std::array<char, 1 << 16> piece;
    while (stream.read(piece.data(), piece.size()) || stream.gcount() > 0)
        XXH3_128bits_update(state.get(), piece.data(), static_cast<std::size_t>(stream.gcount()));
    if (stream.bad() || !stream.eof())
        throw Error(file.string() + ": cannot be read");
    return digits(XXH3_128bits_digest(state.get()));
}

std::string stamp_of(const std::filesystem::path& file) {
    struct stat facts = {};
    if (::stat(file.c_str(), &facts) != 0)
        return "";
    return fmt::format("{}:{}", facts.st_size, facts.st_mtim.tv_sec * 1'000'000'000 + facts.st_mtim.tv_nsec);
}

} // namespace scanshade
