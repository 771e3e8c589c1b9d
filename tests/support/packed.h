// Bytes packed by zlib, for readers of what others write.
#pragma once

#include <gtest/gtest.h>
#include <string>
#include <zlib.h>

namespace scanshade::tests {

/// `window`: as deflateInit2() takes it: -15 bare deflate, 15 zlib, 31 gzip.
inline std::string packed_by_zlib(const std::string& bytes, int window) {
    z_stream stream = {};
    EXPECT_EQ(deflateInit2(&stream, 6, Z_DEFLATED, window, 8, Z_DEFAULT_STRATEGY), Z_OK);
    constexpr std::size_t gzip_head = 64;
    std::string packed(deflateBound(&stream, bytes.size()) + gzip_head, '\0');
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
    stream.avail_in = static_cast<uInt>(bytes.size());
    stream.next_out = reinterpret_cast<Bytef*>(packed.data());
    stream.avail_out = static_cast<uInt>(packed.size());
    EXPECT_EQ(deflate(&stream, Z_FINISH), Z_STREAM_END);
    packed.resize(stream.total_out);
    deflateEnd(&stream);
    return packed;
}

} // namespace scanshade::tests
