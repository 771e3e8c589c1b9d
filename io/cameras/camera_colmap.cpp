// COLMAP's cameras: "CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]" as text or binary, pixel centres at 0.5
// (colmap/sensor/models.h, doc/cameras.rst, doc/format.rst).
#include "io/cameras/camera_formats.h"
#include "io/cameras/colmap_cameras.h"
#include "io/file_bytes.h"
#include "projection/base/error.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <span>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

struct ColmapModel {
    std::string_view name;
    std::size_t numbers;
    Camera (*read)(const std::vector<double>& p); ///< null: a lens that we do not have
};

Camera square(const std::vector<double>& p, Distortion lens) { return {{p[0], p[0], p[1], p[2], {}}, lens, {}}; }
Camera oblong(const std::vector<double>& p, Distortion lens) { return {{p[0], p[1], p[2], p[3], {}}, lens, {}}; }

/// Their places are the models' numbers in binary files.
const ColmapModel colmap_models[] = {
    {"SIMPLE_PINHOLE", 3, [](const auto& p) { return square(p, {}); }},
    {"PINHOLE", 4, [](const auto& p) { return oblong(p, {}); }},
    {"SIMPLE_RADIAL", 4,
     [](const auto& p) {
         return square(p, {p[3], 0, 0, 0, 0});
     }},
    {"RADIAL", 5,
     [](const auto& p) {
         return square(p, {p[3], p[4], 0, 0, 0});
     }},
    {"OPENCV", 8,
     [](const auto& p) {
         return oblong(p, {p[4], p[5], p[6], p[7], 0});
     }},
    {"OPENCV_FISHEYE", 8,
     [](const auto& p) {
         return oblong(p, kannala_brandt({p.begin() + 4, p.end()}));
     }},
    {"FULL_OPENCV", 12,
     [](const auto& p) {
         return oblong(p, brown_conrady({p.begin() + 4, p.end()}));
     }},
    {"FOV", 5, nullptr},
    {"SIMPLE_RADIAL_FISHEYE", 4, nullptr},
    {"RADIAL_FISHEYE", 5, nullptr},
    {"THIN_PRISM_FISHEYE", 12, nullptr},
    {"RAD_TAN_THIN_PRISM_FISHEYE", 16, nullptr},
};

bool is_colmap_line(const std::vector<std::string_view>& all) {
    return all.size() >= 5 && whole_number(all[0]) && std::isupper(static_cast<unsigned char>(all[1][0])) &&
           whole_number(all[2]) && whole_number(all[3]);
}

const ColmapModel* model_named(std::string_view name) {
    const auto* const found = std::ranges::find(colmap_models, name, &ColmapModel::name);
    return found == std::end(colmap_models) ? nullptr : found;
}

/// Throws Error, beginning with `place`, for what is no camera or one that we do not have.
Camera camera_from(const fs::path& file, const std::string& place, const ColmapModel& model, std::uint64_t width,
                   std::uint64_t height, const std::vector<double>& numbers) {
    if (!model.read)
        throw Error(fmt::format("{}: the camera model {} is not supported", place, in_quotes(model.name)));
    if (numbers.size() != model.numbers)
        throw Error(fmt::format("{}: {} has {}, expected {}", place, model.name, counted(numbers.size(), "number"),
                                model.numbers));
    Camera camera = model.read(numbers);
    Pinhole& pinhole = camera.pinhole;
    pinhole.cx -= 0.5; // our pixel centres are integers
    pinhole.cy -= 0.5;
    if (width < 1 || height < 1 || width > widest_image || height > widest_image)
        throw Error(fmt::format("{}: {}x{} is no image size", place, width, height));
    pinhole.size = {static_cast<int>(width), static_cast<int>(height)};
    check_numbers(file, pinhole, {"fx", "fy", "cx", "cy"});
    camera.origin = file.string();
    return camera;
}

/// The same of a line's words.
Camera camera_of_line(const fs::path& file, const std::string& place, const std::vector<std::string_view>& all) {
    const ColmapModel* model = model_named(all[1]);
    if (!model)
        throw Error(fmt::format("{}: the camera model {} is not supported", place, in_quotes(all[1])));
    std::vector<double> numbers;
    for (std::size_t i = 4; i < all.size(); ++i) {
        const auto value = number(all[i]);
        if (!value || !std::isfinite(*value))
            throw Error(fmt::format("{}: {} is not a finite number", place, in_quotes(all[i])));
        numbers.push_back(*value);
    }
    return camera_from(file, place, *model, *whole_number(all[2]), *whole_number(all[3]), numbers);
}

template <class Value>
Value value_at(const std::string& bytes, std::size_t offset) {
    static_assert(std::endian::native == std::endian::little);
    Value value;
    std::memcpy(&value, bytes.data() + offset, sizeof value);
    return value;
}

ColmapCamera camera_or_problem(const auto& read) {
    ColmapCamera one;
    try {
        one.camera = read();
    } catch (const Outage&) {
        throw;
    } catch (const Error& failure) {
        one.problem = failure.what();
    }
    return one;
}

constexpr std::uint64_t most_cameras = 1 << 22;

/// u64 count, then u32 id, i32 model, u64 width, u64 height and the model's doubles.
std::map<std::uint64_t, ColmapCamera> cameras_in_binary(const fs::path& file, std::vector<std::string>& warnings) {
    constexpr std::size_t before_numbers = 24;
    const FileBytes source(file);
    const std::string bytes = source.bytes(0, std::min(source.size(), most_cameras * 64));
    std::map<std::uint64_t, ColmapCamera> cameras;
    const auto ends_early = [&](std::size_t offset) {
        warnings.push_back(fmt::format("{}: ends early at offset {}, after {}.", file.string(), offset,
                                       counted(cameras.size(), "camera")));
        return cameras;
    };
    if (bytes.size() < 8)
        return ends_early(bytes.size());
    const auto count = value_at<std::uint64_t>(bytes, 0);
    if (count > most_cameras)
        throw Error(fmt::format("{}: {} cameras at offset 0, expected at most 2^22", file.string(), count));
    std::size_t at = 8;
    for (std::uint64_t i = 0; i < count; ++i) {
        if (bytes.size() - at < before_numbers)
            return ends_early(at);
        const auto id = value_at<std::uint32_t>(bytes, at);
        const auto model = value_at<std::uint32_t>(bytes, at + 4);
        if (model >= std::size(colmap_models)) { // how many numbers follow is not known
            warnings.push_back(fmt::format("{}: an unknown camera model {} at offset {}; the cameras from there on are "
                                           "not read.",
                                           file.string(), model, at + 4));
            return cameras;
        }
        const ColmapModel& kind = colmap_models[model];
        if (bytes.size() - at - before_numbers < kind.numbers * sizeof(double))
            return ends_early(at);
        std::vector<double> numbers;
        for (std::size_t n = 0; n < kind.numbers; ++n)
            numbers.push_back(value_at<double>(bytes, at + before_numbers + n * sizeof(double)));
        const std::string place = fmt::format("{}: offset {}", file.string(), at);
        cameras[id] = camera_or_problem([&] {
            return camera_from(file, place, kind, value_at<std::uint64_t>(bytes, at + 8),
                               value_at<std::uint64_t>(bytes, at + 16), numbers);
        });
        at += before_numbers + kind.numbers * sizeof(double);
    }
    return cameras;
}

} // namespace

std::map<std::uint64_t, ColmapCamera> read_colmap_cameras(const fs::path& file, std::vector<std::string>& warnings) {
    if (lower_extension(file) == ".bin")
        return cameras_in_binary(file, warnings);
    std::map<std::uint64_t, ColmapCamera> cameras;
    const std::string bytes = read_list_file(file);
    RepeatedWarning unused(warnings);
    for (const TextLine& line : text_lines(bytes)) {
        const auto all = words(line.text);
        if (all.empty() || all[0].starts_with('#'))
            continue;
        const std::string place = at_line(file, line.number);
        if (is_colmap_line(all))
            cameras[*whole_number(all[0])] = camera_or_problem([&] { return camera_of_line(file, place, all); });
        else
            unused.add(place + ": expected CAMERA_ID MODEL WIDTH HEIGHT PARAMS; line not used.");
    }
    return cameras;
}

bool is_colmap(const std::vector<TextLine>& lines) {
    return std::any_of(lines.begin(), lines.end(),
                       [](const TextLine& line) { return is_colmap_line(words(line.text)); });
}

CameraFile camera_from_colmap(const fs::path& file, const std::vector<TextLine>& lines) {
    CameraFile result;
    bool found = false;
    for (const TextLine& line : lines) {
        const auto all = words(line.text);
        if (all.empty() || all[0].starts_with('#'))
            continue;
        const std::string place = at_line(file, line.number);
        if (!is_colmap_line(all))
            throw Error(place + ": expected CAMERA_ID MODEL WIDTH HEIGHT PARAMS");
        if (found) {
            result.warnings.push_back(place + ": more than one camera; the first is used.");
            break;
        }
        result.camera = camera_of_line(file, place, all);
        found = true;
    }
    if (!found)
        refuse_camera(file, "no camera in it");
    return result;
}

std::string camera_as_colmap(const Camera& camera) {
    const auto& [fx, fy, cx, cy, size] = camera.pinhole;
    const Distortion& d = camera.distortion;
    const std::string start =
        fmt::format("# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]; pixel centres at 0.5\n1 {{}} {} {} {} {} {} {}",
                    size.width, size.height, fx, fy, cx + 0.5, cy + 0.5);
    const auto line = [&](const char* model) { return fmt::format(fmt::runtime(start), model); };
    if (d.model == LensModel::kannala_brandt)
        return fmt::format("{} {} {} {} {}\n", line("OPENCV_FISHEYE"), d.k1, d.k2, d.k3, d.k4);
    if (!d.any())
        return line("PINHOLE") + "\n";
    if (d.k3 == 0 && !d.rational())
        return fmt::format("{} {} {} {} {}\n", line("OPENCV"), d.k1, d.k2, d.p1, d.p2);
    return fmt::format("{} {} {} {} {} {} {} {} {}\n", line("FULL_OPENCV"), d.k1, d.k2, d.p1, d.p2, d.k3, d.k4, d.k5,
                       d.k6);
}

} // namespace scanshade
