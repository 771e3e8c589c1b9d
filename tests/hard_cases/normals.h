// How true normals and edges of prepared depth are: what the methods look at, against the generated scenes' exact
// geometry.
#pragma once

#include "ao/gpu/device.h"

namespace scanshade::hard_cases {

/// Prints a table: a row per simulated sensor and width of the plane fits' windows, over two 640x480 views of each
/// scene.
/// - median and 95th percentile of the angle between normal and truth, over pixels that have one, and over those at 1
/// .. 3 m;
/// - edges kept: of the pixels beside a jump of true depth by 10 cm and 5 % or more, those within a pixel of an edge
///   (error_classes.h) of the depth that the methods look at; what borders on holes is left out.
/// Returns what misses its aim, a line each: median at 1 .. 3 m above 1 degree (ideal) or 5 (with the windows of
/// CACAO, what `run` does by itself; methods that know the noise are better off with narrower ones).
[[nodiscard]] std::string print_normals(gpu::Device& device);

} // namespace scanshade::hard_cases
