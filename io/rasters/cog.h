// Cloud-optimized GeoTIFFs: where directories and tiles lie in the file.
#pragma once

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <string>
#include <string_view>
#include <tiffio.h>
#include <vector>

namespace scanshade::rasters {

/// A tag of a directory. Its values are bytes in this machine's order.
struct TiffTag {
    std::uint16_t id = 0;
    TIFFDataType type = TIFF_SHORT;
    std::uint64_t count = 0;
    std::string bytes;
};
[[nodiscard]] TiffTag short_tag(std::uint16_t id, const std::vector<std::uint16_t>& values);
[[nodiscard]] TiffTag long_tag(std::uint16_t id, std::uint32_t value);
[[nodiscard]] TiffTag double_tag(std::uint16_t id, const std::vector<double>& values);
[[nodiscard]] TiffTag text_tag(std::uint16_t id, const std::string& text);

/// Bytes that wait for their place, in a file without a name. Throws std::system_error where the disk is full.
class Spool {
  public:
    struct Part {
        std::uint64_t at = 0, size = 0;
    };
    explicit Spool(const std::filesystem::path& folder);
    ~Spool();
    Spool(const Spool&) = delete;
    Spool& operator=(const Spool&) = delete;
    Part add(std::string_view bytes);
    [[nodiscard]] std::string bytes(const Part& part) const;

  private:
    int file_;
    std::uint64_t end_ = 0;
};

/// One image of the file: the full one, or an overview.
struct CogImage {
    std::vector<TiffTag> tags; ///< but for the places of tiles
    std::vector<Spool::Part> tiles;
};

/// Header, directories from the full image to the smallest overview, tiles of the smallest to those of the full image.
/// BigTIFF where `big`, and where 32 bits are too few. Throws std::system_error where the disk is full.
void write_cog(const std::filesystem::path& file, std::vector<CogImage> images, const Spool& spool, bool big);

} // namespace scanshade::rasters
