#include "io/compression/inflate.h"

#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <fmt/format.h>
#include <limits>
#include <zlib.h>

namespace scanshade {

namespace {

/// A decoder that ends itself.
class Inflating {
  public:
    explicit Inflating(Inflate form) {
        constexpr int bare = -15, with_gzip = MAX_WBITS + 16;
        const int window = form == Inflate::raw ? bare : form == Inflate::gzip ? with_gzip : MAX_WBITS;
        if (inflateInit2(&stream, window) != Z_OK)
            throw std::bad_alloc();
    }
    ~Inflating() { inflateEnd(&stream); }
    Inflating(const Inflating&) = delete;
    Inflating& operator=(const Inflating&) = delete;

    z_stream stream = {};
};

} // namespace

std::string inflated_start(std::string_view packed, Inflate form, std::size_t count) {
    Inflating inflating(form);
    z_stream& stream = inflating.stream;
    constexpr std::size_t most_at_once = std::numeric_limits<uInt>::max() / 2;
    std::string bytes(count, '\0');
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(packed.data()));
    stream.avail_in = static_cast<uInt>(std::min(most_at_once, packed.size()));
    stream.next_out = reinterpret_cast<Bytef*>(bytes.data());
    stream.avail_out = static_cast<uInt>(count);
    const int status = inflate(&stream, Z_SYNC_FLUSH);
    if (status != Z_STREAM_END && stream.avail_out > 0)
        throw Error(fmt::format("damaged packed data in the first {}", counted(packed.size(), "byte")));
    bytes.resize(count - stream.avail_out);
    return bytes;
}

std::string inflated(std::string_view packed, Inflate form, std::size_t most) {
    Inflating inflating(form);
    z_stream& stream = inflating.stream;
    constexpr std::size_t most_at_once = std::numeric_limits<uInt>::max() / 2;
    constexpr std::size_t deflate_ratio = 1032; // one packed byte becomes at most so many
    std::string bytes(std::min(most, packed.size() > most / deflate_ratio ? most : packed.size() * deflate_ratio),
                      '\0');
    std::size_t read = 0, written = 0;
    int status = Z_OK;
    while (status == Z_OK) {
        const std::size_t in = std::min(most_at_once, packed.size() - read),
                          out = std::min(most_at_once, bytes.size() - written);
        stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(packed.data() + read));
        stream.next_out = reinterpret_cast<Bytef*>(bytes.data() + written);
        stream.avail_in = static_cast<uInt>(in);
        stream.avail_out = static_cast<uInt>(out);
        status = inflate(&stream, Z_NO_FLUSH);
        read += in - stream.avail_in;
        written += out - stream.avail_out;
    }
    if (status == Z_BUF_ERROR && written == bytes.size())
        throw Error(fmt::format("more than {} when unpacked", counted(most, "byte")));
    if (status == Z_BUF_ERROR)
        throw Error(fmt::format("the packed data end early, after {}", counted(read, "byte")));
    if (status != Z_STREAM_END)
        throw Error(fmt::format("damaged packed data near byte {} of it", read));
    if (read != packed.size())
        throw Error(fmt::format("{} after the packed data's end", counted(packed.size() - read, "byte")));
    bytes.resize(written);
    return bytes;
}

} // namespace scanshade
