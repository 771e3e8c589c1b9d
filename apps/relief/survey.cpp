#include "apps/relief/survey.h"

#include "apps/relief/gridding.h"
#include "apps/relief/ground_filter.h"
#include "io/clouds/cloud_file.h"
#include "io/clouds/cloud_records.h"
#include "io/clouds/point_classes.h"
#include "io/rasters/las_crs.h"
#include "projection/base/error.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <opencv2/core.hpp>

namespace scanshade::relief {

namespace fs = std::filesystem;

namespace {

constexpr std::uint8_t ground = 2, key_point = 8, water = 9, road = 11;

bool is_ground(std::uint8_t kind) { return kind == ground || kind == key_point || kind == water || kind == road; }

/// Coordinates of the globe, in steps that only degrees need, and heights of another unit than x and y.
bool probably_degrees(const Cloud& cloud, double step) {
    constexpr double finest_m = 2e-6;
    Eigen::AlignedBox3d box;
    for (const Eigen::Vector3d& point : cloud.points)
        if (point.allFinite())
            box.extend(point);
    if (box.isEmpty() || step == 0 || step > finest_m)
        return false;
    return box.min().x() >= -360 && box.max().x() <= 360 && box.min().y() >= -90 && box.max().y() <= 90 &&
           box.sizes().z() > box.sizes().head<2>().maxCoeff();
}

Taken unclassified_ground(const SurveyPoints& survey, std::vector<std::string>& notes) {
    constexpr double window_m = 20, least_cell_m = 1;
    const double unit = survey.crs.unit_m, height_unit = survey.crs.height_unit_m;
    const Cells cells = cells_of(extent_of(survey.points), survey.step, least_cell_m / unit);
    cv::Mat1f lowest(cells.size, std::nanf(""));
    int row = 0, column = 0;
    for (const Eigen::Vector3d& point : survey.points)
        if (cells.find(point, row, column)) {
            float& z = lowest(row, column);
            z = std::isnan(z) ? static_cast<float>(point.z() * height_unit)
                              : std::min(z, static_cast<float>(point.z() * height_unit));
        }
    const cv::Mat1f surface = opened_ground(lowest, least_cell_m, window_m);
    Taken taken(survey.points.size());
    for (std::size_t i = 0; i < survey.points.size(); ++i)
        if (cells.find(survey.points[i], row, column)) {
            const double above = survey.points[i].z() * height_unit - surface(row, column);
            taken[i] = above >= -false_depth_m() && above <= ground_tolerance_m();
        }
    notes.push_back(
        fmt::format("No point is classified as ground: a progressive morphological filter with windows of up to {} "
                    "m decides, which is less certain.",
                    window_m));
    return taken;
}

} // namespace

void add_file(SurveyPoints& survey, const fs::path& file) {
    const Cloud cloud = read_cloud(file, survey.warnings);
    const std::string_view header = cloud.records ? std::string_view(cloud.records->header) : std::string_view();
    rasters::Crs crs;
    if (header.starts_with("LASF")) {
        crs = during(file.string(), [&] { return rasters::crs_of_las(header); });
        survey.step = std::max({survey.step, std::abs(cloud.records->scale[0]), std::abs(cloud.records->scale[1])});
    }
    if (crs.geographic || (!crs.known && probably_degrees(cloud, survey.step)))
        throw Error(file.string() +
                    ": coordinates are degrees, in which slopes mean nothing; project them first, such as "
                    "by PDAL's filters.reprojection");
    if (survey.files.empty())
        survey.crs = crs;
    else if (crs.epsg != survey.crs.epsg || crs.unit_m != survey.crs.unit_m ||
             crs.height_unit_m != survey.crs.height_unit_m)
        throw Error(
            fmt::format("{}: its coordinate system (EPSG {}, units of {} m, heights of {} m) is not that of the "
                        "files before (EPSG {}, {} m, {} m)",
                        file.string(), crs.epsg, crs.unit_m, crs.height_unit_m, survey.crs.epsg, survey.crs.unit_m,
                        survey.crs.height_unit_m));
    std::vector<std::uint8_t> classes = classes_of(cloud, file);
    classes.resize(cloud.points.size());
    survey.ground_classified = survey.ground_classified || std::ranges::find(classes, ground) != classes.end();
    survey.points.insert(survey.points.end(), cloud.points.begin(), cloud.points.end());
    survey.classes.insert(survey.classes.end(), classes.begin(), classes.end());
    survey.extensions.push_back(cloud.records ? extension(*cloud.records) : ".ply");
    survey.files.push_back(file), survey.ends.push_back(survey.points.size());
}

SurveyPoints read_survey(const std::vector<fs::path>& files) {
    SurveyPoints survey;
    for (const fs::path& file : files)
        add_file(survey, file);
    finish_notes(survey);
    return survey;
}

void finish_notes(SurveyPoints& survey) {
    survey.notes.insert(survey.notes.end(), survey.crs.notes.begin(), survey.crs.notes.end());
    if (!survey.crs.known)
        survey.notes.push_back("The points name no coordinate system: metres are assumed.");
}

std::string unclassified_note(const fs::path& file) {
    return fmt::format("No point of {} is classified as ground, while those of other files are: its cells stay empty. "
                       "Classify it, too, or choose another --surface.",
                       file.string());
}

Taken points_taken(const SurveyPoints& survey, Surface surface, std::vector<std::string>& notes) {
    if (surface == Surface::ground && !survey.ground_classified)
        return unclassified_ground(survey, notes);
    Taken taken(survey.points.size());
    for (std::size_t i = 0; i < taken.size(); ++i)
        taken[i] = survey.points[i].allFinite() && (surface != Surface::ground || is_ground(survey.classes[i]));
    for (std::size_t i = 0, begin = 0; i < survey.files.size(); begin = survey.ends[i++]) {
        const auto first = taken.begin() + static_cast<std::ptrdiff_t>(begin),
                   last = taken.begin() + static_cast<std::ptrdiff_t>(survey.ends[i]);
        if (first != last && std::find(first, last, true) == last)
            notes.push_back(unclassified_note(survey.files[i]));
    }
    return taken;
}

} // namespace scanshade::relief
