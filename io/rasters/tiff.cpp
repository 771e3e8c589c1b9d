#include "io/rasters/tiff.h"

#include "projection/base/error.h"

#include <algorithm>
#include <array>
#include <cstdarg>
#include <cstdio>
#include <cstring>
#include <fmt/format.h>

namespace scanshade::rasters {

namespace {

int keep_error(TIFF*, void* user, const char*, const char* format, va_list values) {
    auto& trouble = *static_cast<std::string*>(user);
    std::array<char, 512> text{};
    if (trouble.empty() && std::vsnprintf(text.data(), text.size(), format, values) > 0)
        trouble = text.data();
    return 1; // reported
}

/// libtiff leaves out tags whose values lie behind the end of the file, and only warns: their loss must not pass.
int keep_warning_of_loss(TIFF*, void* user, const char*, const char* format, va_list values) {
    auto& trouble = *static_cast<std::string*>(user);
    std::array<char, 512> text{};
    if (std::vsnprintf(text.data(), text.size(), format, values) > 0 && trouble.empty() &&
        std::string_view(text.data()).starts_with("IO error"))
        trouble = text.data();
    return 1; // reported
}

using OpenOptions = std::unique_ptr<TIFFOpenOptions, decltype(&TIFFOpenOptionsFree)>;

OpenOptions options_with(std::string& trouble) {
    constexpr tmsize_t most_at_once = tmsize_t(1) << 30; // bytes that libtiff may allocate for a tag or a tile
    OpenOptions options(TIFFOpenOptionsAlloc(), &TIFFOpenOptionsFree);
    TIFFOpenOptionsSetMaxSingleMemAlloc(options.get(), most_at_once);
    TIFFOpenOptionsSetErrorHandlerExtR(options.get(), &keep_error, &trouble);
    TIFFOpenOptionsSetWarningHandlerExtR(options.get(), &keep_warning_of_loss, &trouble);
    return options;
}

/// Private tags that are written; what is read needs no such list.
void describe_tags(TIFF* tiff) {
    static const auto names =
        std::to_array<std::string>({"ModelPixelScale", "ModelTiepoint", "GeoKeyDirectory", "GeoDoubleParams",
                                    "GeoAsciiParams", "GDALMetadata", "GDALNoData"});
    const auto row = [](std::uint32_t tag, TIFFDataType type, std::size_t name) {
        const bool text = type == TIFF_ASCII;
        return TIFFFieldInfo{tag,
                             TIFF_VARIABLE,
                             TIFF_VARIABLE,
                             type,
                             FIELD_CUSTOM,
                             1,
                             static_cast<unsigned char>(!text),
                             const_cast<char*>(names[name].c_str())};
    };
    static const std::array rows{row(tag_scale, TIFF_DOUBLE, 0),    row(tag_tiepoints, TIFF_DOUBLE, 1),
                                 row(tag_keys, TIFF_SHORT, 2),      row(tag_key_doubles, TIFF_DOUBLE, 3),
                                 row(tag_key_ascii, TIFF_ASCII, 4), row(tag_metadata, TIFF_ASCII, 5),
                                 row(tag_nodata, TIFF_ASCII, 6)};
    TIFFMergeFieldInfo(tiff, rows.data(), rows.size());
}

} // namespace

struct TiffInput::Source {
    const FileBytes& bytes;
    std::uint64_t at = 0;
    std::string trouble{};
    std::exception_ptr failure{}; ///< what reading threw, which must not pass through libtiff

    static Source& of(thandle_t handle) { return *static_cast<Source*>(handle); }
    static tmsize_t read(thandle_t handle, void* to, tmsize_t count) {
        Source& source = of(handle);
        const std::uint64_t rest = source.bytes.size() - std::min(source.at, source.bytes.size());
        const std::uint64_t length = std::min(rest, static_cast<std::uint64_t>(count));
        try {
            const std::string bytes = source.bytes.bytes(source.at, length);
            std::memcpy(to, bytes.data(), bytes.size());
        } catch (...) {
            source.failure = std::current_exception();
            return -1;
        }
        source.at += length;
        return static_cast<tmsize_t>(length);
    }
    static tmsize_t write(thandle_t, void*, tmsize_t) { return -1; }
    static toff_t seek(thandle_t handle, toff_t offset, int from) {
        Source& source = of(handle);
        source.at = offset + (from == SEEK_CUR ? source.at : from == SEEK_END ? source.bytes.size() : 0);
        return source.at;
    }
    static toff_t size(thandle_t handle) { return of(handle).bytes.size(); }
};

TiffInput::TiffInput(const std::filesystem::path& file)
    : bytes_(file), source_(std::make_unique<Source>(Source{bytes_})), tiff_(nullptr, &TIFFClose) {
    const OpenOptions options = options_with(source_->trouble);
    const auto close_nothing = [](thandle_t) { return 0; };
    tiff_.reset(TIFFClientOpenExt("", "r", source_.get(), &Source::read, &Source::write, &Source::seek, close_nothing,
                                  &Source::size, nullptr, nullptr, options.get()));
    if (!tiff_ || !source_->trouble.empty())
        fail();
}

bool TiffInput::next_directory() {
    const bool found = TIFFReadDirectory(tiff_.get()) != 0;
    if (!source_->trouble.empty())
        fail();
    return found;
}

TiffInput::~TiffInput() = default;

void TiffInput::refuse(const std::string& why) const { throw Error(file().string() + ": " + why); }

void TiffInput::fail() const {
    if (source_->failure)
        std::rethrow_exception(source_->failure);
    refuse(fmt::format("TIFF of {} bytes is damaged or cut short: {}", bytes_.size(),
                       source_->trouble.empty() ? "libtiff does not say where" : source_->trouble));
}

std::uint32_t TiffInput::number(std::uint32_t tag, std::uint32_t otherwise) const {
    std::uint32_t value = otherwise;
    return TIFFGetFieldDefaulted(tiff_.get(), tag, &value) ? value : otherwise;
}

std::uint16_t TiffInput::short_number(std::uint32_t tag, std::uint16_t otherwise) const {
    std::uint16_t value = otherwise;
    return TIFFGetFieldDefaulted(tiff_.get(), tag, &value) ? value : otherwise;
}

/// libtiff hands out tags that it does not know with a count and an array of the type in the file.
template <class Value>
std::vector<Value> TiffInput::values(std::uint32_t tag, TIFFDataType type) const {
    const TIFFField* field = TIFFFindField(tiff_.get(), tag, TIFF_ANY);
    if (!field || TIFFFieldDataType(field) != type || !TIFFFieldPassCount(field))
        return {};
    const Value* first = nullptr;
    std::uint32_t count = 0;
    std::uint16_t short_count = 0;
    const bool wide = TIFFFieldReadCount(field) == TIFF_VARIABLE2;
    if (!(wide ? TIFFGetField(tiff_.get(), tag, &count, &first)
               : TIFFGetField(tiff_.get(), tag, &short_count, &first)) ||
        !first)
        return {};
    return {first, first + (wide ? count : short_count)};
}

std::vector<double> TiffInput::doubles(std::uint32_t tag) const { return values<double>(tag, TIFF_DOUBLE); }
std::vector<std::uint16_t> TiffInput::shorts(std::uint32_t tag) const { return values<std::uint16_t>(tag, TIFF_SHORT); }

std::string TiffInput::ascii(std::uint32_t tag) const {
    // Tags that another library of the process has described to libtiff, as GDAL does, come without a count.
    if (const TIFFField* field = TIFFFindField(tiff_.get(), tag, TIFF_ANY);
        field && TIFFFieldDataType(field) == TIFF_ASCII && !TIFFFieldPassCount(field)) {
        const char* text = nullptr;
        return TIFFGetField(tiff_.get(), tag, &text) && text ? text : "";
    }
    const std::vector<char> found = values<char>(tag, TIFF_ASCII);
    return {found.begin(), std::ranges::find(found, '\0')};
}

struct TiffOutput::Sink {
    std::string bytes{};
    std::uint64_t at = 0;
    std::string trouble{}; ///< libtiff's first error

    static Sink& of(thandle_t handle) { return *static_cast<Sink*>(handle); }
    static tmsize_t read(thandle_t handle, void* to, tmsize_t count) {
        Sink& sink = of(handle);
        const std::size_t length = sink.bytes.copy(static_cast<char*>(to), static_cast<std::size_t>(count),
                                                   std::min<std::size_t>(sink.at, sink.bytes.size()));
        sink.at += length;
        return static_cast<tmsize_t>(length);
    }
    static tmsize_t write(thandle_t handle, void* from, tmsize_t count) {
        Sink& sink = of(handle);
        const auto length = static_cast<std::size_t>(count);
        sink.bytes.resize(std::max<std::size_t>(sink.bytes.size(), sink.at + length));
        std::memcpy(sink.bytes.data() + sink.at, from, length);
        sink.at += length;
        return count;
    }
    static toff_t seek(thandle_t handle, toff_t offset, int from) {
        Sink& sink = of(handle);
        sink.at = offset + (from == SEEK_CUR ? sink.at : from == SEEK_END ? sink.bytes.size() : 0);
        return sink.at;
    }
    static toff_t size(thandle_t handle) { return of(handle).bytes.size(); }
};

TiffOutput::TiffOutput(bool big) : sink_(std::make_unique<Sink>()), tiff_(nullptr, &TIFFClose) {
    const OpenOptions options = options_with(sink_->trouble);
    const auto close_nothing = [](thandle_t) { return 0; };
    tiff_.reset(TIFFClientOpenExt("", big ? "w8" : "w", sink_.get(), &Sink::read, &Sink::write, &Sink::seek,
                                  close_nothing, &Sink::size, nullptr, nullptr, options.get()));
    check(tiff_ != nullptr);
    describe_tags(tiff_.get());
}

TiffOutput::~TiffOutput() = default;

void TiffOutput::check(bool done) const {
    if (!done)
        throw std::runtime_error("a TIFF cannot be made: " + sink_->trouble);
}

void TiffOutput::set(std::uint32_t tag, int value) { check(TIFFSetField(tiff_.get(), tag, value)); }
void TiffOutput::set(std::uint32_t tag, const std::string& text) {
    check(TIFFSetField(tiff_.get(), tag, text.c_str()));
}
void TiffOutput::set(std::uint32_t tag, const std::vector<double>& values) {
    check(TIFFSetField(tiff_.get(), tag, static_cast<int>(values.size()), values.data()));
}
void TiffOutput::set(std::uint32_t tag, const std::vector<std::uint16_t>& values) {
    check(TIFFSetField(tiff_.get(), tag, static_cast<int>(values.size()), values.data()));
}

void TiffOutput::write_strip(std::uint32_t strip, std::string_view bytes) {
    std::string copy(bytes); // libtiff may change its input
    check(TIFFWriteEncodedStrip(tiff_.get(), strip, copy.data(), static_cast<tmsize_t>(copy.size())) >= 0);
}

std::string TiffOutput::packed_tile(std::string_view bytes) {
    std::string copy(bytes); // libtiff may change its input
    check(TIFFWriteEncodedTile(tiff_.get(), 0, copy.data(), static_cast<tmsize_t>(copy.size())) >= 0 &&
          TIFFFlushData(tiff_.get()) != 0);
    return sink_->bytes.substr(TIFFGetStrileOffset(tiff_.get(), 0), TIFFGetStrileByteCount(tiff_.get(), 0));
}

std::string TiffOutput::close() {
    check(TIFFWriteDirectory(tiff_.get()) == 1);
    tiff_.reset(); // flushes
    check(sink_->trouble.empty());
    return std::move(sink_->bytes);
}

} // namespace scanshade::rasters
