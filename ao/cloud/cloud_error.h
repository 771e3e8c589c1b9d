// The error to expect of a point's visibility, from what its surroundings show: tables fitted to generated scenes
// (ao/cloud/expected_errors.txt).
#pragma once

#include "projection/sensor/expected_error.h"

#include <array>
#include <cstdint>
#include <istream>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace scanshade {

/// What tells of the error of a point.
struct CloudErrorSigns {
    static constexpr float recorded = 2; ///< as `side`: above all that is found out

    float visibility = 0;
    float flatness = 0;    ///< CloudSurface::flatness
    float span = 0;        ///< radius / radius of the point's disc; 0 for a lonely point
    float rough = 0;       ///< CloudSurface::roughness / radius
    float side = recorded; ///< how sure its side is, 0 .. 1; 0 = unknown
    /// RMS error that the check on a part expects of its surroundings; NaN = nothing was checked.
    float repeat = std::numeric_limits<float>::quiet_NaN();
    float back = 0; ///< BackShare::near, 0 where no noise was found; with back_of_lines()
};

/// What the check needs of a point's signs, in two bytes.
struct KeptSigns {
    std::uint8_t side = 0, back = 0;
};
[[nodiscard]] KeptSigns kept(const CloudErrorSigns& signs);

/// The squared error is the sum of three: of a point whose side is right, of one whose side may be wrong, and of layers
/// that noise has left, which is the squared share of backs times 0.7^2.
///
/// The first two are products, whose factors' binary logarithms are interpolated between knots. Knots lie at
/// - visibility 0, 0.31, 0.56, 0.75, 0.89, 0.97, 1: evenly in 1 - sqrt(1 - visibility), as those of depth images do
/// - sureness of the side at the same places, 0 .. 1
/// - repeated errors of 0, 1/64, 3/64, 7/64, 15/64, 31/64
/// - spans of 1, 2, 4 ... 64 discs
/// - surface variations, as roots, of 0, 1/30, 3/30 ... 31/30
/// - roughness / radius of 0, 1/64, 3/64, 7/64, 15/64
struct CloudErrorTables {
    static constexpr int values = 7, sides = 7, repeats = 6, spans = 7, folds = 6, roughs = 5;
    static constexpr int surroundings = spans + folds + roughs;

    std::string made_by; ///< the command
    /// Visibility (which varies fastest) times the repeated error; then spans, folds and roughness.
    std::array<float, values * repeats + surroundings> checked{};
    /// Visibility times spans; then folds and roughness.
    std::array<float, values * spans + folds + roughs> unchecked{};
    /// Visibility times the sureness of the side: what a side that may be wrong adds.
    std::array<float, values * sides> turned{};
};

[[nodiscard]] ErrorWeights checked_weights(const CloudErrorSigns& signs);
[[nodiscard]] ErrorWeights unchecked_weights(const CloudErrorSigns& signs);
[[nodiscard]] ErrorWeights turned_weights(const CloudErrorSigns& signs);

/// What layers add to the square.
[[nodiscard]] float layers_square(float back);
/// The share of backs that adds as much to the square as do lines of points, as the rings of a spinning lidar, between
/// which things are not seen. `share`: of the points, share_on_lines().
[[nodiscard]] float back_of_lines(double share);

/// RMS of visibility, 0 .. 1.
[[nodiscard]] float expected_error(const CloudErrorSigns& signs, const CloudErrorTables& tables);

/// The same in two steps, since the check comes last. The first one: what spans, folds and roughness say.
[[nodiscard]] float factor_of_surroundings(const CloudErrorSigns& signs, const CloudErrorTables& tables);
[[nodiscard]] float checked_error(float factor_of_surroundings, const CloudErrorSigns& signs,
                                  const CloudErrorTables& tables);

/// A side's sureness as it comes back from its byte.
[[nodiscard]] float side_of(std::uint8_t byte);

/// Lines of text: "made_by COMMAND", "checked number ...", "unchecked ...", "turned ...". Throws Error naming `origin`
/// and the line, or the table that is missing.
[[nodiscard]] CloudErrorTables cloud_error_tables_from(std::istream& text, const std::string& origin);
[[nodiscard]] std::string text_of(const CloudErrorTables& tables);

/// Those the program was built with.
[[nodiscard]] const CloudErrorTables& shipped_cloud_errors();
/// checked_error() with these tables.
[[nodiscard]] float error_once_checked(float factor_of_surroundings, float visibility, const KeptSigns& kept,
                                       float repeat);

/// The RMS of errors; those that are NaN do not count.
class ErrorSum {
  public:
    void add(float error);
    [[nodiscard]] std::optional<double> rms() const; ///< nothing without errors

  private:
    double squares_ = 0;
    std::size_t count_ = 0;
};

} // namespace scanshade
