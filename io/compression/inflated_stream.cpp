#include "io/compression/inflated_stream.h"

#include "io/text.h"
#include "projection/base/error.h"
#include "projection/base/memory.h"

#include <algorithm>
#include <fmt/format.h>
#include <new>
#include <zlib.h>

namespace scanshade {

namespace {

constexpr std::uint64_t read_at_once = 1 << 16, first_apart = 1 << 20;
constexpr std::size_t most_states = 2048; // of some 40 KiB each

} // namespace

void InflatedStream::End::operator()(z_stream_s* stream) const {
    inflateEnd(stream);
    delete stream;
}

std::unique_ptr<z_stream_s, InflatedStream::End> InflatedStream::copy_of(z_stream_s& stream) {
    auto copy = std::make_unique<z_stream>();
    if (inflateCopy(copy.get(), &stream) != Z_OK)
        throw std::bad_alloc();
    return std::unique_ptr<z_stream_s, End>(copy.release());
}

void InflatedStream::keep(z_stream_s& stream, std::uint64_t packed) {
    if (states_.size() == most_states) { // every second one, then
        std::size_t kept = 0;
        for (std::size_t i = 0; i < states_.size(); i += 2)
            states_[kept++] = std::move(states_[i]);
        states_.resize(kept);
        apart_ *= 2;
    }
    states_.push_back({copy_of(stream), packed, size_});
}

InflatedStream::InflatedStream(const FileBytes& file, std::uint64_t at, std::uint64_t packed_bytes, std::uint64_t most)
    : file_(file), at_(at), packed_bytes_(packed_bytes), apart_(first_apart) {
    auto fresh = std::make_unique<z_stream>();
    constexpr int bare = -15;
    if (inflateInit2(fresh.get(), bare) != Z_OK)
        throw std::bad_alloc();
    const std::unique_ptr<z_stream_s, End> stream(fresh.release());
    keep(*stream, 0);
    std::string out(first_apart, '\0');
    crc_ = static_cast<std::uint32_t>(crc32(0, nullptr, 0));
    int status = Z_OK;
    std::uint64_t read = 0, used = 0;
    while (status == Z_OK && read < packed_bytes) {
        const std::string in = file.bytes(at + read, std::min(read_at_once, packed_bytes - read));
        read += in.size();
        stream->next_in = reinterpret_cast<Bytef*>(const_cast<char*>(in.data()));
        stream->avail_in = static_cast<uInt>(in.size());
        do {
            stream->next_out = reinterpret_cast<Bytef*>(out.data());
            stream->avail_out = static_cast<uInt>(out.size());
            status = inflate(stream.get(), Z_NO_FLUSH);
            const std::size_t came = out.size() - stream->avail_out;
            crc_ = static_cast<std::uint32_t>(
                crc32(crc_, reinterpret_cast<const Bytef*>(out.data()), static_cast<uInt>(came)));
            size_ += came;
            used = read - stream->avail_in;
            if (size_ > most)
                throw Error(fmt::format("{}: the stream at byte {} has more than {} when unpacked",
                                        file.path().string(), at, counted(most, "byte")));
            if (status == Z_OK && size_ - states_.back().unpacked >= apart_)
                keep(*stream, used);
        } while (status == Z_OK && (stream->avail_in > 0 || stream->avail_out == 0));
        if (status == Z_BUF_ERROR) // all of `in` is used
            status = Z_OK;
    }
    if (status == Z_OK)
        damage_ = fmt::format("the packed data end early, after {}", counted(packed_bytes, "byte"));
    else if (status != Z_STREAM_END)
        damage_ = fmt::format("damaged packed data near byte {}", at + used);
    else if (used != packed_bytes)
        damage_ = fmt::format("{} after the packed data's end", counted(packed_bytes - used, "byte"));
}

std::string InflatedStream::bytes(std::uint64_t at, std::uint64_t count) const {
    if (at > size_ || count > size_ - at)
        throw Error(fmt::format("{}: bytes {} to {} of the stream at byte {} are not there: {}", file_.path().string(),
                                at, at + count, at_,
                                damage_.empty() ? fmt::format("it has {}", counted(size_, "byte")) : damage_));
    require_memory(count, fmt::format("{}: a part of it", file_.path().string()));
    const auto next = std::ranges::upper_bound(states_, at, {}, [](const State& state) { return state.unpacked; });
    const State& before = *std::prev(next);
    const auto stream = copy_of(*before.stream);
    std::string bytes(count, '\0'), passed(std::min<std::uint64_t>(at - before.unpacked, first_apart), '\0');
    std::string in;
    std::uint64_t read = before.packed, place = before.unpacked;
    stream->avail_in = 0;
    while (place < at + count) {
        if (stream->avail_in == 0 && read < packed_bytes_) {
            in = file_.bytes(at_ + read, std::min(read_at_once, packed_bytes_ - read));
            read += in.size();
            stream->next_in = reinterpret_cast<Bytef*>(in.data());
            stream->avail_in = static_cast<uInt>(in.size());
        }
        const bool passing = place < at;
        const std::uint64_t room = std::min<std::uint64_t>(passing ? at - place : at + count - place, first_apart);
        stream->next_out = reinterpret_cast<Bytef*>(passing ? passed.data() : bytes.data() + (place - at));
        stream->avail_out = static_cast<uInt>(room);
        const int status = inflate(stream.get(), Z_NO_FLUSH);
        const std::uint64_t came = room - stream->avail_out;
        place += came;
        const bool more_to_read = stream->avail_in == 0 && read < packed_bytes_;
        if (place < at + count && status != Z_OK && !(status == Z_BUF_ERROR && more_to_read))
            throw Error(
                fmt::format("{}: the stream at byte {} has changed since it was opened", file_.path().string(), at_));
    }
    return bytes;
}

} // namespace scanshade
