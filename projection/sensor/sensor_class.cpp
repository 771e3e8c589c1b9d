#include "projection/sensor/sensor_class.h"

namespace scanshade {

std::string_view name_of(SensorClass sensor) {
    switch (sensor) {
    case SensorClass::clean:
        return "clean";
    case SensorClass::structured_light:
        return "structured light";
    case SensorClass::time_of_flight:
        return "time of flight";
    case SensorClass::interpolated:
        return "interpolated";
    }
    return "";
}

SensorClass class_of(const DepthNoise& noise) {
    if (noise.at(2) < 0.001)
        return noise.jumps == Jumps::smeared ? SensorClass::interpolated : SensorClass::clean;
    constexpr double windows_px = 2, resized_px = 5.5; // correlation lengths from which on there must be windows
    if (noise.step_per_z2 > 0)
        return SensorClass::structured_light;
    if (noise.correlation_px >= resized_px)
        return SensorClass::interpolated;
    const bool grows = noise.at(4) > 7 * noise.at(1);
    return grows && noise.correlation_px >= windows_px ? SensorClass::structured_light : SensorClass::time_of_flight;
}

} // namespace scanshade
