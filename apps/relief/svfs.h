// Sky view of the halves of the sky, in one zip, as SOLWEIG and UMEP read it.
#pragma once

#include "ao/horizon/horizon.h"
#include "io/rasters/raster.h"

#include <array>
#include <filesystem>
#include <memory>
#include <string>

namespace scanshade::relief {

/// A view of the zip: of the horizontal definition, of the directions towards one side.
struct SvfsView {
    std::string name; ///< "svfN"
    horizon::Sky sky = horizon::Sky::whole;
};
[[nodiscard]] const std::array<SvfsView, 5>& svfs_views();

/// "svfs.zip": a GeoTIFF for each view, by rows; and views of vegetation, all open, which older readers expect.
class SvfsZip {
  public:
    /// Throws Error where the views would not fit into a zip.
    SvfsZip(std::filesystem::path zip, cv::Size size, const rasters::Grid& grid, const rasters::RasterText& text);
    ~SvfsZip();
    SvfsZip(const SvfsZip&) = delete;
    SvfsZip& operator=(const SvfsZip&) = delete;
    /// The next rows of a view.
    void write(std::size_t view, const cv::Mat& rows);
    /// All rows are there: the file appears.
    void finish();

  private:
    struct Parts;
    std::unique_ptr<Parts> parts_;
};

} // namespace scanshade::relief
