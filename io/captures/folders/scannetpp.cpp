// ScanNet++'s recordings of a phone: rgb/ and depth/ as extracted, or depth.bin as published, with
// pose_intrinsic_imu.json.
#include "io/captures/listing/layouts.h"

#include "io/captures/listing/trajectory.h"
#include "io/compression/inflate.h"
#include "io/compression/inflated_stream.h"
#include "io/file_bytes.h"
#include "io/files.h"
#include "io/images/format.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <lz4.h>
#include <nlohmann/json.hpp>

namespace scanshade {

namespace fs = std::filesystem;
using Json = nlohmann::json;

namespace {

Eigen::Matrix4d matrix_of(const Json& rows) {
    Eigen::Matrix4d matrix = Eigen::Matrix4d::Constant(std::nan(""));
    matrix.row(3) << 0, 0, 0, 1;
    for (std::size_t row = 0; rows.is_array() && row < std::min<std::size_t>(rows.size(), 4); ++row)
        for (std::size_t column = 0; rows[row].is_array() && column < std::min<std::size_t>(rows[row].size(), 4);
             ++column)
            if (rows[row][column].is_number())
                matrix(static_cast<int>(row), static_cast<int>(column)) = rows[row][column].get<double>();
    return matrix;
}

/// Of the video that the cameras are for: of the sizes that phones make, the one whose middle is nearest to the
/// principal point.
cv::Size video_size_of(const Json& all) {
    cv::Size best(1920, 1440);
    for (const auto& [name, facts] : all.items()) {
        if (!facts.is_object() || !facts.contains("intrinsic"))
            continue;
        const double twice_cx = 2 * matrix_of(facts["intrinsic"])(0, 2) + 1;
        for (const cv::Size size : {cv::Size(1440, 1080), cv::Size(1280, 960), cv::Size(1024, 768), cv::Size(640, 480)})
            if (std::abs(twice_cx - size.width) < std::abs(twice_cx - best.width))
                best = size;
        break;
    }
    return best;
}

/// Camera, pose and time of a frame, from pose_intrinsic_imu.json.
void take_facts(CaptureEntry& entry, const Json& all, const fs::path& file, cv::Size of_colour, cv::Size depth) {
    const auto facts = all.find(entry.name);
    const std::string where = fmt::format("{}: \"{}\"", file.string(), entry.name);
    if (facts == all.end() || !facts->is_object()) {
        entry.warnings.push_back(where + " is missing; no pose, and the camera of the first frame.");
        return;
    }
    const auto part = [&](const char* key) { return facts->contains(key) ? (*facts)[key] : Json(); };
    const Eigen::Matrix4d k = matrix_of(part("intrinsic"));
    try {
        entry.camera = camera_for_depth({{k(0, 0), k(1, 1), k(0, 2), k(1, 2), {}}, {}, where}, of_colour, depth);
    } catch (const Error& failure) {
        entry.problem = failure.what();
    }
    if (const Json stamp = part("timestamp"); stamp.is_number())
        entry.stamp_s = stamp.get<double>();
    // `pose` is the phone's own; `aligned_pose` is in the scan's space, and the camera's axes are ours.
    const MatrixPose pose = checked_pose(matrix_of(part("aligned_pose")), where);
    entry.world_from_camera = pose.world_from_camera;
    if (!pose.warning.empty())
        entry.warnings.push_back(pose.warning);
}

// --- depth.bin ---

const cv::Size depth_size(256, 192);
constexpr std::uint64_t pixels = 256 * 192, most_frames = 1 << 22;

/// depth.bin is one deflate stream of floats, or for each frame a count of bytes and these: an LZ4 block of 16-bit
/// millimetres, or a deflate stream of floats.
class DepthBin final : public FrameContainer {
  public:
    explicit DepthBin(const fs::path& path) : file_(path) {
        std::uint64_t at = 0;
        while (file_.size() - at >= sizeof(std::uint32_t)) {
            const std::string head = file_.bytes(at, sizeof(std::uint32_t));
            std::uint32_t bytes = 0;
            std::memcpy(&bytes, head.data(), sizeof bytes);
            at += sizeof bytes;
            if (bytes == 0 || bytes > file_.size() - at || blocks_.size() == most_frames) {
                at -= sizeof bytes;
                break;
            }
            blocks_.push_back({at, bytes});
            at += bytes;
        }
        if (!blocks_.empty() && at == file_.size() && take_blocks())
            return;
        auto stream = std::make_unique<InflatedStream>(file_, 0, file_.size(), most_frames * pixels * sizeof(float));
        const std::uint64_t each = pixels * sizeof(float), whole = stream->size() / each;
        if (whole == 0 && !blocks_.empty() && take_blocks()) {
            damage_ = fmt::format("frame {} at byte {} is cut", frames_, at);
            return;
        }
        stream_ = std::move(stream);
        frames_ = whole;
        damage_ = stream_->damage();
        if (const std::uint64_t rest = stream_->size() % each; damage_.empty() && rest > 0)
            damage_ = fmt::format("{} after the last whole frame when unpacked, expected frames of {}",
                                  counted(rest, "byte"), each);
    }

    [[nodiscard]] std::size_t frames() const { return frames_; }
    [[nodiscard]] bool millimetres() const { return !stream_ && lz4_; }
    /// What is wrong behind the last frame; empty = nothing.
    [[nodiscard]] const std::string& damage() const { return damage_; }

    [[nodiscard]] cv::Size size(Part /*part*/, std::size_t /*place*/) const override { return depth_size; }
    [[nodiscard]] cv::Mat image(Part /*part*/, std::size_t place) const override {
        if (stream_)
            return floats(stream_->bytes(place * pixels * sizeof(float), pixels * sizeof(float)));
        const Block& block = blocks_.at(place);
        const std::string where = fmt::format("{}: frame {} at byte {}", file_.path().string(), place, block.at);
        const std::string packed = file_.bytes(block.at, block.bytes);
        if (lz4_)
            return millimetres_in(packed, where);
        return during(where, [&] {
            const std::string bytes = inflated(packed, Inflate::raw, pixels * sizeof(float));
            if (bytes.size() != pixels * sizeof(float))
                throw Error(fmt::format("{}, expected {} of {}x{} floats", counted(bytes.size(), "byte"),
                                        pixels * sizeof(float), depth_size.width, depth_size.height));
            return floats(bytes);
        });
    }

  private:
    struct Block {
        std::uint64_t at = 0, bytes = 0;
    };

    /// Whether any of the first blocks can be unpacked: what comes out decides the kind of all.
    bool take_blocks() {
        frames_ = blocks_.size();
        constexpr std::size_t tries = 8;
        for (const bool lz4 : {true, false}) {
            lz4_ = lz4;
            for (std::size_t i = 0; i < std::min(tries, blocks_.size()); ++i)
                try {
                    (void)image(Part::depth, i);
                    return true;
                } catch (const Outage&) {
                    throw;
                } catch (const Error&) {
                    continue;
                }
        }
        return false;
    }

    static cv::Mat floats(const std::string& bytes) {
        cv::Mat1f image(depth_size);
        std::memcpy(image.data, bytes.data(), bytes.size());
        return image;
    }

    static cv::Mat millimetres_in(const std::string& packed, const std::string& where) {
        cv::Mat1w image(depth_size);
        constexpr int expected = pixels * sizeof(ushort);
        if (packed.size() > LZ4_COMPRESSBOUND(expected))
            throw Error(fmt::format("{}: {} packed, expected at most {}", where, counted(packed.size(), "byte"),
                                    LZ4_COMPRESSBOUND(expected)));
        const int got = LZ4_decompress_safe(packed.data(), reinterpret_cast<char*>(image.data),
                                            static_cast<int>(packed.size()), expected);
        if (got < 0)
            throw Error(fmt::format("{}: damaged LZ4 block of {}", where, counted(packed.size(), "byte")));
        if (got != expected)
            throw Error(fmt::format("{}: {}, expected {} of {}x{} pixels", where, counted(got, "byte"), expected,
                                    depth_size.width, depth_size.height));
        return image;
    }

    FileBytes file_;
    std::unique_ptr<InflatedStream> stream_; ///< null: blocks_
    std::vector<Block> blocks_;
    std::size_t frames_ = 0;
    bool lz4_ = false;
    std::string damage_;
};

std::optional<Listing> list_depth_bin(const fs::path& folder) {
    const fs::path bin = folder / "depth.bin", facts = folder / "pose_intrinsic_imu.json", video = folder / "rgb.mkv";
    const bool with_facts = is_file(facts), with_video = is_file(video);
    if (!is_file(bin) || !(with_facts || with_video))
        return std::nullopt;
    const auto depths = std::make_shared<DepthBin>(bin);
    if (depths->frames() == 0)
        throw Error(fmt::format("{}: no whole frame of {}x{}: {}", bin.string(), depth_size.width, depth_size.height,
                                depths->damage().empty() ? "it is empty" : depths->damage()));
    Listing listing = listing_of_phone("ScanNet++");
    Capture& capture = listing.capture;
    tell_ignored(folder, {"rgb_mask.mkv", "rgb_masks"}, capture.warnings);
    if (!depths->millimetres())
        capture.depth = usual_encoding("m", "ScanNet++ layout");
    if (!depths->damage().empty())
        capture.warnings.push_back(fmt::format("{}: {}; the {} before that are used.", bin.string(), depths->damage(),
                                               counted(depths->frames(), "frame")));
    if (with_video)
        capture.warnings.push_back(video.string() + ": videos are not decoded; no colour.");
    const Json all = with_facts ? json_in(facts) : Json();
    const cv::Size of_colour = with_facts && all.is_object() ? video_size_of(all) : cv::Size(1920, 1440);
    if (with_facts)
        capture.warnings.push_back(fmt::format("{}: cameras taken as of a video of {}x{}, by their principal points.",
                                               facts.string(), of_colour.width, of_colour.height));
    else
        capture.warnings.push_back(facts.string() + ": missing; no cameras and no poses.");
    for (std::size_t i = 0; i < depths->frames(); ++i) {
        CaptureEntry entry;
        entry.name = fmt::format("frame_{:06}", i);
        entry.depth = bin.string();
        entry.container = depths;
        entry.place = i;
        if (with_facts)
            take_facts(entry, all, facts, of_colour, depth_size);
        capture.entries.push_back(std::move(entry));
    }
    if (with_facts)
        settle_own_cameras(listing);
    else
        listing.find_camera = [](cv::Size, std::vector<std::string>&) { return std::nullopt; };
    return listing;
}

} // namespace

std::optional<Listing> list_scannetpp(const fs::path& folder) {
    const fs::path file = folder / "pose_intrinsic_imu.json";
    const auto depths = depth_images_in(folder_named(folder, {"depth"}));
    if (depths.empty())
        return list_depth_bin(folder);
    if (!is_file(file))
        return std::nullopt;
    const Json all = json_in(file);
    const auto colours = colour_images_in(folder_named(folder, {"rgb"}));
    const cv::Size of_colour = colours.empty() ? cv::Size(1920, 1440) : peek_size(colours.front());
    const ImagesByStem by_stem(colours);
    Listing listing = listing_of_phone("ScanNet++");
    tell_ignored(folder, {"rgb_mask.mkv", "rgb_masks"}, listing.capture.warnings);
    if (colours.empty())
        listing.capture.warnings.push_back(folder.string() + ": there is no rgb/; no colour.");
    for (const fs::path& depth : depths) {
        CaptureEntry entry;
        entry.name = depth.stem().string();
        entry.depth = depth;
        entry.colour = by_stem.of(entry.name);
        take_facts(entry, all, file, of_colour, peek_size(depth));
        listing.capture.entries.push_back(std::move(entry));
    }
    settle_own_cameras(listing);
    return listing;
}

} // namespace scanshade
