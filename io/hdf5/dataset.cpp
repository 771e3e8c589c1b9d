// A data set's description: its shape, the kind of its numbers, where they lie and how they are packed (IV.A.2 of the
// specification), and the tree of its chunks (III.A.1).
#include "io/hdf5/blocks.h"
#include "io/hdf5/hdf5.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <array>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <optional>

namespace scanshade {

using namespace hdf5;

namespace {

constexpr std::size_t most_dimensions = 8;
/// Of a whole array, so that products of sizes do not overflow.
constexpr std::uint64_t most_bytes = std::uint64_t(1) << 48;
/// libhdf5's own limit is 4 GiB.
constexpr std::uint64_t most_chunk_bytes = std::uint64_t(1) << 30;

std::vector<std::uint64_t> shape_in(Fields fields) {
    const std::uint8_t version = fields.u8();
    if (version != 1 && version != 2)
        throw Error(fmt::format("{}: a shape of version {}, expected 1 or 2", fields.where(), version));
    const std::uint8_t dimensions = fields.u8();
    if (dimensions == 0 || dimensions > most_dimensions)
        throw Error(
            fmt::format("{}: {}, expected 1 to {}", fields.where(), counted(dimensions, "dimension"), most_dimensions));
    fields.skip(version == 1 ? 6 : 2);
    std::vector<std::uint64_t> shape;
    std::uint64_t elements = 1;
    for (int i = 0; i < dimensions; ++i) {
        shape.push_back(fields.u64());
        if (shape.back() == 0 || shape.back() > most_bytes / 8 / elements)
            throw Error(fmt::format("{}: an array of {} numbers in one direction, {} of its sizes read", fields.where(),
                                    shape.back(), i + 1));
        elements *= shape.back();
    }
    return shape;
}

/// Classes 0 (integers) and 1 (floats), in IEEE's layouts.
Hdf5Number number_in(Fields fields) {
    const std::uint8_t start = fields.u8();
    static constexpr std::array classes{"integers", "floats",     "times", "texts", "bits",  "bytes",
                                        "records",  "references", "names", "lists", "arrays"};
    const std::size_t kind = start & 15U;
    if (kind > 1)
        throw Error(fmt::format("{}: {}, expected integers or floats", fields.where(),
                                kind < classes.size() ? classes[kind] : "elements of an unknown class"));
    const std::uint8_t bits = fields.u8();
    const std::uint8_t sign = fields.u8();
    fields.skip(1);
    Hdf5Number number;
    number.floats = kind == 1;
    number.big_endian = (bits & 1) != 0;
    number.bytes = fields.u32();
    const std::uint16_t offset = fields.u16(), precision = fields.u16();
    const auto require_usual = [&](bool usual) {
        if (!usual)
            throw Error(
                fmt::format("{}: {} of {} bytes in an unusual layout", fields.where(), classes[kind], number.bytes));
    };
    if (!number.floats) {
        number.is_signed = (bits & 8) != 0;
        const bool whole_bytes = number.bytes == 1 || number.bytes == 2 || number.bytes == 4 || number.bytes == 8;
        require_usual(whole_bytes && offset == 0 && precision == number.bytes * 8);
        return number;
    }
    const unsigned exponent_at = fields.u8(), exponent = fields.u8(), mantissa_at = fields.u8(), mantissa = fields.u8();
    const std::uint32_t bias = fields.u32();
    const bool half = number.bytes == 2 && exponent == 5 && mantissa == 10 && bias == 15,
               single = number.bytes == 4 && exponent == 8 && mantissa == 23 && bias == 127,
               twice = number.bytes == 8 && exponent == 11 && mantissa == 52 && bias == 1023;
    constexpr int implied_one = 2;
    require_usual((half || single || twice) && mantissa_at == 0 && exponent_at == mantissa &&
                  sign == exponent + mantissa && offset == 0 && precision == number.bytes * 8 && (bits & 0x40) == 0 &&
                  (bits >> 4 & 3) == implied_one);
    return number;
}

std::vector<Hdf5Filter> filters_in(Fields fields) {
    const std::uint8_t version = fields.u8();
    if (version != 1 && version != 2)
        throw Error(fmt::format("{}: filters of version {}, expected 1 or 2", fields.where(), version));
    const std::uint8_t count = fields.u8();
    if (version == 1)
        fields.skip(6);
    constexpr int most_filters = 32;
    if (count > most_filters)
        throw Error(fmt::format("{}: {}, expected at most {}", fields.where(), counted(count, "filter"), most_filters));
    constexpr std::uint16_t first_without_own_name = 256;
    std::vector<Hdf5Filter> filters;
    for (int i = 0; i < count; ++i) {
        const std::uint16_t id = fields.u16();
        const std::uint16_t name_bytes = version == 1 || id >= first_without_own_name ? fields.u16() : std::uint16_t(0);
        fields.skip(2);
        const std::uint16_t values = fields.u16();
        const std::string name(fields.take(version == 1 ? (name_bytes + 7U) / 8 * 8 : name_bytes));
        fields.skip(values * 4U + (version == 1 && values % 2 == 1 ? 4 : 0));
        const auto filter = static_cast<Hdf5Filter>(id);
        if (filter != Hdf5Filter::deflate && filter != Hdf5Filter::shuffle && filter != Hdf5Filter::fletcher32)
            throw Error(fmt::format("{}: packed by filter {} {}; deflate, shuffle and fletcher32 are read",
                                    fields.where(), id, in_quotes(name.substr(0, name.find('\0')))));
        filters.push_back(filter);
    }
    return filters;
}

/// The chunks of a data set by their place in the array.
class ChunkTree {
  public:
    ChunkTree(const Source& source, const std::vector<std::uint64_t>& shape, const std::vector<std::uint64_t>& size)
        : source_(source), size_(size) {
        std::uint64_t all = 1;
        for (std::size_t i = 0; i < shape.size(); ++i) {
            grid_.push_back((shape[i] - 1) / size[i] + 1);
            all *= grid_.back();
        }
        constexpr std::uint64_t most_chunks = 1 << 24;
        const std::uint64_t possible = std::min(most_chunks, source.file.size() / key_and_child());
        if (all > possible)
            throw Error(
                fmt::format("{} chunks, expected at most {} in a file of {} bytes", all, possible, source.file.size()));
        found_.resize(all, {nowhere, 0, 0});
    }

    /// Of the node at this address and those below it.
    void read(std::uint64_t address, int level_above) {
        constexpr std::uint64_t header = 24;
        Fields fields(source_.bytes(address, header), source_.at(address) + ": a tree of chunks");
        if (++nodes_ > 2 * found_.size() + 64)
            source_.refuse(address, "a tree of chunks with more nodes than chunks");
        fields.expect("TREE");
        const std::uint8_t type = fields.u8();
        const int level = fields.u8();
        if (type != 1 || level >= level_above)
            source_.refuse(address, fmt::format("a tree's node of kind {} and level {}, expected kind 1 below level {}",
                                                type, level, level_above));
        const std::uint16_t count = fields.u16();
        Fields entries(source_.bytes(address + header, count * key_and_child()),
                       source_.at(address) + ": a tree of chunks");
        for (int i = 0; i < count; ++i) {
            Hdf5Chunk chunk;
            chunk.stored = entries.u32();
            chunk.left_out = entries.u32();
            std::uint64_t place = 0;
            bool inside = true;
            for (std::size_t d = 0; d < size_.size(); ++d) {
                const std::uint64_t offset = entries.u64();
                inside = inside && offset % size_[d] == 0 && offset / size_[d] < grid_[d];
                place = place * grid_[d] + offset / size_[d] % grid_[d];
            }
            entries.skip(8); // within an element: 0
            chunk.address = entries.u64();
            if (level > 0)
                read(chunk.address, level);
            else if (!inside)
                source_.refuse(address, "a chunk outside of the array");
            else
                found_[place] = chunk;
        }
    }

    [[nodiscard]] std::vector<Hdf5Chunk> all() && {
        const auto missing = std::ranges::count(found_, nowhere, &Hdf5Chunk::address);
        if (missing > 0)
            throw Error(fmt::format("{} of its {} chunks are missing", missing, found_.size()));
        return std::move(found_);
    }

  private:
    [[nodiscard]] std::uint64_t key_and_child() const { return 8 + 8 * (size_.size() + 1) + 8; }

    const Source& source_;
    const std::vector<std::uint64_t>& size_;
    std::vector<std::uint64_t> grid_;
    std::vector<Hdf5Chunk> found_;
    std::size_t nodes_ = 0;
};

} // namespace

namespace {

/// Where the elements lie, of a layout message.
struct Layout {
    enum class Kind { compact, contiguous, chunked } kind = Kind::compact;
    std::string compact;
    std::uint64_t address = 0;
    std::vector<std::uint64_t> chunk_size;
    bool tree = true;         ///< of chunks; else there is one
    std::uint64_t stored = 0; ///< of the one, where it is packed
    std::uint32_t left_out = 0;
};

Layout chunked_layout(Fields& fields, std::uint8_t version, std::size_t dimensions) {
    Layout layout;
    layout.kind = Layout::Kind::chunked;
    const std::uint8_t flags = version == 4 ? fields.u8() : std::uint8_t(0);
    const std::size_t sizes = fields.u8(); // the last is an element's
    if (sizes != dimensions + 1)
        throw Error(
            fmt::format("{}: chunks of {}, expected {}", fields.where(), counted(sizes, "size"), dimensions + 1));
    if (version == 3)
        layout.address = fields.u64();
    const std::uint8_t bytes = version == 4 ? fields.u8() : std::uint8_t(4);
    if (bytes == 0 || bytes > 8)
        throw Error(fmt::format("{}: sizes of {} bytes, expected 1 to 8", fields.where(), bytes));
    for (std::size_t i = 0; i < dimensions; ++i)
        layout.chunk_size.push_back(fields.number(bytes));
    fields.skip(bytes);
    if (version == 3)
        return layout;
    constexpr int single_chunk = 1, packed = 2;
    if (const std::uint8_t index = fields.u8(); index != single_chunk)
        throw Error(
            fmt::format("{}: an index of chunks of kind {} (libver='latest'), expected a tree", fields.where(), index));
    layout.tree = false;
    if ((flags & packed) != 0) {
        layout.stored = fields.u64();
        layout.left_out = fields.u32();
    }
    layout.address = fields.u64();
    return layout;
}

Layout layout_in(Fields fields, std::size_t dimensions) {
    const std::uint8_t version = fields.u8();
    if (version != 3 && version != 4)
        throw Error(fmt::format("{}: a layout of version {}, expected 3 or 4", fields.where(), version));
    Layout layout;
    const std::uint8_t kind = fields.u8();
    if (kind == 0) {
        layout.compact = fields.take(fields.u16());
    } else if (kind == 1) {
        layout.kind = Layout::Kind::contiguous;
        layout.address = fields.u64();
    } else if (kind == 2) {
        layout = chunked_layout(fields, version, dimensions);
    } else {
        throw Error(
            fmt::format("{}: a layout of kind {} (virtual, or unknown), expected 0 to 2", fields.where(), kind));
    }
    return layout;
}

std::uint64_t product(const std::vector<std::uint64_t>& sizes) {
    std::uint64_t all = 1;
    for (const std::uint64_t size : sizes)
        all *= size;
    return all;
}

/// Throws Error unless the chunks' extent is that of some chunk.
std::uint64_t checked_chunk_bytes(const std::vector<std::uint64_t>& size, std::size_t element) {
    std::uint64_t bytes = element;
    for (const std::uint64_t side : size) {
        if (side == 0 || side > most_chunk_bytes / bytes)
            throw Error(fmt::format("chunks of {}, expected at most {} bytes", fmt::join(size, "x"), most_chunk_bytes));
        bytes *= side;
    }
    return bytes;
}

} // namespace

Hdf5Dataset Hdf5File::dataset(const std::string& name) const {
    const std::string file = file_->path().string();
    const auto found = std::ranges::find(names_, name);
    if (found == names_.end()) {
        std::vector<std::string> shown;
        for (std::size_t i = 0; i < std::min<std::size_t>(names_.size(), 20); ++i)
            shown.push_back(in_quotes(names_[i]));
        throw Error(fmt::format("{}: no data set \"{}\", found {}", file, name,
                                shown.empty() ? "none" : fmt::format("{}", fmt::join(shown, ", "))));
    }
    const Source source{*file_, base_};
    Hdf5Dataset set;
    set.file_ = file_;
    set.name_ = fmt::format("{}: {}", file, name);
    std::optional<Layout> layout;
    std::optional<Fields> layout_fields;
    const auto fields_of = [&](const Message& message) {
        if (message.shared)
            source.refuse(message.at, fmt::format("{} is described elsewhere in the file (a named type)", name));
        return Fields(message.data, fmt::format("{} (byte {})", set.name_, base_ + message.at));
    };
    for (const Message& message : messages_of(source, headers_[static_cast<std::size_t>(found - names_.begin())])) {
        if (message.type == MessageType::dataspace)
            set.shape_ = shape_in(fields_of(message));
        else if (message.type == MessageType::datatype)
            set.number_ = number_in(fields_of(message));
        else if (message.type == MessageType::filters)
            set.filters_ = filters_in(fields_of(message));
        else if (message.type == MessageType::layout)
            layout_fields = fields_of(message);
        else if (message.type == MessageType::external_files)
            throw Error(set.name_ + ": its numbers lie in other files");
    }
    if (set.shape_.empty() || set.number_.bytes == 0 || !layout_fields)
        throw Error(set.name_ + ": no array of numbers: its shape, kind or layout is missing");
    layout = layout_in(*std::move(layout_fields), set.shape_.size());
    const std::uint64_t bytes = product(set.shape_) * set.number_.bytes;
    set.address_ = layout->address;
    set.compact_ = std::move(layout->compact);
    if (layout->kind == Layout::Kind::compact && set.compact_.size() != bytes)
        throw Error(
            fmt::format("{}: {} needs {} bytes, found {}", set.name_, set.described(), bytes, set.compact_.size()));
    if (layout->kind == Layout::Kind::contiguous) {
        if (set.address_ == nowhere || set.address_ > file_->size() || base_ > file_->size() - set.address_ ||
            bytes > file_->size() - set.address_ - base_)
            throw Error(fmt::format("{}: {} needs {} bytes {}, the file ends at {}", set.name_, set.described(), bytes,
                                    set.address_ == nowhere ? "that were never written"
                                                            : fmt::format("at byte {}", base_ + set.address_),
                                    file_->size()));
        set.address_ += base_;
    }
    if (layout->kind == Layout::Kind::chunked)
        during(set.name_, [&] {
            set.chunk_size_ = layout->chunk_size;
            set.chunk_bytes_ = checked_chunk_bytes(set.chunk_size_, set.number_.bytes);
            if (layout->address == nowhere)
                throw Error("its numbers were never written");
            ChunkTree tree(source, set.shape_, set.chunk_size_);
            constexpr int above_all = 256;
            if (layout->tree)
                tree.read(layout->address, above_all);
            set.chunks_ =
                layout->tree
                    ? std::move(tree).all()
                    : std::vector{Hdf5Chunk{layout->address, layout->stored > 0 ? layout->stored : set.chunk_bytes_,
                                            layout->left_out}};
            if (!layout->tree)
                for (std::size_t i = 0; i < set.shape_.size(); ++i)
                    if (set.chunk_size_[i] < set.shape_[i])
                        throw Error(fmt::format("one chunk of {}, expected all of {}", fmt::join(set.chunk_size_, "x"),
                                                fmt::join(set.shape_, "x")));
            for (Hdf5Chunk& chunk : set.chunks_)
                chunk.address += base_; // beyond the file where it is hostile: reading says so
        });
    return set;
}

} // namespace scanshade
