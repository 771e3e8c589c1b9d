// Which kind of sensor measured a depth, told by its noise.
#pragma once

#include "projection/sensor/noise.h"

#include <string_view>

namespace scanshade {

/// Errors differ more between these classes than between methods. Structured light stands for all that measures
/// disparity, stereo too. Interpolated: resized or smoothed, as phones' depth is.
enum class SensorClass { clean, structured_light, time_of_flight, interpolated };
[[nodiscard]] std::string_view name_of(SensorClass sensor);
/// Clean where sigma at 2 m is below 1 mm and depth jumps sharply, interpolated where such depth jumps over several
/// pixels. Disparity comes in steps that grow with the square of the distance. Where files hide them, its noise tells:
/// it grows more than 7 times from 1 to 4 m (Kinects 8 to 13 times), and neighbours share windows (3 to 5 pixels).
/// Interpolated depth has longer correlations, 6 to 8 pixels. Time of flight has none, and a floor.
[[nodiscard]] SensorClass class_of(const DepthNoise& noise);

} // namespace scanshade
