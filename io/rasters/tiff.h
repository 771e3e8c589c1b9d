// libtiff for files of maps: any part of a file is read when it is asked for; errors become ours.
#pragma once

#include "io/file_bytes.h"

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <tiffio.h>
#include <vector>

namespace scanshade::rasters {

/// Private tags: of GeoTIFF (OGC 19-008), and of GDAL.
enum GeoTag : std::uint32_t {
    tag_scale = 33550,
    tag_tiepoints = 33922,
    tag_transformation = 34264,
    tag_keys = 34735,
    tag_key_doubles = 34736,
    tag_key_ascii = 34737,
    tag_metadata = TIFFTAG_GDAL_METADATA,
    tag_nodata = TIFFTAG_GDAL_NODATA,
};

/// A TIFF to be read.
class TiffInput {
  public:
    explicit TiffInput(const std::filesystem::path& file);
    TiffInput(const TiffInput&) = delete;
    TiffInput& operator=(const TiffInput&) = delete;

    [[nodiscard]] TIFF* get() const { return tiff_.get(); }
    /// Goes on to the next image of the file; false where there is none.
    bool next_directory();
    [[nodiscard]] const std::filesystem::path& file() const { return bytes_.path(); }
    [[noreturn]] void refuse(const std::string& why) const;
    /// With libtiff's own words.
    [[noreturn]] void fail() const;

    /// A number of the current directory, or TIFF's default, or `otherwise`.
    [[nodiscard]] std::uint32_t number(std::uint32_t tag, std::uint32_t otherwise) const;
    [[nodiscard]] std::uint16_t short_number(std::uint32_t tag, std::uint16_t otherwise) const;
    /// Private tags; empty where there is none of this type.
    [[nodiscard]] std::vector<double> doubles(std::uint32_t tag) const;
    [[nodiscard]] std::vector<std::uint16_t> shorts(std::uint32_t tag) const;
    [[nodiscard]] std::string ascii(std::uint32_t tag) const;

  private:
    struct Source;
    template <class Value>
    std::vector<Value> values(std::uint32_t tag, TIFFDataType type) const;

    FileBytes bytes_;
    std::unique_ptr<Source> source_;
    std::unique_ptr<TIFF, decltype(&TIFFClose)> tiff_;

  public:
    ~TiffInput();
};

/// A TIFF that is made in memory.
class TiffOutput {
  public:
    explicit TiffOutput(bool big = false);
    ~TiffOutput();
    TiffOutput(const TiffOutput&) = delete;
    TiffOutput& operator=(const TiffOutput&) = delete;

    void set(std::uint32_t tag, int value);
    void set(std::uint32_t tag, const std::string& text);
    void set(std::uint32_t tag, const std::vector<double>& values);
    void set(std::uint32_t tag, const std::vector<std::uint16_t>& values);
    void write_strip(std::uint32_t strip, std::string_view bytes);
    /// Tile 0 as the file has it: compressed.
    [[nodiscard]] std::string packed_tile(std::string_view bytes);
    /// The file.
    [[nodiscard]] std::string close();

  private:
    struct Sink;
    void check(bool done) const;

    std::unique_ptr<Sink> sink_;
    std::unique_ptr<TIFF, decltype(&TIFFClose)> tiff_;
};

} // namespace scanshade::rasters
