// Heights between points, linear in the triangles of Delaunay.
#pragma once

#include <opencv2/core.hpp>
#include <vector>

namespace scanshade::relief {

/// At most one in a cell. x and y in cells from the raster's north-west corner, to the east and to the south.
struct Vertex {
    double x = 0, y = 0, z = 0;
    int cell = 0;    ///< row by row
    float error = 0; ///< of z, one draw
};

/// At the centres of all cells; NaN outside the triangles. `errors`: those of the heights, where it is not null.
[[nodiscard]] cv::Mat1f heights_at_centres(const std::vector<Vertex>& vertices, cv::Size size,
                                           cv::Mat1f* errors = nullptr);

} // namespace scanshade::relief
