// The coordinate system of a LAS file, from its records.
#pragma once

#include "io/rasters/crs.h"

namespace scanshade::rasters {

/// `header` is a LAS or LAZ file up to its points. Text counts if the global encoding says so, or where there are no
/// keys. Not known where the file has neither. Throws Error as crs_of_keys() and crs_of_text() do.
[[nodiscard]] Crs crs_of_las(std::string_view header);

} // namespace scanshade::rasters
