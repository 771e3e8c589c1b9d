#include "io/rasters/cog.h"

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <memory>
#include <system_error>
#include <unistd.h>

namespace scanshade::rasters {

namespace {

template <class Number>
std::string bytes_of(const std::vector<Number>& values) {
    std::string bytes(values.size() * sizeof(Number), '\0');
    if (!values.empty())
        std::memcpy(bytes.data(), values.data(), bytes.size());
    return bytes;
}

[[noreturn]] void fail(const char* what) { throw std::system_error(errno, std::generic_category(), what); }

/// Sizes of a directory's parts, in TIFF and in BigTIFF.
struct Sizes {
    explicit Sizes(bool is_big) : big(is_big) {}
    bool big;
    [[nodiscard]] std::uint64_t header() const { return big ? 16 : 8; }
    [[nodiscard]] std::uint64_t count() const { return big ? 8 : 2; }
    [[nodiscard]] std::uint64_t offset() const { return big ? 8 : 4; }
    [[nodiscard]] std::uint64_t entry() const { return big ? 20 : 12; }
};

std::uint64_t even(std::uint64_t at) { return at + at % 2; }

/// With the places behind the entries for values that do not fit into them.
std::uint64_t directory_size(const std::vector<TiffTag>& tags, const Sizes& sizes) {
    std::uint64_t size = sizes.count() + tags.size() * sizes.entry() + sizes.offset();
    for (const TiffTag& tag : tags)
        size += tag.bytes.size() > sizes.offset() ? even(tag.bytes.size()) : 0;
    return even(size);
}

void put(std::string& to, std::uint64_t value, std::uint64_t size) {
    if (size == 2)
        to += bytes_of(std::vector{static_cast<std::uint16_t>(value)});
    else if (size == 4)
        to += bytes_of(std::vector{static_cast<std::uint32_t>(value)});
    else
        to += bytes_of(std::vector{value});
}

/// `at`: where the directory lies in the file. `next`: the one behind it; 0 = the last.
std::string directory_bytes(const std::vector<TiffTag>& tags, std::uint64_t at, std::uint64_t next,
                            const Sizes& sizes) {
    std::string entries, values;
    const std::uint64_t values_at = at + sizes.count() + tags.size() * sizes.entry() + sizes.offset();
    put(entries, tags.size(), sizes.count());
    for (const TiffTag& tag : tags) {
        put(entries, tag.id, 2), put(entries, tag.type, 2), put(entries, tag.count, sizes.offset());
        if (tag.bytes.size() > sizes.offset()) {
            put(entries, values_at + values.size(), sizes.offset());
            values += tag.bytes;
            values.resize(even(values.size()));
        } else {
            entries += tag.bytes + std::string(sizes.offset() - tag.bytes.size(), '\0');
        }
    }
    put(entries, next, sizes.offset());
    std::string all = entries + values;
    all.resize(even(all.size()));
    return all;
}

void set_tag(std::vector<TiffTag>& tags, TiffTag tag) {
    std::erase_if(tags, [&](const TiffTag& other) { return other.id == tag.id; });
    tags.insert(std::ranges::upper_bound(tags, tag.id, {}, &TiffTag::id), std::move(tag));
}

/// Places of tiles and how many bytes they have, the smallest overview first. Returns the end of the file.
std::uint64_t set_places(std::vector<CogImage>& images, std::uint64_t at, const Sizes& sizes) {
    for (auto image = images.rbegin(); image != images.rend(); ++image) {
        std::string places, counts;
        for (const Spool::Part& tile : image->tiles) {
            put(places, at, sizes.offset()), put(counts, tile.size, 4);
            at += tile.size;
        }
        const TIFFDataType type = sizes.big ? TIFF_LONG8 : TIFF_LONG;
        set_tag(image->tags, {TIFFTAG_TILEOFFSETS, type, image->tiles.size(), std::move(places)});
        set_tag(image->tags, {TIFFTAG_TILEBYTECOUNTS, TIFF_LONG, image->tiles.size(), std::move(counts)});
    }
    return at;
}

/// Header and directories.
std::string head_of(const std::vector<CogImage>& images, const Sizes& sizes) {
    std::string head = std::endian::native == std::endian::little ? "II" : "MM";
    put(head, sizes.big ? 43 : 42, 2);
    if (sizes.big)
        put(head, 8, 2), put(head, 0, 2);
    put(head, sizes.header(), sizes.offset());
    for (const CogImage& image : images) {
        const std::uint64_t at = head.size(), next = at + directory_size(image.tags, sizes);
        head += directory_bytes(image.tags, at, &image == &images.back() ? 0 : next, sizes);
    }
    return head;
}

} // namespace

TiffTag short_tag(std::uint16_t id, const std::vector<std::uint16_t>& values) {
    return {id, TIFF_SHORT, values.size(), bytes_of(values)};
}
TiffTag long_tag(std::uint16_t id, std::uint32_t value) { return {id, TIFF_LONG, 1, bytes_of(std::vector{value})}; }
TiffTag double_tag(std::uint16_t id, const std::vector<double>& values) {
    return {id, TIFF_DOUBLE, values.size(), bytes_of(values)};
}
TiffTag text_tag(std::uint16_t id, const std::string& text) { return {id, TIFF_ASCII, text.size() + 1, text + '\0'}; }

Spool::Spool(const std::filesystem::path& folder) {
    std::string name = (folder / ".scanshade-XXXXXX").string();
    file_ = ::mkostemp(name.data(), O_CLOEXEC);
    if (file_ < 0)
        fail("cannot be created");
    ::unlink(name.c_str());
}

Spool::~Spool() { ::close(file_); }

Spool::Part Spool::add(std::string_view bytes) {
    const Part part{end_, bytes.size()};
    while (!bytes.empty()) {
        const ssize_t written = ::pwrite(file_, bytes.data(), bytes.size(), static_cast<off_t>(end_));
        if (written < 0 && errno == EINTR)
            continue;
        if (written <= 0)
            fail("cannot be written");
        end_ += static_cast<std::uint64_t>(written), bytes.remove_prefix(static_cast<std::size_t>(written));
    }
    return part;
}

std::string Spool::bytes(const Part& part) const {
    std::string bytes(part.size, '\0');
    for (std::size_t have = 0; have < bytes.size();) {
        const ssize_t read =
            ::pread(file_, bytes.data() + have, bytes.size() - have, static_cast<off_t>(part.at + have));
        if (read < 0 && errno == EINTR)
            continue;
        if (read <= 0)
            fail("cannot be read again");
        have += static_cast<std::size_t>(read);
    }
    return bytes;
}

void write_cog(const std::filesystem::path& file, std::vector<CogImage> images, const Spool& spool, bool big) {
    constexpr std::uint64_t most_plain = (std::uint64_t(1) << 32) - 1;
    Sizes sizes(big);
    (void)set_places(images, 0, sizes); // so that directories have their sizes
    std::uint64_t begin = head_of(images, sizes).size();
    if (set_places(images, begin, sizes) > most_plain && !big) {
        sizes.big = true;
        (void)set_places(images, 0, sizes);
        begin = head_of(images, sizes).size();
        (void)set_places(images, begin, sizes);
    }
    const std::string head = head_of(images, sizes);
    const std::unique_ptr<std::FILE, int (*)(std::FILE*)> stream(std::fopen(file.c_str(), "wb"), &std::fclose);
    if (!stream)
        fail("cannot be created");
    const auto write = [&](const std::string& bytes) {
        if (std::fwrite(bytes.data(), 1, bytes.size(), stream.get()) != bytes.size())
            fail("cannot be written");
    };
    write(head);
    for (auto image = images.rbegin(); image != images.rend(); ++image)
        for (const Spool::Part& tile : image->tiles)
            write(spool.bytes(tile));
    if (std::fflush(stream.get()) != 0)
        fail("cannot be written");
}

} // namespace scanshade::rasters
