#include "apps/cloud_facts.h"

#include "ao/cloud/chosen_points.h"
#include "ao/cloud/surface/cloud_surface.h"
#include "apps/json.h"
#include "io/clouds/cloud_file.h"
#include "io/clouds/cloud_records.h"
#include "io/clouds/point_classes.h"
#include "io/rasters/las_crs.h"
#include "projection/base/error.h"
#include "projection/base/statistics.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <unordered_set>

namespace scanshade {

namespace fs = std::filesystem;
using Eigen::Vector3d;

namespace {

void count(std::map<int, std::size_t>& counts, const std::vector<std::uint8_t>& values) {
    for (const std::uint8_t value : values)
        ++counts[value];
}

/// Points / ground under them: the area of those cells of a grid over the box, of about 16 points each, that have any.
double density_on_ground(const std::vector<Vector3d>& points, const Eigen::AlignedBox3d& box) {
    constexpr double points_a_cell = 16;
    const Eigen::Vector2d sides = box.sizes().head<2>();
    const double side = std::sqrt(points_a_cell * sides.prod() / static_cast<double>(points.size()));
    if (!(side > 0))
        return 0;
    const Eigen::Array2d cells = (sides.array() / side).round().max(1), cell = sides.array() / cells;
    std::unordered_set<std::uint64_t> occupied;
    for (const Vector3d& point : points) {
        const Eigen::Array2d at = ((point - box.min()).head<2>().array() / cell).floor().min(cells - 1);
        occupied.insert(static_cast<std::uint64_t>(at.x()) << 32 | static_cast<std::uint64_t>(at.y()));
    }
    return static_cast<double>(points.size()) / (static_cast<double>(occupied.size()) * cell.prod());
}

/// The unit without its source: "foot (well-known text)" -> "foot".
std::string unit_name(const std::string& unit) { return unit.substr(0, unit.find(" (")); }

std::string system_text(const std::pair<int, std::string>& system) {
    const std::string code = system.first > 0 ? fmt::format("EPSG {}", system.first) : "";
    return code + (code.empty() || system.second.empty() ? "" : ", ") + system.second;
}

std::string shares_text(const std::map<int, std::size_t>& counts, bool as_classes) {
    std::size_t all = 0;
    for (const auto& [value, points] : counts)
        all += points;
    std::string text;
    for (const auto& [value, points] : counts)
        text += fmt::format("{}{}{}: {:.1f} %", text.empty() ? "" : ", ", value,
                            as_classes ? fmt::format(" {}", class_name(static_cast<std::uint8_t>(value))) : "",
                            100 * static_cast<double>(points) / static_cast<double>(all));
    return text;
}

} // namespace

void CloudFacts::add(const Cloud& cloud, const fs::path& file, std::vector<std::string>& warnings) {
    std::vector<Vector3d> points;
    std::ranges::copy_if(cloud.points, std::back_inserter(points), [](const Vector3d& p) { return p.allFinite(); });
    if (points.empty())
        return;
    points_ += points.size();
    add_density(points, z_is_up(cloud));
    count(classes_, classes_of(cloud, file));
    count(returns_, returns_of(cloud, file));
    const std::string unit = unit_of(*cloud.records);
    units_.insert(unit.empty() ? "metres (by convention)" : unit);
    if (cloud.records->header.starts_with("LASF"))
        add_reference(cloud.records->header, file, warnings);
}

void CloudFacts::add_density(const std::vector<Vector3d>& points, bool z_up) {
    Eigen::AlignedBox3d box;
    for (const Vector3d& point : points)
        box.extend(point);
    extent_.extend(box);
    const std::vector<Vector3d> some = sampled(points, finite(points), enough_to_judge);
    const double share = static_cast<double>(some.size()) / static_cast<double>(points.size());
    // Points are on surfaces: a sample's spacing is larger by the root of its share.
    spacings_.push_back(static_cast<double>(spacing_of(LocalCloud(some))) * std::sqrt(share));
    if (z_up)
        densities_.push_back(density_on_ground(points, box));
}

void CloudFacts::add_reference(const std::string& header, const fs::path& file, std::vector<std::string>& warnings) {
    try {
        if (const rasters::Crs crs = during(file.string(), [&] { return rasters::crs_of_las(header); }); crs.known)
            systems_.emplace(crs.epsg, crs.name);
    } catch (const OutOfMemory&) {
        throw;
    } catch (const Error& failure) {
        warnings.push_back(fmt::format("the coordinate system cannot be read: {}.", failure.what()));
    }
}

std::vector<std::pair<std::string, std::string>> CloudFacts::lines() const {
    const std::string unit = units_.size() == 1 ? unit_name(*units_.begin()) : "unit";
    const bool unknown = unit.starts_with("an unknown");
    std::vector<std::pair<std::string, std::string>> lines;
    for (const std::string& each : units_)
        lines.emplace_back("unit", each);
    lines.emplace_back("spacing", fmt::format("{:.3g} (median distance between neighbours)", median(spacings_)));
    if (!densities_.empty())
        lines.emplace_back("density", fmt::format("{:.3g} points a square {} of ground", median(densities_),
                                                  unknown            ? "unit"
                                                  : unit == "metres" ? "metre"
                                                                     : unit));
    for (const auto& system : systems_)
        lines.emplace_back("system", system_text(system));
    if (!classes_.empty())
        lines.emplace_back("classes", shares_text(classes_, true));
    if (!returns_.empty())
        lines.emplace_back("returns", shares_text(returns_, false));
    return lines;
}

json CloudFacts::to_json() const {
    json text{{"points", points_},
              {"min", {extent_.min().x(), extent_.min().y(), extent_.min().z()}},
              {"max", {extent_.max().x(), extent_.max().y(), extent_.max().z()}},
              {"units", units_},
              {"spacing", median(spacings_)},
              {"points_per_square_unit", densities_.empty() ? json() : json(median(densities_))},
              {"systems", json::array()},
              {"classes", json::array()},
              {"returns", json::array()}};
    for (const auto& [epsg, name] : systems_)
        text["systems"].push_back({{"epsg", epsg > 0 ? json(epsg) : json()}, {"name", name}});
    for (const auto& [code, points] : classes_)
        text["classes"].push_back(
            {{"code", code}, {"name", class_name(static_cast<std::uint8_t>(code))}, {"points", points}});
    for (const auto& [number, points] : returns_)
        text["returns"].push_back({{"return", number}, {"points", points}});
    return text;
}

} // namespace scanshade
