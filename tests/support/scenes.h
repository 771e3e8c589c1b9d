// The program's shapes, in the tests' own namespace.
#pragma once

#include "apps/scenes/shapes.h"

namespace scanshade::tests {

using namespace shapes;

[[nodiscard]] inline Pinhole test_camera(cv::Size size = {160, 120}) { return off_centre_camera(size); }

} // namespace scanshade::tests
