// COLMAP's dense workspace: images/, sparse/{cameras,images}.{bin,txt}, stereo/depth_maps/NAME.{geometric,photometric}
// .bin (doc/format.rst). Its unit is arbitrary; depth and poses share it.
#include "io/captures/listing/layouts.h"
#include "io/files.h"

#include "io/cameras/colmap_cameras.h"
#include "io/captures/listing/trajectory.h"
#include "io/file_bytes.h"
#include "io/images/format.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <map>
#include <set>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

constexpr std::uint64_t most_images = 1 << 22;

struct ColmapImage {
    std::string name; ///< with extension, and maybe folders
    std::optional<std::uint64_t> camera;
    std::optional<Eigen::Isometry3d> world_from_camera;
    std::string warning; ///< why there is no pose
};

/// Files give world to camera, w first.
void take_pose(const std::array<double, 7>& rows, const std::string& place, ColmapImage& image) {
    const Eigen::Quaterniond q(rows[0], rows[1], rows[2], rows[3]);
    const Eigen::Vector3d t(rows[4], rows[5], rows[6]);
    constexpr double longest = 1e30; // of which squares are finite
    if (!(std::abs(q.norm() - 1) < 0.02) || !t.allFinite() || t.cwiseAbs().maxCoeff() > longest) {
        image.warning = place + ": no unit quaternion and translation; no pose.";
        return;
    }
    image.world_from_camera = pose_from(t, q.normalized()).inverse();
}

/// u64 count, then u32 id, 4 doubles of rotation, 3 of translation, u32 camera, name to \0, u64 points, and 24 bytes
/// for each point. Points are passed over unread: they are most of the file.
std::vector<ColmapImage> images_in_binary(const fs::path& file, std::vector<std::string>& warnings) {
    static_assert(std::endian::native == std::endian::little);
    constexpr std::size_t before_name = 64, longest_name = 1 << 12, point_bytes = 24;
    const FileBytes source(file);
    std::vector<ColmapImage> images;
    const auto damaged = [&](std::uint64_t offset, const char* why) {
        warnings.push_back(fmt::format("{}: {} at offset {}; the {} before are used.", file.string(), why, offset,
                                       counted(images.size(), "image")));
        return images;
    };
    if (source.size() < 8)
        return damaged(source.size(), "ends early");
    std::uint64_t count = 0;
    std::memcpy(&count, source.bytes(0, 8).data(), 8);
    if (count > most_images)
        throw Error(fmt::format("{}: {} images at offset 0, expected at most 2^22", file.string(), count));
    std::uint64_t at = 8;
    for (std::uint64_t i = 0; i < count; ++i) {
        if (source.size() - at < before_name + 9)
            return damaged(at, "ends early");
        const std::string bytes =
            source.bytes(at, std::min<std::uint64_t>(source.size() - at, before_name + longest_name + 9));
        const auto end = bytes.find('\0', before_name);
        if (end == std::string::npos || end - before_name > longest_name || bytes.size() - end < 9)
            return damaged(at + before_name, "a name without end");
        ColmapImage image;
        std::array<double, 7> pose;
        std::memcpy(pose.data(), bytes.data() + 4, sizeof pose);
        std::uint32_t camera = 0;
        std::memcpy(&camera, bytes.data() + 60, 4);
        image.name = bytes.substr(before_name, end - before_name);
        image.camera = camera;
        take_pose(pose, fmt::format("{}: offset {}", file.string(), at), image);
        std::uint64_t points = 0;
        std::memcpy(&points, bytes.data() + end + 1, 8);
        images.push_back(std::move(image));
        at += end + 9;
        if (points > (source.size() - at) / point_bytes)
            return damaged(at, "points end early");
        at += points * point_bytes;
    }
    return images;
}

/// Two lines an image: "id qw qx qy qz tx ty tz camera NAME", and its points, which may be an empty line.
std::vector<ColmapImage> images_in_text(const fs::path& file, std::vector<std::string>& warnings) {
    constexpr std::uint64_t most_bytes = std::uint64_t(1) << 31;
    const std::string bytes = read_at_most(most_bytes, file, "a list of images");
    std::vector<ColmapImage> images;
    RepeatedWarning unused(warnings);
    bool points_follow = false;
    for (const TextLine& line : text_lines(bytes)) {
        if (std::exchange(points_follow, false))
            continue;
        const std::string_view text = trimmed(line.text);
        if (text.empty() || text.starts_with('#'))
            continue;
        points_follow = true;
        const std::string place = at_line(file, line.number);
        constexpr std::size_t before_name = 9, longest = 1 << 13;
        const auto all = words(text.substr(0, longest));
        std::array<double, 7> pose{};
        bool good = all.size() > before_name && whole_number(all[8]);
        for (std::size_t i = 0; good && i < pose.size(); ++i) {
            const auto value = number(all[i + 1]);
            good = value.has_value();
            pose[i] = value.value_or(0);
        }
        if (!good) {
            unused.add(place + ": expected ID QW QX QY QZ TX TY TZ CAMERA NAME; image not used.");
            continue;
        }
        if (images.size() == most_images)
            throw Error(place + ": more than 2^22 images");
        ColmapImage image;
        image.name = std::string(text.substr(static_cast<std::size_t>(all[before_name].data() - text.data())));
        image.camera = whole_number(all[8]);
        take_pose(pose, place, image);
        images.push_back(std::move(image));
    }
    return images;
}

/// The binary file of that name wins over the text.
std::optional<fs::path> list_named(const fs::path& sparse, const std::string& stem) {
    for (const char* extension : {".bin", ".txt"})
        if (fs::path file = sparse / (stem + extension); is_file(file))
            return file;
    return std::nullopt;
}

constexpr std::array<const char*, 2> kinds = {".geometric.bin", ".photometric.bin"};
constexpr const char* depth_folder = "stereo/depth_maps/";

/// Adds the names of the images whose depth maps lie there, whichever kind.
void add_names_with_depth(const fs::path& folder, const std::string& below, int levels, std::set<std::string>& names) {
    std::error_code trouble;
    for (const auto& [item, is] : items_in(folder / below, trouble)) {
        const std::string name = below + item;
        if (is == FolderItem::Kind::folder && levels > 0) // a link may lead back
            add_names_with_depth(folder, name + '/', levels - 1, names);
        for (const std::string_view kind : kinds)
            if (name.ends_with(kind) && name.size() > kind.size())
                names.insert(name.substr(0, name.size() - kind.size()));
    }
    if (trouble)
        fail_to_read(folder / below, trouble);
}

std::set<std::string> names_with_depth(const fs::path& folder) {
    std::set<std::string> names;
    add_names_with_depth(folder / depth_folder, "", 8, names);
    return names;
}

class Workspace {
  public:
    Workspace(const fs::path& folder, Listing& listing) : folder_(folder), capture_(listing.capture) {
        const bool numbered = !list_named(folder / "sparse", "cameras") && is_folder(folder / "sparse/0");
        sparse_ = folder / (numbered ? "sparse/0" : "sparse");
        const auto cameras = list_named(sparse_, "cameras");
        if (cameras)
            cameras_ = read_colmap_cameras(*cameras, capture_.warnings);
        else
            capture_.warnings.push_back(
                fmt::format("{}: neither cameras.bin nor cameras.txt; no camera.", sparse_.string()));
    }

    /// As the list of images has them; without it, by their depth maps.
    [[nodiscard]] std::vector<ColmapImage> images(const std::set<std::string>& with_depth) {
        std::vector<ColmapImage> images;
        if (const auto list = list_named(sparse_, "images")) {
            images = lower_extension(*list) == ".bin" ? images_in_binary(*list, capture_.warnings)
                                                      : images_in_text(*list, capture_.warnings);
            unlist(images, with_depth, list->filename().string());
        } else {
            capture_.warnings.push_back(
                fmt::format("{}: neither images.bin nor images.txt; no poses.", sparse_.string()));
            for (const std::string& name : with_depth)
                images.push_back({name, std::nullopt, std::nullopt, {}});
        }
        std::ranges::stable_sort(images, &natural_less, &ColmapImage::name);
        return images;
    }

    void add(ColmapImage image) {
        std::ranges::replace(image.name, '\\', '/');
        if (image.name.starts_with("./"))
            image.name.erase(0, 2);
        CaptureEntry entry;
        entry.name = image.name;
        if (!find_depth(image.name, entry)) {
            ++without_depth_;
            return;
        }
        if (entry.problem.empty()) {
            find_colour(image.name, entry);
            try {
                find_camera(image, entry);
            } catch (const Outage&) {
                throw;
            } catch (const Error& failure) {
                entry.problem = failure.what();
            }
        }
        entry.world_from_camera = image.world_from_camera;
        if (!image.warning.empty())
            entry.warnings.push_back(image.warning);
        capture_.entries.push_back(std::move(entry));
    }

    void conclude() {
        if (without_depth_ > 0)
            capture_.warnings.push_back(fmt::format("{}: {} left out, without a depth map.", sparse_.string(),
                                                    counted(without_depth_, "image")));
        if (of_kind_[0] > 0 && of_kind_[1] > 0)
            capture_.warnings.push_back(fmt::format(
                "{}: {} geometric, {} without one photometric: these are noisier, as no other image confirms them.",
                folder_.string(), counted(of_kind_[0], "depth map"), of_kind_[1]));
    }

  private:
    /// Counts depth maps that no image of the list has.
    void unlist(const std::vector<ColmapImage>& images, const std::set<std::string>& with_depth,
                const std::string& list) {
        std::set<std::string> left = with_depth;
        for (const ColmapImage& image : images)
            left.erase(fs::path(image.name).lexically_normal().generic_string());
        if (!left.empty())
            capture_.warnings.push_back(fmt::format("{}{}: {} that {} does not list, such as {}; not used.",
                                                    folder_.string(), std::string("/") + depth_folder,
                                                    counted(left.size(), "image's depth map"), list, *left.begin()));
    }

    /// Geometric wins over photometric. Whether there is one.
    bool find_depth(const std::string& name, CaptureEntry& entry) {
        if (name.starts_with('/')) {
            entry.problem = fmt::format("{}: {}", sparse_.string(), trouble_with(folder_, name));
            return true;
        }
        for (std::size_t kind = 0; kind < kinds.size(); ++kind) {
            const std::string file = depth_folder + name + kinds[kind];
            if (name.find('\0') != std::string::npos || !is_there(folder_ / file))
                continue;
            if (const auto trouble = trouble_with(folder_, file); trouble.empty())
                entry.depth = (folder_ / file).lexically_normal();
            else
                entry.problem = fmt::format("{}: {}", sparse_.string(), trouble);
            ++of_kind_[kind];
            return true;
        }
        return false;
    }

    void find_colour(const std::string& name, CaptureEntry& entry) const {
        if (const auto trouble = trouble_with(folder_, "images/" + name); trouble.empty())
            entry.colour = (folder_ / ("images/" + name)).lexically_normal();
        else
            entry.warnings.push_back(fmt::format("{}: {}; processed without colour.", sparse_.string(), trouble));
    }

    /// The image's, for the size of its depth map. Without a list, the only camera.
    void find_camera(const ColmapImage& image, CaptureEntry& entry) const {
        if (cameras_.empty())
            return;
        const auto found = image.camera           ? cameras_.find(*image.camera)
                           : cameras_.size() == 1 ? cameras_.begin()
                                                  : cameras_.end();
        if (found == cameras_.end()) {
            if (image.camera)
                throw Error(fmt::format("{}: camera {} of {} is not among the cameras", sparse_.string(), *image.camera,
                                        in_quotes(image.name)));
            entry.warnings.push_back("which of the cameras took it is not known; no camera.");
            return;
        }
        if (!found->second.problem.empty())
            throw Error(found->second.problem);
        const Camera& camera = found->second.camera;
        entry.camera = camera_for_depth(camera, camera.pinhole.size, peek_size(entry.depth));
    }

    const fs::path& folder_;
    fs::path sparse_;
    Capture& capture_;
    std::map<std::uint64_t, ColmapCamera> cameras_;
    std::size_t without_depth_ = 0;
    std::array<std::size_t, 2> of_kind_{};
};

} // namespace

std::optional<Listing> list_colmap(const fs::path& folder) {
    if (!is_folder(folder / "sparse") || !is_folder(folder / depth_folder))
        return std::nullopt;
    Listing listing;
    Capture& capture = listing.capture;
    capture.depth = arbitrary_encoding("a reconstruction from images has no unit of length");
    capture.registration = Registration::yes;
    capture.registration_reason = "depth maps belong to the pixels of their images";
    capture.colour_in_more_pixels = true;
    Workspace workspace(folder, listing);
    const std::vector<ColmapImage> images = workspace.images(names_with_depth(folder));
    for (const ColmapImage& image : images)
        workspace.add(image);
    workspace.conclude();
    if (capture.entries.empty())
        throw Error(fmt::format("{}: a COLMAP workspace of {} without a depth map: expected {}NAME{} or NAME{}, which "
                                "patch_match_stereo writes",
                                folder.string(), counted(images.size(), "image"), depth_folder, kinds[0], kinds[1]));
    std::shared_ptr<const Camera> first;
    bool one_size = true;
    for (const CaptureEntry& entry : capture.entries) {
        first = first ? first : entry.camera;
        one_size &= !entry.camera || entry.camera->pinhole.size == first->pinhole.size;
    }
    if (!one_size)
        capture.warnings.push_back(fmt::format(
            "{}: depth maps of several sizes; --sequence computes only those of one size together.", folder.string()));
    listing.find_camera = [](cv::Size, std::vector<std::string>&) { return std::nullopt; };
    if (first)
        listing.find_camera = [first](cv::Size, std::vector<std::string>&) {
            return std::optional(CameraFile{*first, {}, Registration::unknown, {}});
        };
    return listing;
}

} // namespace scanshade
