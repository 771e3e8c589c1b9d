#include "apps/relief/points.h"

#include "io/clouds/cloud_file.h"
#include "projection/base/error.h"

#include <algorithm>
#include <fmt/format.h>

namespace scanshade::relief {

namespace fs = std::filesystem;

namespace {

/// As the rest of scanshade names it in clouds; no dashes, which PLY's readers do not expect.
std::string field_name(const std::string& map) {
    std::string name = map == "ao" ? "ambient_occlusion" : map;
    std::ranges::replace(name, '-', '_');
    return name;
}

float value_in(const NamedMap& map, int cell) {
    if (cell < 0)
        return std::nanf("");
    return map.values.depth() == CV_32F ? map.values.at<float>(cell / map.values.cols, cell % map.values.cols)
                                        : map.values.at<std::uint8_t>(cell / map.values.cols, cell % map.values.cols);
}

} // namespace

std::vector<fs::path> point_files(const SurveyPoints& survey, const fs::path& folder) {
    std::vector<fs::path> files;
    for (std::size_t i = 0; i < survey.files.size(); ++i)
        files.push_back(folder / (survey.files[i].stem().string() + "_POINTS" + survey.extensions[i]));
    return files;
}

void write_points(const SurveyPoints& survey, const std::vector<int>& cells, const Maps& maps,
                  const std::vector<fs::path>& files) {
    for (std::size_t i = 0; i < files.size(); ++i) {
        const std::size_t begin = i == 0 ? 0 : survey.ends[i - 1], count = survey.ends[i] - begin;
        std::vector<std::string> told_before;
        const Cloud cloud = read_cloud(survey.files[i], told_before);
        if (cloud.points.size() != count)
            throw Error(fmt::format("{}: {} points, but {} when it was read first", survey.files[i].string(),
                                    cloud.points.size(), count));
        std::vector<std::vector<float>> values;
        std::vector<AddedField> fields;
        for (const NamedMap& map : maps) {
            std::vector<float>& own = values.emplace_back(count);
            std::transform(cells.begin() + static_cast<std::ptrdiff_t>(begin),
                           cells.begin() + static_cast<std::ptrdiff_t>(begin + count), own.begin(),
                           [&](int cell) { return value_in(map, cell); });
        }
        for (std::size_t m = 0; m < maps.size(); ++m)
            fields.push_back({field_name(maps[m].name), values[m]});
        write_cloud(files[i], cloud, fields);
    }
}

} // namespace scanshade::relief
