// A capture folder's files: their order and kinds, the camera among them, and fit names for frames.
#include "io/captures/listing/layouts.h"

#include "io/files.h"
#include "io/images/format.h"
#include "io/output_file.h"
#include "io/shallow_json.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <map>
#include <nlohmann/json.hpp>
#include <unordered_set>

namespace scanshade {

namespace fs = std::filesystem;

bool natural_less(const std::string& a, const std::string& b) {
    const auto digit = [](char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; };
    std::size_t i = 0, j = 0;
    while (i < a.size() && j < b.size()) {
        if (!digit(a[i]) || !digit(b[j])) {
            if (a[i] != b[j])
                return a[i] < b[j];
            ++i, ++j;
            continue;
        }
        const auto run = [&](const std::string& text, std::size_t& at) { // digits without leading zeros
            while (at < text.size() && text[at] == '0')
                ++at;
            const std::size_t start = at;
            while (at < text.size() && digit(text[at]))
                ++at;
            return text.substr(start, at - start);
        };
        const std::string left = run(a, i), right = run(b, j);
        if (left.size() != right.size())
            return left.size() < right.size();
        if (left != right)
            return left < right;
    }
    if (a.size() - i != b.size() - j)
        return a.size() - i < b.size() - j;
    return a < b; // "01" and "1": any fixed order will do
}

FolderFiles files_in(const fs::path& folder) {
    std::error_code trouble;
    std::vector<FolderItem> items = items_in(folder, trouble);
    if (trouble)
        fail_to_read(folder, trouble);
    std::erase_if(items, [](const FolderItem& item) {
        return item.kind != FolderItem::Kind::file || item.name.starts_with('.') || item.name == "Thumbs.db" ||
               item.name == "desktop.ini";
    });
    std::ranges::sort(items, natural_less, &FolderItem::name);
    std::vector<std::string> names(items.size());
    std::ranges::transform(items, names.begin(), [](FolderItem& item) { return std::move(item.name); });
    return {folder, std::move(names)};
}

namespace {

bool speaks_of(const fs::path& file, std::initializer_list<std::string_view> subjects) {
    std::string name = file.filename().string();
    std::transform(name.begin(), name.end(), name.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return std::any_of(subjects.begin(), subjects.end(),
                       [&](std::string_view subject) { return name.find(subject) != std::string::npos; });
}

} // namespace

std::optional<fs::path> folder_named(const fs::path& parent, std::initializer_list<std::string_view> names) {
    for (const std::string_view name : names)
        if (is_folder(parent / name))
            return parent / name;
    return std::nullopt;
}

namespace {

FolderFiles images_in(const std::optional<fs::path>& folder, bool (*wanted)(const fs::path&)) {
    return folder ? files_in(*folder).only(wanted) : FolderFiles();
}

} // namespace

FolderFiles depth_images_in(const std::optional<fs::path>& folder) { return images_in(folder, &has_depth_extension); }

FolderFiles colour_images_in(const std::optional<fs::path>& folder) { return images_in(folder, &has_colour_extension); }

ImagesByStem::ImagesByStem(const FolderFiles& images) {
    for (const fs::path& image : images)
        paths_.emplace(image.stem().string(), image);
}

StoredPath ImagesByStem::of(const std::string& stem) const {
    const auto found = paths_.find(stem);
    return found == paths_.end() ? StoredPath() : found->second;
}

cv::Size image_size(double width, double height, const std::string& where) {
    constexpr double longest = 1 << 20;
    if (!(width >= 1 && height >= 1 && width <= longest && height <= longest))
        throw Error(fmt::format("{}: a size of {}x{}, expected pixels of an image", where, width, height));
    return {static_cast<int>(width), static_cast<int>(height)};
}

nlohmann::json json_in(const fs::path& file) { return parsed_json(read_list_file(file), file); }

nlohmann::json parsed_json(const std::string& text, const fs::path& file) {
    try {
        return shallow_json<nlohmann::json>(text);
    } catch (const nlohmann::json::parse_error& failure) {
        const std::size_t offset = std::min(text.size(), failure.byte > 0 ? failure.byte - 1 : 0);
        const auto line = 1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(offset), '\n');
        throw Error(
            fmt::format("{}: {}", at_line(file, static_cast<int>(line)), json_problem(failure.id, failure.what())));
    } catch (const nlohmann::json::exception& failure) {
        throw Error(fmt::format("{}: {}", file.string(), json_problem(failure.id, failure.what())));
    } catch (const Outage&) {
        throw;
    } catch (const Error& failure) {
        throw Error(fmt::format("{}: {}", file.string(), failure.what()));
    }
}

std::shared_ptr<const Camera> camera_for_depth(Camera camera, cv::Size size, cv::Size depth) {
    camera.pinhole.size = size;
    if (!depth.empty() && size != depth) {
        const double shape = static_cast<double>(size.width) / size.height * depth.height / depth.width;
        if (std::abs(shape - 1) > 0.01)
            throw Error(fmt::format("{}: the camera is for {}x{}, depth is {}x{}, which is another shape",
                                    camera.origin, size.width, size.height, depth.width, depth.height));
        camera.pinhole = scaled(camera.pinhole, depth);
    }
    check(camera);
    return std::make_shared<const Camera>(std::move(camera));
}

void settle_own_cameras(Listing& listing) {
    std::shared_ptr<const Camera> first;
    for (CaptureEntry& entry : listing.capture.entries) {
        first = first ? first : entry.camera;
        if (!entry.camera || entry.camera->pinhole.size == first->pinhole.size)
            continue;
        const cv::Size size = entry.camera->pinhole.size, usual = first->pinhole.size;
        entry.problem = fmt::format("{}: depth is {}x{}, that of {} is {}x{}", entry.depth, size.width, size.height,
                                    listing.capture.entries.front().name, usual.width, usual.height);
    }
    listing.find_camera = [first](cv::Size, std::vector<std::string>&) {
        return first ? std::optional(CameraFile{*first, {}, Registration::unknown, {}}) : std::nullopt;
    };
}

void tell_ignored(const fs::path& folder, std::initializer_list<std::string_view> names,
                  std::vector<std::string>& warnings) {
    std::vector<std::string_view> ignored;
    std::ranges::copy_if(names, std::back_inserter(ignored),
                         [&](std::string_view name) { return is_there(folder / name); });
    if (!ignored.empty())
        warnings.push_back(fmt::format("{}: not used: {}.", folder.string(), fmt::join(ignored, ", ")));
}

namespace {

bool stays_inside(const fs::path& relative) {
    return !relative.empty() && relative.is_relative() && *relative.begin() != "..";
}

} // namespace

std::string trouble_with(const fs::path& folder, const std::string& name) {
    const fs::path relative = fs::path(name).lexically_normal();
    if (!stays_inside(relative) || name.find('\0') != std::string::npos)
        return fmt::format("{} leaves the capture's folder; not opened", in_quotes(name));
    if (!is_file(folder / relative))
        return fmt::format("{} does not exist", in_quotes(name));
    return {};
}

namespace {

/// Settings and tables that hold a camera, under names that do not say so: not used, but named.
void tell_cameras_by_other_names(const fs::path& folder, std::vector<std::string>& warnings) {
    constexpr std::size_t enough = 1 << 16, most_looks = 16;
    constexpr std::array kinds{".yaml", ".yml", ".xml", ".txt", ".csv", ".cfg", ".conf", ".ini"};
    std::size_t looks = 0;
    for (const fs::path& file : files_in(folder)) {
        if (std::ranges::find(kinds, lower_extension(file)) == kinds.end() || ++looks > most_looks)
            continue;
        try {
            const std::string start = read_bytes(file, enough);
            if (start.size() < enough &&
                std::ranges::any_of(std::array{"fx", "Fx", "amera_matrix", "ameraMatrix"},
                                    [&](const char* key) { return start.find(key) != std::string::npos; })) {
                (void)read_camera_file(file);
                warnings.push_back(fmt::format("{} holds a camera, and is not used: --camera {} takes it.",
                                               file.filename().string(), file.string()));
            }
        } catch (const Outage&) {
            throw;
        } catch (const Error&) { // no camera after all
        }
    }
}

} // namespace

std::optional<CameraFile> camera_in(const fs::path& folder, std::vector<std::string>& warnings) {
    std::vector<fs::path> candidates, others;
    const auto calibrates = [](const fs::path& file) { // what speaks of a camera should be one, or is named
        return speaks_of(file, {"calib", "camera", "intrinsic", "sensors"}) &&
               !speaks_of(file, {"traj", "pose", "extrinsic"});
    };
    for (const fs::path& file : files_in(folder)) {
        const std::string name = file.filename().string(), extension = lower_extension(file);
        const std::string stem = file.stem().string();
        const bool json = extension == ".json", text = extension == ".txt";
        // Text files named after cameras are often poses or calibrations of another kind; JSON files rarely are.
        const bool promising =
            (json && speaks_of(file, {"cam", "intrinsic"}) && !speaks_of(file, {"traj", "pose", "extrinsic"})) ||
            (text && (speaks_of(file, {"intrinsic"}) || stem == "K" || stem == "k" || stem == "cam_K"));
        if (name == "camera.json")
            candidates.insert(candidates.begin(), file);
        else if (promising)
            candidates.push_back(file);
        else if (json || name == "info.txt" || name == "_info.txt")
            others.push_back(file);
        else if ((text || extension == ".yaml" || extension == ".yml" || extension == ".xml") && calibrates(file))
            others.insert(others.begin(), file);
    }
    std::optional<CameraFile> found;
    for (const fs::path& file : candidates) {
        if (found) {
            warnings.push_back(
                fmt::format("{} is used as the camera; {} is not.", found->camera.origin, file.filename().string()));
            continue;
        }
        found = read_camera_file(file);
    }
    for (auto other = others.begin(); !found && other != others.end(); ++other) {
        try {
            found = read_camera_file(*other);
        } catch (const Outage&) {
            throw;
        } catch (const Error& failure) {
            if (calibrates(*other)) // other names may hold anything
                warnings.push_back(
                    fmt::format("{}: not used as the camera: {}.", other->filename().string(), failure.what()));
        }
    }
    if (!found)
        tell_cameras_by_other_names(folder, warnings);
    return found;
}

DepthEncoding usual_encoding(const std::string& text, const std::string& origin) {
    DepthEncoding encoding = depth_encoding(text, origin);
    encoding.stated = false;
    return encoding;
}

Listing listing_of_phone(const std::string& layout) {
    Listing listing;
    listing.capture.depth = usual_encoding("mm", layout + " layout");
    listing.capture.registration = Registration::yes;
    listing.capture.registration_reason = "phones make depth on the colour camera's pixels";
    listing.capture.colour_in_more_pixels = true;
    return listing;
}

cv::Size peek_size(const fs::path& image) {
    try {
        return peek(image).size;
    } catch (const Outage&) {
        throw;
    } catch (const Error&) { // loading it will say why
        return {};
    }
}

DepthEncoding assumed_encoding(const fs::path& first_depth) {
    bool floats = false;
    try {
        const ImageFacts facts = first_depth.empty() ? ImageFacts() : peek(first_depth);
        if (facts.format && facts.format->unit_is_arbitrary)
            return arbitrary_encoding(fmt::format("{} has no unit of length", facts.format->name));
        floats = facts.floats;
    } catch (const Outage&) {
        throw;
    } catch (const Error&) { // loading that frame reports the error
    }
    if (floats)
        return usual_encoding("m", "assumed: floats are metres");
    return usual_encoding("mm", "assumed: 16-bit integers are millimetres");
}

namespace {

std::string fit_for_a_file(const std::string& name) {
    constexpr std::size_t longest = 160; // of the 255 bytes that file systems have: other parts are added
    std::string fit = as_utf8(shortened(name, longest));
    std::replace_if(
        fit.begin(), fit.end(), [](char c) { return c == '/' || c == '\\' || static_cast<unsigned char>(c) < ' '; },
        '_');
    if (fit.starts_with('.')) // temporary files and those of other programs begin so
        fit[0] = '_';
    return fit.empty() ? "frame" : fit;
}

} // namespace

void settle_names(std::vector<CaptureEntry>& entries) {
    std::unordered_set<std::string_view> taken; // names that are settled
    taken.reserve(entries.size());
    std::map<std::string, int> next; // per repeated name
    for (CaptureEntry& entry : entries) {
        const std::string wanted = fit_for_a_file(entry.name);
        for (entry.name = wanted; !taken.insert(entry.name).second;)
            entry.name = fmt::format("{}-{}", wanted, ++next.emplace(wanted, 1).first->second);
    }
}

} // namespace scanshade
