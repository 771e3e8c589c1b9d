// What a bench measured, as plain data: cells of configuration x capture, their sums, and the files made of them.
#pragma once

#include "apps/measure/error_classes.h"
#include "apps/measure/front.h"
#include "apps/measure/trial.h"

#include <string>
#include <vector>

namespace scanshade {

/// The classifications by which errors are told apart, in the order of Measured::errors.
enum ErrorBy : std::size_t { edge_distance, grazing_angle, range, error_by_count };
[[nodiscard]] std::string_view name_of(ErrorBy by);

/// One configuration on one capture, or on many.
struct Measured {
    Configuration configuration;
    std::string settings; ///< every setting as used, "radius=0.5 quality=high ..."
    std::vector<Difference> images;
    PairSums pairs;
    std::array<ErrorByClass, error_by_count> errors;
    std::vector<double> device_ms, wall_ms; ///< of each frame in each round
    std::vector<double> ns_per_pixel;       ///< the same of the device, per pixel of the image
    std::string why;                        ///< what failed; empty = nothing

    Difference sum; ///< of the images, once sum_up() was called: the best look takes a solver

    void add(const Measured& other);
    void sum_up() { sum = total(images, pairs); }
    [[nodiscard]] const Difference& difference() const { return sum; }
};

/// One capture and what became of every configuration on it.
struct BenchCapture {
    std::string name, path, reference, noise;
    SensorClass sensor = SensorClass::clean;
    double radius_m = 0;
    std::vector<std::string> frames;
    cv::Size size;
    std::vector<Measured> measured;      ///< in the order of the configurations
    cv::Mat1f truth;                     ///< of the first frame, with
    std::vector<cv::Mat1f> visibilities; ///< each configuration's map of it, empty where it failed
};

/// Captures of one sensor class together: what a user of such a sensor meets.
struct BenchGroup {
    SensorClass sensor = SensorClass::clean;
    std::vector<const BenchCapture*> captures;
    std::vector<Measured> measured;
    std::vector<bool> front; ///< by median device time and total RMSE
};

struct BenchReport {
    std::string command, device, driver, version, date;
    int rounds = 0;
    std::vector<BenchCapture> captures;
    std::vector<BenchGroup> groups; ///< grouped(*this), made once the captures are complete; points into them
};

[[nodiscard]] std::vector<BenchGroup> grouped(const BenchReport& report);

/// NaN without values.
[[nodiscard]] double least(const std::vector<double>& values);

/// Median device time and total error, as fronts price it.
[[nodiscard]] Priced priced(const Measured& measured);

/// One aligned table per group, for people.
[[nodiscard]] std::string bench_table(const BenchReport& report);
/// One row per capture and configuration, and per group ("all").
[[nodiscard]] std::string bench_csv(const BenchReport& report);
[[nodiscard]] json bench_json(const BenchReport& report);
/// The whole report as one self-contained page.
[[nodiscard]] std::string bench_page(const BenchReport& report);
/// Speed against error of one sensor class, as a picture (SVG).
[[nodiscard]] std::string bench_plot(const BenchGroup& group);
/// The fronts of all groups.
[[nodiscard]] Front front_of(const BenchReport& report);

} // namespace scanshade
