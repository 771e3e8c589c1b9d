// What a bench measured, as plain data: cells of configuration x capture, their sums, and the files made of them.
#pragma once

#include "apps/budget/front.h"
#include "apps/budget/trial.h"
#include "apps/compare/error_classes.h"

#include <array>
#include <limits>
#include <string>
#include <vector>

namespace scanshade {

/// The ways to classify errors, in the order of Measured::errors.
enum ErrorBy : std::size_t { place, edge_distance, grazing_angle, range, error_by_count };
[[nodiscard]] std::string_view name_of(ErrorBy by);

/// Errors with the tone curve that is best for the other captures of the sensor class: how good a curve is on views it
/// was not fitted to. NaN where there is no other capture.
struct HeldOut {
    ToneCurve curve; ///< of one capture
    double rms = std::numeric_limits<double>::quiet_NaN(), bias = rms;
    std::vector<double> rms_by_place = {}; ///< in the order of Place; empty where not known
};

/// Pairs with truth on one capture, by place.
using PlacePairs = std::array<PairSums, place_count>;

/// One configuration on one capture, or on many.
struct Measured {
    Configuration configuration;
    std::string settings; ///< every setting as used, "radius=0.5 quality=high ..."
    std::vector<Difference> images;
    PairSums pairs;
    std::array<ErrorByClass, error_by_count> errors;
    std::vector<double> device_ms, wall_ms; ///< of each frame in each round
    std::vector<double> ns_per_pixel;       ///< the same of the device, per pixel of the image
    std::vector<PlacePairs> places;         ///< of each capture
    HeldOut held_out;                       ///< set by grouped()
    std::string picture;                    ///< below the report's folder, of the first frame; empty = none was made
    std::string why;                        ///< what failed; empty = nothing

    Difference sum; ///< of the images, after sum_up(): the best tone curve takes a solver

    void add(const Measured& other);
    void sum_up() { sum = total(images, pairs); }
    [[nodiscard]] const Difference& difference() const { return sum; }
};

/// One capture and the results of every configuration on it.
struct BenchCapture {
    std::string name, path, reference, noise;
    SensorClass sensor = SensorClass::clean;
    double radius_m = 0;
    std::vector<std::string> frames;
    cv::Size size;
    std::vector<Measured> measured;      ///< in the order of the configurations
    cv::Mat1f truth;                     ///< of the first frame
    std::string picture;                 ///< of it, as Measured::picture
    std::vector<cv::Mat1f> visibilities; ///< of the first frame by each configuration; empty where it failed
};

/// All captures of one sensor class.
struct BenchGroup {
    SensorClass sensor = SensorClass::clean;
    std::vector<const BenchCapture*> captures;
    std::vector<Measured> measured;
    std::vector<bool> on_front; ///< the Pareto front of median device time and total RMSE
};

struct BenchReport {
    std::string command, device, driver, version, date;
    int rounds = 0;
    unsigned processors = 0;
    std::vector<BenchCapture> captures;
    std::vector<BenchGroup> groups; ///< grouped(*this), made once the captures are complete; points into them
};

/// Sets `held_out` of the captures' rows, too.
[[nodiscard]] std::vector<BenchGroup> grouped(BenchReport& report);

/// NaN without values.
[[nodiscard]] double least(const std::vector<double>& values);

/// Median device time per pixel and total error; NaN where the configuration failed on a capture.
[[nodiscard]] BenchmarkPoint benchmark_point(const Measured& measured);

/// One aligned table per group, for people.
[[nodiscard]] std::string bench_table(const BenchReport& report);
/// One row per capture and configuration, and per group ("all").
[[nodiscard]] std::string bench_csv(const BenchReport& report);
[[nodiscard]] json bench_json(const BenchReport& report);
/// The whole report as one self-contained page.
[[nodiscard]] std::string bench_page(const BenchReport& report);
/// Speed against error of one sensor class, as a picture (SVG).
[[nodiscard]] std::string bench_plot(const BenchGroup& group);
/// The Pareto fronts of all groups.
[[nodiscard]] ParetoFront front_of(const BenchReport& report);

} // namespace scanshade
