#include "apps/compare/error_figures.h"

#include <array>
#include <cmath>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace scanshade {
namespace {

/// One number: its name in files, its head in tables.
struct Figure {
    std::string_view name, head;
    double (*of)(const Difference&);
    int digits;
};

constexpr std::array figures{
    Figure{"mae", "MAE", [](const Difference& d) { return d.mae; }, 4},
    Figure{"rms", "RMSE", [](const Difference& d) { return d.rms; }, 4},
    Figure{"bias", "bias", [](const Difference& d) { return d.bias; }, 4},
    Figure{"percentile_95", "95 %", [](const Difference& d) { return d.percentile_95; }, 4},
    Figure{"worst", "worst", [](const Difference& d) { return d.worst; }, 4},
    Figure{"ssim", "SSIM", [](const Difference& d) { return d.ssim; }, 4},
    Figure{"correlation", "corr.", [](const Difference& d) { return d.correlation; }, 4},
    Figure{"calibrated_rms", "calib.", [](const Difference& d) { return d.calibrated_rms; }, 4},
    Figure{"strength", "strength", [](const Difference& d) { return d.curve.strength; }, 3},
    Figure{"power", "power", [](const Difference& d) { return d.curve.power; }, 3},
};

std::string cell(double value, int digits) { return std::isnan(value) ? "-" : fmt::format("{:.{}f}", value, digits); }

} // namespace

std::string figure_heads() {
    std::string line;
    for (const Figure& figure : figures)
        line += fmt::format("{:>9}", figure.head);
    return line + fmt::format("{:>10}{:>8}{:>8}", "pixels", "only A", "only B");
}

std::string figure_cells(const Difference& d) {
    std::string line;
    for (const Figure& figure : figures)
        line += fmt::format("{:>9}", cell(figure.of(d), figure.digits));
    return line + fmt::format("{:>10}{:>8}{:>8}", d.pixels, d.only_a, d.only_b);
}

std::string figure_csv_heads() {
    std::string line = "pixels,only_a,only_b";
    for (const Figure& figure : figures)
        line += fmt::format(",{}", figure.name);
    return line;
}

std::string figure_csv(const Difference& d) {
    std::string line = fmt::format("{},{},{}", d.pixels, d.only_a, d.only_b);
    for (const Figure& figure : figures)
        line += std::isnan(figure.of(d)) ? "," : fmt::format(",{:.6f}", figure.of(d));
    return line;
}

json to_json(const Difference& d) {
    json text{{"pixels", d.pixels}, {"only_a", d.only_a}, {"only_b", d.only_b}};
    for (const Figure& figure : figures) {
        const double value = figure.of(d);
        text[std::string(figure.name)] = std::isfinite(value) ? json(std::round(value * 1e6) / 1e6) : json();
    }
    return text;
}

} // namespace scanshade
