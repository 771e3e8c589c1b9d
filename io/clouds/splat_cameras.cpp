#include "io/clouds/splat_cameras.h"

#include "io/files.h"
#include "io/shallow_json.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <cmath>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

double number_in(const nlohmann::json& row, const char* key) {
    const auto found = row.find(key);
    if (found == row.end() || !found->is_number())
        throw Error(
            fmt::format("\"{}\" is {}, expected a number", key, found == row.end() ? "missing" : found->dump()));
    return found->get<double>();
}

FoundFrame camera_in(const nlohmann::json& row) {
    FoundFrame frame;
    const double width = number_in(row, "width"), height = number_in(row, "height");
    frame.camera.fx = number_in(row, "fx");
    frame.camera.fy = number_in(row, "fy");
    constexpr double largest = 1 << 20;
    if (!(width >= 1 && height >= 1 && width <= largest && height <= largest && frame.camera.fx > 0 &&
          frame.camera.fy > 0))
        throw Error(fmt::format("{}x{} pixels with focal lengths of {} and {}", width, height, frame.camera.fx,
                                frame.camera.fy));
    frame.camera.size = {static_cast<int>(width), static_cast<int>(height)};
    frame.camera.cx = (width - 1) / 2;
    frame.camera.cy = (height - 1) / 2;
    Eigen::Matrix3d rotation;
    Eigen::Vector3d position;
    const nlohmann::json &rows = row.at("rotation"), &at = row.at("position");
    if (rows.size() != 3 || at.size() != 3)
        throw Error("\"rotation\" has three rows and \"position\" three numbers");
    for (int i = 0; i < 3; ++i) {
        const auto k = static_cast<std::size_t>(i);
        position[i] = at.at(k).get<double>();
        for (int j = 0; j < 3; ++j)
            rotation(i, j) = rows.at(k).at(static_cast<std::size_t>(j)).get<double>();
    }
    constexpr double rounding = 0.01;
    if (!((rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).norm() <= rounding &&
          rotation.determinant() > 0 && position.allFinite()))
        throw Error("\"rotation\" is no rotation, or \"position\" no place");
    frame.world_from_camera.linear() = rotation;
    frame.world_from_camera.translation() = position;
    return frame;
}

/// What the JSON library throws becomes an Error.
template <class Read>
auto in_our_words(const Read& read) {
    try {
        return read();
    } catch (const nlohmann::json::exception& wrong) {
        throw Error(json_problem(wrong.id, wrong.what()));
    }
}

std::vector<FoundFrame> cameras_in(const fs::path& file) {
    const std::string bytes = read_bytes(file);
    const auto all = in_our_words([&] { return shallow_json<nlohmann::json>(bytes); });
    if (!all.is_array())
        throw Error("no list of cameras");
    std::vector<FoundFrame> cameras;
    for (std::size_t i = 0; i < all.size(); ++i)
        cameras.push_back(
            during(fmt::format("camera {}", i), [&] { return in_our_words([&] { return camera_in(all[i]); }); }));
    return cameras;
}

} // namespace

std::vector<FoundFrame> splat_cameras(const fs::path& splats, std::vector<std::string>& warnings) {
    constexpr int folders = 4;
    std::error_code ignored;
    fs::path folder = fs::absolute(splats, ignored).parent_path();
    for (int i = 0; i < folders; ++i, folder = folder.parent_path()) {
        const fs::path file = folder / "cameras.json";
        if (!is_file(file))
            continue;
        try {
            return cameras_in(file);
        } catch (const Outage&) {
            throw;
        } catch (const Error& wrong) {
            warnings.push_back(
                fmt::format("{}: {}: its cameras do not decide the sides of splats.", file.string(), wrong.what()));
        }
        break;
    }
    return {};
}

} // namespace scanshade
