// Snapshots of RealSense Viewer: for each stream NAME.png to look at, NAME.raw with the numbers, and a table.
#include "io/captures/listing/layouts.h"

#include "io/file_bytes.h"
#include "io/files.h"
#include "io/images/image_check.h"
#include "io/text.h"
#include "projection/base/error.h"
#include "projection/base/memory.h"

#include <cstring>
#include <fmt/format.h>
#include <map>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

/// "Resolution x,160": the value of a row of two cells.
std::map<std::string, std::string> rows_of(const std::string& table) {
    std::map<std::string, std::string> rows;
    for (const TextLine& line : text_lines(table))
        if (const std::size_t comma = line.text.find(','); comma != std::string_view::npos)
            rows.emplace(trimmed(line.text.substr(0, comma)), trimmed(line.text.substr(comma + 1)));
    return rows;
}

/// One image of 16-bit integers without a header, whose size its table tells.
class RawImage final : public FrameContainer {
  public:
    RawImage(const fs::path& file, cv::Size size) : file_(file), size_(size) {}

    [[nodiscard]] cv::Mat image(Part, std::size_t) const override {
        const std::size_t expected = static_cast<std::size_t>(size_.area()) * sizeof(ushort);
        require_memory(expected, fmt::format("{}: an image of {} bytes", file_.string(), expected));
        const std::string bytes = read_bytes(file_, expected + 1);
        if (bytes.size() != expected)
            throw Error(fmt::format("{}: {}{}, expected {} for {}x{} pixels of 16 bits", file_.string(),
                                    bytes.size() > expected ? "more than " : "",
                                    counted(std::min(bytes.size(), expected), "byte"), expected, size_.width,
                                    size_.height));
        cv::Mat1w image(size_);
        std::memcpy(image.data, bytes.data(), expected);
        return image;
    }
    [[nodiscard]] cv::Size size(Part, std::size_t) const override { return size_; }

  private:
    fs::path file_;
    cv::Size size_;
};

/// Depth, if the table says so; of a colour stream or another type, nothing.
std::optional<CaptureEntry> depth_in(const fs::path& raw, const fs::path& table) {
    const std::map<std::string, std::string> rows = rows_of(read_list_file(table));
    const auto value = [&](const char* key) {
        const auto found = rows.find(key);
        return found == rows.end() ? std::string() : found->second;
    };
    if (value("Format") != "Z16" && value("Stream") != "Depth")
        return std::nullopt;
    CaptureEntry entry;
    entry.name = raw.stem().string();
    entry.depth = raw.string();
    const auto width = whole_number(value("Resolution x")), height = whole_number(value("Resolution y"));
    if (!width || !height || *width == 0 || *height == 0)
        throw Error(table.string() + ": no \"Resolution x\" and \"Resolution y\", without which the .raw has no size");
    entry.container = std::make_shared<RawImage>(raw, image_check::checked_size(*width, *height, table));
    return entry;
}

} // namespace

std::optional<Listing> list_viewer_snapshots(const fs::path& folder) {
    Listing listing;
    fs::path first_table;
    for (const fs::path& raw : files_in(folder)) {
        const fs::path table = folder / (raw.stem().string() + "_metadata.csv");
        if (lower_extension(raw) != ".raw" || !is_file(table))
            continue;
        if (auto entry = depth_in(raw, table)) {
            if (first_table.empty())
                first_table = table;
            listing.capture.entries.push_back(*std::move(entry));
        }
    }
    if (listing.capture.entries.empty())
        return std::nullopt;
    listing.capture.depth = usual_encoding("mm", "RealSense Viewer snapshot: its usual unit");
    listing.capture.registration_reason = "the snapshot's colour was taken by another camera, and is not used";
    listing.find_camera = [first_table](cv::Size, std::vector<std::string>&) -> std::optional<CameraFile> {
        return read_camera_file(first_table);
    };
    return listing;
}

} // namespace scanshade
