#include "io/captures/recordings/ros/unpack.h"

#include "io/text.h"
#include "projection/base/error.h"
#include "projection/base/memory.h"

#include <algorithm>
#include <bzlib.h>
#include <fmt/format.h>
#include <lz4frame.h>
#include <zstd.h>

namespace scanshade::ros {

namespace {

[[noreturn]] void wrong_size(std::size_t found, std::size_t expected) {
    throw Error(fmt::format("{} when unpacked, expected {}", counted(found, "byte"), expected));
}

} // namespace

std::string unpacked_bz2(std::string_view packed, std::size_t size) {
    std::string bytes(size, '\0');
    auto written = static_cast<unsigned>(size);
    const int status = BZ2_bzBuffToBuffDecompress(bytes.data(), &written, const_cast<char*>(packed.data()),
                                                  static_cast<unsigned>(packed.size()), 0, 0);
    if (status == BZ_MEM_ERROR)
        throw std::bad_alloc();
    if (status != BZ_OK)
        throw Error(fmt::format("damaged bz2 data (code {})", status));
    if (written != size)
        wrong_size(written, size);
    return bytes;
}

std::string unpacked_lz4(std::string_view packed, std::size_t size) {
    LZ4F_dctx* context = nullptr;
    if (LZ4F_isError(LZ4F_createDecompressionContext(&context, LZ4F_VERSION)))
        throw std::bad_alloc();
    const std::unique_ptr<LZ4F_dctx, decltype(&LZ4F_freeDecompressionContext)> owner(context,
                                                                                     &LZ4F_freeDecompressionContext);
    std::string bytes(size, '\0');
    std::size_t read = 0, written = 0;
    for (std::size_t hint = 1; hint != 0 && read < packed.size();) {
        std::size_t in = packed.size() - read, out = size - written;
        hint = LZ4F_decompress(context, bytes.data() + written, &out, packed.data() + read, &in, nullptr);
        if (LZ4F_isError(hint))
            throw Error(fmt::format("damaged LZ4 data near byte {} of it: {}", read, LZ4F_getErrorName(hint)));
        if (in == 0 && out == 0)
            break; // more than `size` bytes want out
        read += in;
        written += out;
    }
    if (written != size || read != packed.size())
        wrong_size(written, size);
    return bytes;
}

std::string unpacked_zstd(std::string_view packed, std::size_t size) {
    std::string bytes(size, '\0');
    const std::size_t written = ZSTD_decompress(bytes.data(), size, packed.data(), packed.size());
    if (ZSTD_isError(written))
        throw Error(fmt::format("damaged zstd data: {}", ZSTD_getErrorName(written)));
    if (written != size)
        wrong_size(written, size);
    return bytes;
}

std::size_t size_of_zstd(std::string_view packed) {
    const unsigned long long size = ZSTD_getFrameContentSize(packed.data(), packed.size());
    if (size == ZSTD_CONTENTSIZE_ERROR || size == ZSTD_CONTENTSIZE_UNKNOWN)
        throw Error("a zstd frame that does not name its size");
    check_unpacked_size(packed.size(), size);
    return size;
}

void check_unpacked_size(std::uint64_t packed, std::uint64_t size) {
    constexpr std::uint64_t most = std::uint64_t(1) << 31, most_ratio = 1000, always = 1 << 16;
    if (size > most || (size > always && size / most_ratio > packed))
        throw Error(fmt::format("{} packed are said to become {}, expected at most {} times as many, and 2^31",
                                counted(packed, "byte"), size, most_ratio));
}

std::shared_ptr<const std::string> Chunks::unpacked(std::uint32_t chunk) const {
    {
        const std::scoped_lock lock(mutex_);
        const auto found = std::ranges::find(kept_, chunk, &Kept::chunk);
        if (found != kept_.end()) {
            std::rotate(found, found + 1, kept_.end());
            return kept_.back().bytes;
        }
    }
    const Chunk& place = chunks.at(chunk);
    const std::string where = fmt::format("{}: chunk at byte {}", file_.path().string(), place.at);
    auto bytes = std::make_shared<const std::string>(during(where, [&] {
        check_unpacked_size(place.packed, place.size);
        const std::string packed = file_.bytes(place.at, place.packed);
        require_memory(place.size, "unpacking it");
        return unpack_(packed, place);
    }));
    constexpr std::size_t most_kept = 8, most_bytes = std::size_t(1) << 28;
    const std::scoped_lock lock(mutex_);
    kept_.push_back({chunk, bytes});
    std::size_t total = 0;
    for (const Kept& kept : kept_)
        total += kept.bytes->size();
    while (kept_.size() > 1 && (kept_.size() > most_kept || total > most_bytes)) {
        total -= kept_.front().bytes->size();
        kept_.erase(kept_.begin());
    }
    return bytes;
}

} // namespace scanshade::ros
