// Hashes and stamps of input files.
#include "io/content_hash.h"

#include "io/files.h"

#define XXH_INLINE_ALL
#include <algorithm>
#include <cerrno>
#include <fmt/format.h>
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
    const FileBytes bytes(file);
    constexpr std::uint64_t piece = 1 << 18;
    for (std::uint64_t at = 0; at < bytes.size(); at += piece) {
        const std::string part = bytes.bytes(at, std::min(piece, bytes.size() - at));
        XXH3_128bits_update(state.get(), part.data(), part.size());
    }
    return digits(XXH3_128bits_digest(state.get()));
}

std::string stamp_of(const std::filesystem::path& file) {
    struct stat facts = {};
    if (::stat(file.c_str(), &facts) != 0)
        return errno == ENOTDIR ? stamp_in_tar(file) : "";
    return fmt::format("{}:{}", facts.st_size, facts.st_mtim.tv_sec * 1'000'000'000 + facts.st_mtim.tv_nsec);
}

} // namespace scanshade
