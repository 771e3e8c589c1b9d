// The errors of each method on each class of sensor: tables fitted to generated scenes (ao/expected_errors.txt).
#pragma once

#include "ao/base/method.h"
#include "projection/sensor/sensor_class.h"
#include "shaders/shared/expected_error.h"

#include <istream>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace scanshade {

/// Names and values of settings that differ from a method's defaults.
using ChosenSettings = std::vector<std::pair<std::string, std::string>>;

/// A method with some settings: its squared error is 2^factor times that of its defaults.
struct ErrorVariant {
    ChosenSettings settings;
    float factor = 0;
};

/// Of one method on one class of sensors.
struct MethodErrors {
    shared::ErrorTable table{};
    float together = 0; ///< factor of frames of a recording computed together (--sequence)
    float spread = 0;   ///< nine of ten frames of scenes not fitted to err by at most so many times what is expected
    std::vector<ErrorVariant> variants;
};

struct ErrorTables {
    std::string made_by; ///< the command
    std::map<std::pair<std::string, SensorClass>, MethodErrors> methods;
};

/// Lines of text: "made_by COMMAND", "table METHOD CLASS number ...", "variant METHOD CLASS factor name=value,...",
/// "together METHOD CLASS factor", "spread METHOD CLASS times". CLASS has _ for spaces. Throws Error naming `origin`
/// and the line.
[[nodiscard]] ErrorTables error_tables_from(std::istream& text, const std::string& origin);
[[nodiscard]] std::string text_of(const ErrorTables& tables);

/// Those the program was built with.
[[nodiscard]] const ErrorTables& shipped_error_tables();

/// What to expect of a method with these settings, on depth with that noise: of the variants of which all settings
/// match, the one with most. A method or class without a table gets that of the default method, or of the class that
/// errs most. `together`: from 0, by itself, to 1, with as many frames of the recording as the tables were made with.
[[nodiscard]] shared::ErrorTable errors_of(const ErrorTables& tables, const std::string& method,
                                           const ChosenSettings& settings, SensorClass sensor, double together);

/// A table of squared errors 2^factor times as large.
[[nodiscard]] shared::ErrorTable scaled(shared::ErrorTable table, float factor);

/// How many times what is expected a frame errs by at most, with a chance of nine in ten. The largest of the class, or
/// of all, where this method has none.
[[nodiscard]] double spread_of(const ErrorTables& tables, const std::string& method, SensorClass sensor);

} // namespace scanshade
