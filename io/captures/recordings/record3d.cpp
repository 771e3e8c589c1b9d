// Record3D's .r3d: a zip archive of JPEGs, and of depth and confidence packed by LZFSE, with all cameras and poses in
// one JSON file.
#include "io/captures/listing/layouts.h"

#include "io/captures/listing/trajectory.h"
#include "io/compression/lzfse.h"
#include "io/compression/zip_archive.h"
#include "io/images/format.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <map>
#include <nlohmann/json.hpp>

namespace scanshade {

namespace fs = std::filesystem;
using Json = nlohmann::json;

namespace {

struct Members {
    const ZipMember *depth = nullptr, *colour = nullptr, *confidence = nullptr;
};

class Record3d final : public FrameContainer {
  public:
    explicit Record3d(std::shared_ptr<const ZipArchive> from) : archive(std::move(from)) {}

    [[nodiscard]] cv::Mat image(Part part, std::size_t place) const override {
        const Members& frame = frames.at(place);
        if (part == Part::colour)
            return colour_in(archive->bytes(*frame.colour, most_jpeg), where(*frame.colour));
        if (part == Part::confidence)
            return unpacked(*frame.confidence, CV_8U);
        return unpacked(*frame.depth, CV_32F);
    }
    [[nodiscard]] cv::Size size(Part part, std::size_t place) const override {
        return part == Part::colour ? image(part, place).size() : depth_size;
    }
    /// Of a frame's depth, as it is unpacked.
    [[nodiscard]] std::size_t depth_bytes(std::size_t place) const {
        const ZipMember& member = *frames.at(place).depth;
        return during(where(member), [&] { return unpacked_lzfse(packed(member), most_depth); }).size();
    }

    std::shared_ptr<const ZipArchive> archive;
    std::vector<Members> frames;
    cv::Size depth_size;

  private:
    static constexpr std::size_t most_jpeg = std::size_t(1) << 28, most_depth = std::size_t(1) << 26;

    [[nodiscard]] std::string where(const ZipMember& member) const {
        return fmt::format("{}: {} at byte {}", archive->path().string(), in_quotes(member.name), member.header_at);
    }
    [[nodiscard]] std::string packed(const ZipMember& member) const { return archive->bytes(member, most_depth); }
    [[nodiscard]] cv::Mat unpacked(const ZipMember& member, int type) const {
        cv::Mat image(depth_size, type);
        const std::size_t expected = image.total() * image.elemSize();
        const std::string bytes = during(where(member), [&] { return unpacked_lzfse(packed(member), expected); });
        if (bytes.size() != expected)
            throw Error(fmt::format("{}: {}, expected {} of {}x{} pixels", where(member), counted(bytes.size(), "byte"),
                                    expected, depth_size.width, depth_size.height));
        std::memcpy(image.data, bytes.data(), expected);
        return image;
    }
};

std::optional<double> number_in(const Json& object, const char* key) {
    const auto found = object.find(key);
    return found != object.end() && found->is_number() ? std::optional(found->get<double>()) : std::nullopt;
}

/// The numbers of a list; nothing where it is none, or has another length.
std::vector<double> numbers_in(const Json& list, std::size_t count) {
    std::vector<double> numbers;
    if (list.is_array() && list.size() == count)
        for (const Json& value : list)
            if (value.is_number())
                numbers.push_back(value.get<double>());
    return numbers.size() == count ? numbers : std::vector<double>();
}

/// rgbd/N.depth, rgbd/N.jpg and rgbd/N.conf, by N.
std::map<std::uint64_t, Members> members_by_frame(const ZipArchive& archive) {
    std::map<std::uint64_t, Members> frames;
    constexpr std::string_view folder = "rgbd/";
    for (const ZipMember& member : archive.members()) {
        const fs::path name = member.name;
        const auto frame = member.name.starts_with(folder) && name.parent_path() == "rgbd"
                               ? whole_number(name.stem().string())
                               : std::nullopt;
        if (!frame)
            continue;
        if (name.extension() == ".depth")
            frames[*frame].depth = &member;
        else if (name.extension() == ".jpg")
            frames[*frame].colour = &member;
        else if (name.extension() == ".conf")
            frames[*frame].confidence = &member;
    }
    return frames;
}

/// Old files do not say: the lidar's images have 192x256 pixels, those of the face camera 480x640.
cv::Size size_of_depth(const Json& facts, const Record3d& recording, const std::string& where) {
    if (const auto width = number_in(facts, "dw"), height = number_in(facts, "dh"); width && height)
        return image_size(*width, *height, where + ": dw, dh");
    const std::size_t pixels = recording.depth_bytes(0) / sizeof(float);
    for (const cv::Size size : {cv::Size(192, 256), cv::Size(480, 640)})
        if (static_cast<std::size_t>(size.area()) == pixels)
            return size;
    throw Error(fmt::format("{}: no dw and dh, and depth of {} pixels, expected 192x256 or 480x640", where, pixels));
}

MatrixPose pose_in(const Json& row, const std::string& where) {
    const std::vector<double> v = numbers_in(row, 7);
    if (v.empty())
        return {std::nullopt, {}, where + ": expected 7 numbers (qx qy qz qw x y z); no pose."};
    const Eigen::Quaterniond q(v[3], v[0], v[1], v[2]);
    if (!(q.norm() > 1e-6) || !std::isfinite(q.norm()))
        return {std::nullopt, {}, where + ": its quaternion is no rotation; no pose."};
    return checked_pose(from_opengl(pose_from({v[4], v[5], v[6]}, q).matrix()), where);
}

} // namespace

Listing list_record3d(const std::shared_ptr<const ZipArchive>& archive) {
    const std::string path = archive->path().string(), where = path + ": metadata";
    const ZipMember* const metadata = archive->find("metadata");
    if (!metadata)
        throw Error(fmt::format("{}: rgbd/ without the member metadata, which has the cameras{}", path,
                                archive->damage().empty() ? "" : "; the file is cut"));
    constexpr std::uint64_t most_metadata = std::uint64_t(1) << 30;
    const Json facts = parsed_json(archive->bytes(*metadata, most_metadata), where);
    if (!facts.is_object())
        throw Error(where + ": expected a JSON object");

    auto recording = std::make_shared<Record3d>(archive);
    Listing listing = listing_of_phone("Record3D");
    listing.capture.kind = "Record3D";
    listing.capture.confidence_levels = "0 low, 1 medium, 2 high";
    Capture& capture = listing.capture;
    capture.depth = usual_encoding("m", "Record3D layout");
    if (!archive->damage().empty())
        capture.warnings.push_back(archive->damage() + ".");
    const auto part = [&](const char* key) { return facts.contains(key) ? facts[key] : Json(); };
    const Json poses = part("poses"), stamps = part("frameTimestamps"), own = part("perFrameIntrinsicCoeffs");
    for (const auto& [number, members] : members_by_frame(*archive)) {
        if (!members.depth)
            continue;
        CaptureEntry entry;
        entry.name = fmt::format("{:06}", number);
        entry.depth = path;
        if (members.colour)
            entry.colour = path;
        if (members.confidence)
            entry.confidence = path;
        entry.container = recording;
        entry.place = recording->frames.size();
        recording->frames.push_back(members);
        if (poses.is_array() && number < poses.size()) {
            MatrixPose pose = pose_in(poses[number], fmt::format("{}: poses [{}]", where, number));
            entry.world_from_camera = pose.world_from_camera;
            for (std::string* sentence : {&pose.warning, &pose.problem})
                if (!sentence->empty())
                    entry.warnings.push_back(std::move(*sentence));
        } else {
            entry.warnings.push_back(fmt::format("{}: poses has none for frame {}.", where, number));
        }
        if (stamps.is_array() && number < stamps.size() && stamps[number].is_number())
            entry.stamp_s = stamps[number].get<double>();
        capture.entries.push_back(std::move(entry));
    }
    if (capture.entries.empty())
        throw Error(fmt::format("{}: no member rgbd/N.depth", path));
    const std::vector<double> k = numbers_in(part("K"), 9);
    const auto width = number_in(facts, "w"), height = number_in(facts, "h");
    if (k.empty() || !width || !height)
        throw Error(where + ": expected K of 9 numbers by columns, and w and h, the size of colour images");
    recording->depth_size = size_of_depth(facts, *recording, where);
    const cv::Size colour_size = image_size(*width, *height, where + ": w, h");
    const bool each = own.is_array() && own.size() >= recording->frames.size();
    for (CaptureEntry& entry : capture.entries) {
        const std::uint64_t number = *whole_number(entry.name);
        const std::vector<double> v = each && number < own.size() ? numbers_in(own[number], 4) : std::vector<double>();
        const Pinhole pinhole = v.empty() ? Pinhole{k[0], k[4], k[6], k[7], {}} : Pinhole{v[0], v[1], v[2], v[3], {}};
        try {
            entry.camera = camera_for_depth(
                {pinhole,
                 {},
                 v.empty() ? where + ": K" : fmt::format("{}: perFrameIntrinsicCoeffs [{}]", where, number)},
                colour_size, recording->depth_size);
        } catch (const Error& failure) {
            entry.problem = failure.what();
        }
    }
    settle_own_cameras(listing);
    return listing;
}

} // namespace scanshade
