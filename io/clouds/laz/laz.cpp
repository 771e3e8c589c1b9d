// Chunks, their table, and the record that describes them.
#include "io/clouds/laz/laz.h"

#include "io/clouds/laz/layered.h"
#include "io/clouds/laz/pointwise.h"
#include "projection/base/memory.h"

#include <tbb/parallel_for.h>

namespace scanshade::laz {

namespace {

struct Item {
    std::uint16_t type = 0, size = 0, version = 0;
};
enum Type : std::uint16_t {
    bytes = 0,
    point10 = 6,
    time11 = 7,
    rgb12 = 8,
    point14 = 10,
    rgb14 = 11,
    rgbnir14 = 12,
    bytes14 = 14
};
constexpr std::size_t body_head = 34, item_size = 6;

constexpr bool layered(int point_format) { return point_format >= 6; }

LayerSet layer_set(const Packing& packing) {
    return {packing.colours, packing.infrared, packing.extra, packing.colour_version, packing.extra_version};
}

/// The items of a format, in the order of the record.
std::vector<Item> items_of(const Packing& packing) {
    const bool layers = packing.compressor == 3;
    std::vector<Item> items{layers ? Item{point14, 30, 3} : Item{point10, 20, 2}};
    if (!layers && packing.times)
        items.push_back({time11, 8, 2});
    if (packing.infrared)
        items.push_back({rgbnir14, 8, 3});
    else if (packing.colours)
        items.push_back(layers ? Item{rgb14, 6, 3} : Item{rgb12, 6, 2});
    if (packing.extra > 0)
        items.push_back({layers ? bytes14 : bytes, static_cast<std::uint16_t>(packing.extra),
                         layers ? std::uint16_t(3) : std::uint16_t(2)});
    return items;
}

/// Decodes a chunk part by part.
class ChunkReader {
  public:
    ChunkReader(std::string_view file, const Chunk& chunk, const Packing& packing)
        : packing_(packing), last_(file.substr(chunk.begin, packing.length)), count_(chunk.count) {
        const std::uint64_t begin = chunk.begin + packing.length, end = chunk.begin + chunk.bytes;
        if (packing.compressor == 3)
            begin_layers(file, begin, end, chunk.count);
        else
            begin_stream(file, begin, end);
    }

    /// The next points.
    void read(char* to, std::size_t count) {
        const char* last = last_.data();
        for (std::size_t i = 0; i < count; ++i, ++done_, to += packing_.length) {
            if (done_ == 0)
                std::copy(last_.begin(), last_.end(), to);
            else if (layers_)
                layers_->code(to);
            else
                stream_->code(*decoder_, last, to);
            last = to;
        }
        if (last != last_.data())
            last_.assign(last, packing_.length);
    }
    [[nodiscard]] std::uint64_t done() const { return done_; }

    /// Streams end with their last point; other lengths are a sign of damage.
    void check_end() const {
        if (decoder_ && packing_.compressor == 2)
            check_end(*decoder_, end_);
        for (std::size_t i = 0; i < coders_.size(); ++i)
            if (coders_[i].coder)
                check_end(*coders_[i].coder, ends_[i]);
    }

  private:
    static void check_end(const Decoder& decoder, std::uint64_t end) {
        if (decoder.position() != end)
            throw Error(fmt::format("the points end at byte {}, their stream at {}: the file is damaged",
                                    decoder.position(), end));
    }
    void begin_stream(std::string_view file, std::uint64_t begin, std::uint64_t end) {
        if (count_ < 2) { // some writers leave an empty stream behind a single point
            if (end - begin != 0 && end - begin != 4 && packing_.compressor == 2)
                throw Error(fmt::format("a stream of {} bytes behind a single point (byte {})", end - begin, begin));
            return;
        }
        end_ = end;
        decoder_.emplace(file.substr(begin, end - begin), begin);
        stream_ = std::make_unique<PointwiseChunk>(packing_.times, packing_.colours, packing_.extra, last_.data());
    }
    void begin_layers(std::string_view file, std::uint64_t begin, std::uint64_t end, std::uint64_t count) {
        const LayerSet set = layer_set(packing_);
        const std::uint64_t sizes = 4 + 4 * set.layers();
        if (end - begin < sizes)
            throw Error(
                fmt::format("{} bytes for the sizes of layers, {} expected (byte {})", end - begin, sizes, begin));
        if (const auto said = load<std::uint32_t>(file.data() + begin); said != count)
            throw Error(fmt::format("it says {} points, the table {} (byte {})", said, count, begin));
        coders_.resize(set.layers());
        std::uint64_t at = begin + sizes;
        for (std::size_t i = 0; i < set.layers(); ++i) {
            const auto size = load<std::uint32_t>(file.data() + begin + 4 + 4 * i);
            if (size > end - at)
                throw Error(fmt::format("layer {} is said to have {} bytes, {} are left (byte {})", i, size, end - at,
                                        begin + 4 + 4 * i));
            if (size > 0 && count > 1)
                coders_[i].coder.emplace(file.substr(at, size), at);
            else if (i == 0 && count > 1)
                throw Error(fmt::format("no layer of x and y (byte {})", begin + 4));
            at += size;
            ends_.push_back(at);
        }
        layers_ = std::make_unique<LayeredChunk<Decoder>>(set, coders_, last_.data());
    }

    const Packing& packing_;
    std::string last_;
    std::uint64_t count_, done_ = 0, end_ = 0;
    std::vector<std::uint64_t> ends_; ///< of layers
    std::optional<Decoder> decoder_;
    std::unique_ptr<PointwiseChunk> stream_;
    std::vector<Layer<Decoder>> coders_;
    std::unique_ptr<LayeredChunk<Decoder>> layers_;
};

/// A chunk into place, or piece by piece behind `grown`.
void read_chunk(std::string_view file, std::size_t index, const Chunk& chunk, const Packing& packing, char* place,
                std::string* grown) {
    std::uint64_t point = 0;
    try {
        ChunkReader reader(file, chunk, packing);
        constexpr std::uint64_t at_once = 1 << 16;
        const auto read = [&](char* to, std::uint64_t count) {
            try {
                reader.read(to, count);
            } catch (const Error&) {
                point = reader.done();
                throw;
            }
        };
        if (!grown)
            read(place, chunk.count);
        for (std::uint64_t left = grown ? chunk.count : 0; left > 0; left -= std::min(left, at_once)) {
            const std::size_t before = grown->size(), more = std::min(left, at_once) * packing.length;
            if (before + more > grown->capacity())
                require_memory(3 * before + more, "unpacking the points");
            grown->resize(before + more);
            read(grown->data() + before, std::min(left, at_once));
        }
        point = reader.done();
        reader.check_end();
    } catch (const Error& failure) {
        throw Error(fmt::format("chunk {} (bytes {} .. {}), point {}: {}", index, chunk.begin,
                                chunk.begin + chunk.bytes, chunk.first + point, failure.what()));
    }
}

/// Byte of the file where the table of chunks begins.
std::uint64_t table_of(const ReadBytes& read, std::uint64_t size, std::uint64_t begin, std::uint64_t end) {
    if (end - begin < 8)
        throw Error(
            fmt::format("the position of the chunk table needs 8 bytes at byte {}, {} are there", begin, end - begin));
    auto table = load<std::uint64_t>(read(begin, 8).data());
    if (table == ~std::uint64_t(0)) // the writer could not go back
        table = load<std::uint64_t>(read(size - 8, 8).data());
    if (table == begin)
        throw Error(fmt::format("written by a stopped program: no chunk table (byte {})", begin));
    if (table > size - 8)
        throw Error(fmt::format("the chunk table is said to begin at byte {}, the file has {}: the file is cut short",
                                table, size));
    if (table < begin + 8)
        throw Error(fmt::format("the chunk table is said to begin at byte {}, the points begin at {}", table, begin));
    return table;
}

} // namespace

std::vector<Chunk> chunks_of(const ReadBytes& read, std::uint64_t file_size, std::uint64_t begin, std::uint64_t& end,
                             std::uint64_t count, const Packing& packing) {
    const std::uint64_t table = table_of(read, file_size, begin, end);
    const std::string head = read(table, 8);
    const auto version = load<std::uint32_t>(head.data()), said = load<std::uint32_t>(head.data() + 4);
    if (version != 0)
        throw Error(fmt::format("chunk table of version {} at byte {}, expected 0", version, table));
    const bool varying = packing.chunk_points == varying_chunks;
    const std::uint64_t expected =
        varying ? said : (std::uint64_t(count) + packing.chunk_points - 1) / packing.chunk_points;
    if (said != expected || said > (table - begin - 8) / packing.length)
        throw Error(fmt::format("the chunk table at byte {} says {} chunks, {} points in {} bytes need {}", table, said,
                                count, table - begin - 8, expected));
    end = std::max<std::uint64_t>(end, table + 8);
    std::vector<Chunk> chunks;
    Chunk chunk{.begin = begin + 8, .bytes = 0, .first = 0, .count = 0};
    if (said > 0) {
        // A number takes less than eight bytes, and a chunk has two.
        const std::string numbers_packed =
            read(table + 8, std::min<std::uint64_t>(end - table - 8, 16 * std::uint64_t(said) + 64));
        Decoder decoder(numbers_packed, table + 8);
        IntegerCoder numbers(32, 2);
        for (std::uint32_t i = 0; i < said; ++i) {
            const auto before = static_cast<std::uint32_t>(chunk.count);
            const std::uint64_t left = count - chunk.first;
            chunk.count =
                varying ? numbers.code(decoder, before, 0, 0) : std::min<std::uint64_t>(packing.chunk_points, left);
            chunk.bytes = numbers.code(decoder, static_cast<std::uint32_t>(chunk.bytes), 0, 1);
            if (chunk.bytes < packing.length || chunk.bytes > table - chunk.begin || chunk.count == 0 ||
                chunk.count > 4096 * chunk.bytes)
                throw Error(fmt::format("chunk {}: {} points in {} bytes from byte {} cannot be", i, chunk.count,
                                        chunk.bytes, chunk.begin));
            if (chunk.count > left)
                throw Error(fmt::format("chunk {}: {} points, {} of {} are left", i, chunk.count, left, count));
            chunks.push_back(chunk);
            chunk.begin += chunk.bytes;
            chunk.first += chunk.count;
        }
        end = decoder.position();
    } else {
        end = table + 8;
    }
    if (chunk.first != count)
        throw Error(fmt::format("the chunks hold {} points, the header says {}", chunk.first, count));
    return chunks;
}

namespace {

std::string packed_chunk(std::string_view points, const Packing& packing) {
    const std::size_t length = packing.length;
    std::string result(points.substr(0, length));
    if (packing.compressor != 3) {
        Encoder encoder;
        PointwiseChunk chunk(packing.times, packing.colours, packing.extra, points.data());
        for (std::size_t at = length; at < points.size(); at += length)
            chunk.code(encoder, points.data() + at - length, points.data() + at);
        return result + encoder.finish();
    }
    const LayerSet set = layer_set(packing);
    std::vector<Layer<Encoder>> layers(set.layers());
    for (Layer<Encoder>& layer : layers)
        layer.coder.emplace();
    LayeredChunk<Encoder> chunk(set, layers, points.data());
    for (std::size_t at = length; at < points.size(); at += length)
        chunk.code(points.data() + at);
    std::string streams, sizes(4 + 4 * set.layers(), '\0');
    store(sizes.data(), static_cast<std::uint32_t>(points.size() / length));
    for (std::size_t i = 0; i < layers.size(); ++i) {
        if (i > LayeredChunk<Encoder>::z && !layers[i].needed)
            continue;
        const std::string stream = layers[i].coder->finish();
        store(sizes.data() + 4 + 4 * i, static_cast<std::uint32_t>(stream.size()));
        streams += stream;
    }
    return result + sizes + streams;
}

} // namespace

Packing usual_packing(int point_format, std::size_t record_length) {
    static constexpr std::array<std::size_t, 9> own{20, 28, 26, 34, 0, 0, 30, 36, 38};
    if (point_format > 8 || own[static_cast<std::size_t>(point_format)] == 0)
        throw Error(fmt::format("LAZ with wave packets (point format {}) is not read", point_format));
    Packing packing;
    packing.compressor = layered(point_format) ? 3 : 2;
    packing.times = layered(point_format) || point_format == 1 || point_format == 3;
    packing.colours = point_format == 2 || point_format == 3 || point_format >= 7;
    packing.infrared = point_format == 8;
    packing.length = record_length;
    packing.extra = record_length - own[static_cast<std::size_t>(point_format)];
    return packing;
}

Packing packing_of(std::string_view body, int point_format, std::size_t record_length) {
    Packing packing = usual_packing(point_format, record_length);
    const std::size_t count = body.size() < body_head ? 0 : load<std::uint16_t>(body.data() + 32);
    if (count == 0 || body.size() < body_head + item_size * count)
        throw Error(fmt::format("the record that describes LAZ has {} bytes for {} items", body.size(), count));
    packing.compressor = load<std::uint16_t>(body.data());
    if (packing.compressor < 1 || packing.compressor > 3)
        throw Error(fmt::format("LAZ compressor {}, expected 1, 2 or 3", packing.compressor));
    if ((packing.compressor == 3) != layered(point_format))
        throw Error(
            fmt::format("LAZ compressor {} does not go with point format {}", packing.compressor, point_format));
    if (const auto coder = load<std::uint16_t>(body.data() + 2); coder != 0)
        throw Error(fmt::format("LAZ coder {}, expected 0", coder));
    packing.chunk_points = load<std::uint32_t>(body.data() + 12);
    if (packing.chunk_points == 0 && packing.compressor != 1)
        throw Error("LAZ chunks of 0 points");
    std::vector<Item> items(count);
    std::size_t sum = 0;
    for (std::size_t i = 0; i < count; ++i) {
        const char* const at = body.data() + body_head + item_size * i;
        items[i] = {load<std::uint16_t>(at), load<std::uint16_t>(at + 2), load<std::uint16_t>(at + 4)};
        sum += items[i].size;
    }
    if (sum != record_length)
        throw Error(fmt::format("LAZ items add up to {} bytes, the record length is {}", sum, record_length));
    const std::vector<Item> expected = items_of(packing);
    for (std::size_t i = 0; i < count; ++i) {
        const Item& item = items[i];
        const bool known = i < expected.size() && item.type == expected[i].type && item.size == expected[i].size;
        const bool version = item.version == 2 || (packing.compressor == 3 && (item.version == 3 || item.version == 4));
        if (!known || !version || items.size() != expected.size())
            throw Error(fmt::format("LAZ item {} version {} of {} bytes at position {} is not read in point format {}",
                                    item.type, item.version, item.size, i, point_format));
        const int behaves_as = item.version == 4 ? 4 : 3;
        (item.type == bytes14 ? packing.extra_version : packing.colour_version) = behaves_as;
    }
    return packing;
}

std::string described(const Packing& packing) {
    const std::vector<Item> items = items_of(packing);
    std::string body(body_head + item_size * items.size(), '\0');
    store(body.data(), static_cast<std::uint16_t>(packing.compressor));
    body[4] = 3, body[5] = 4, body[6] = 3; // the version of LAZ whose rules pack() follows
    store(body.data() + 12, packing.chunk_points);
    std::fill(body.begin() + 16, body.begin() + 32, '\xff');
    store(body.data() + 32, static_cast<std::uint16_t>(items.size()));
    for (std::size_t i = 0; i < items.size(); ++i) {
        char* const at = body.data() + body_head + item_size * i;
        store(at, items[i].type), store(at + 2, items[i].size), store(at + 4, items[i].version);
    }
    return body;
}

Unpacked unpacked(std::string_view file, std::size_t begin, std::size_t end, std::size_t count,
                  const Packing& packing) {
    Unpacked result;
    std::vector<Chunk>& chunks = result.chunks;
    if (packing.compressor == 1) {
        if (count > 0 && (end - begin < packing.length || count > 4096 * (end - begin)))
            throw Error(fmt::format("{} points in {} bytes cannot be", count, end - begin));
        if (count > 0)
            chunks.push_back({begin, end - begin, 0, count});
    } else {
        std::uint64_t behind = end;
        chunks = chunks_of([&](std::uint64_t at, std::uint64_t bytes) { return std::string(file.substr(at, bytes)); },
                           file.size(), begin, behind, count, packing);
        end = behind;
    }
    result.end = end;
    // Chunks of equal points become thousands of times larger; so does what is damaged. Such files are believed bit by
    // bit.
    constexpr std::uint64_t common_ratio = 64, small = 64 << 20;
    const std::uint64_t size = std::uint64_t(count) * packing.length;
    if (size > common_ratio * (end - begin) + small) {
        for (std::size_t i = 0; i < chunks.size(); ++i)
            read_chunk(file, i, chunks[i], packing, nullptr, &result.points);
        return result;
    }
    require_memory(size, "unpacking the points");
    result.points.resize(size);
    tbb::parallel_for(std::size_t(0), chunks.size(), [&](std::size_t i) {
        read_chunk(file, i, chunks[i], packing, result.points.data() + chunks[i].first * packing.length, nullptr);
    });
    return result;
}

std::string unpacked_chunk(std::string_view bytes, const Chunk& chunk, std::size_t number, const Packing& packing) {
    std::string points;
    const Chunk here{0, chunk.bytes, chunk.first, chunk.count};
    try {
        read_chunk(bytes, number, here, packing, nullptr, &points);
    } catch (const Error& failure) {
        throw Error(fmt::format("in the chunk from byte {} on: {}", chunk.begin, failure.what()));
    }
    return points;
}

std::string Packer::add(std::string_view points) {
    waiting_ += points;
    return pack(false);
}

std::size_t Packer::bytes_of(std::size_t chunk) const {
    const bool varying = packing_.chunk_points == varying_chunks;
    return packing_.length * std::size_t(varying ? counts_.at(chunk) : packing_.chunk_points);
}

/// The chunks that are whole among what waits; with `all`, the last one, too.
std::string Packer::pack(bool all) {
    std::vector<std::size_t> ends{0};
    while (ends.back() < waiting_.size()) {
        const std::size_t bytes = bytes_of(chunks_.size() + ends.size() - 1), left = waiting_.size() - ends.back();
        if (bytes > left && !all)
            break;
        ends.push_back(ends.back() + std::min(bytes, left));
    }
    std::vector<std::string> packed(ends.size() - 1);
    tbb::parallel_for(std::size_t(0), packed.size(), [&](std::size_t i) {
        packed[i] = packed_chunk(std::string_view(waiting_).substr(ends[i], ends[i + 1] - ends[i]), packing_);
    });
    std::string result;
    for (std::size_t i = 0; i < packed.size(); ++i) {
        const std::uint64_t first = chunks_.empty() ? 0 : chunks_.back().first + chunks_.back().count;
        chunks_.push_back({8 + packed_, packed[i].size(), first, (ends[i + 1] - ends[i]) / packing_.length});
        packed_ += packed[i].size();
        result += packed[i];
    }
    waiting_.erase(0, ends.back());
    return result;
}

std::string Packer::finish() {
    std::string result = pack(true);
    std::string table(8, '\0');
    store(table.data() + 4, static_cast<std::uint32_t>(chunks_.size()));
    Encoder encoder;
    IntegerCoder numbers(32, 2);
    Chunk before;
    for (const Chunk& chunk : chunks_) {
        if (packing_.chunk_points == varying_chunks)
            numbers.code(encoder, static_cast<std::uint32_t>(before.count), static_cast<std::uint32_t>(chunk.count), 0);
        numbers.code(encoder, static_cast<std::uint32_t>(before.bytes), static_cast<std::uint32_t>(chunk.bytes), 1);
        before = chunk;
    }
    table += chunks_.empty() ? "" : encoder.finish();
    size_ = 8 + packed_ + table.size();
    return result + table;
}

std::vector<Chunk> Packer::chunks(std::uint64_t begin) const {
    std::vector<Chunk> there = chunks_;
    for (Chunk& chunk : there)
        chunk.begin += begin;
    return there;
}

std::string Packer::table(std::uint64_t begin) const {
    std::string bytes(8, '\0');
    store(bytes.data(), begin + 8 + packed_);
    return bytes;
}

std::string packed(std::string_view points, std::size_t begin, Packer& packer) {
    const std::string chunks = packer.add(points), rest = packer.finish();
    return packer.table(begin) + chunks + rest;
}

std::string packed(std::string_view points, std::size_t begin, const Packing& packing) {
    Packer packer(packing);
    return packed(points, begin, packer);
}

} // namespace scanshade::laz
