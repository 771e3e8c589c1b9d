// Frames as NumPy arrays: a stack in an .npy file, or in an .npz archive with cameras and poses beside it.
#include "io/captures/listing/layouts.h"

#include "io/captures/listing/trajectory.h"
#include "io/compression/zip_archive.h"
#include "io/images/npy_array.h"
#include "io/text.h"
#include "projection/base/error.h"
#include "projection/base/memory.h"

#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

constexpr std::uint64_t most_frames = 1 << 22;

/// An array in a file, or in a member of an archive.
class ArrayBytes {
  public:
    explicit ArrayBytes(std::shared_ptr<const FileBytes> file)
        : name_(file->path().string()), file_(std::move(file)), array_(header()) {}
    ArrayBytes(std::shared_ptr<const ZipArchive> archive, const ZipMember& member)
        : name_(fmt::format("{}: {}", archive->path().string(), member.name)), archive_(std::move(archive)),
          member_(std::make_unique<ZipMemberStream>(*archive_, member)), array_(header()) {}

    [[nodiscard]] const NpyArray& array() const { return array_; }
    [[nodiscard]] const std::string& name() const { return name_; }
    /// Of its elements.
    [[nodiscard]] std::string bytes(std::uint64_t at, std::uint64_t count) const {
        return raw(array_.data + at, count);
    }
    [[nodiscard]] std::vector<double> numbers() const {
        constexpr std::uint64_t most = most_frames * 16;
        if (array_.count() > most)
            throw Error(fmt::format("{}: {}, expected at most {}", name_, counted(array_.count(), "number"), most));
        if (array_.column_major && array_.shape.size() > 1)
            throw Error(name_ + ": in Fortran's order, expected C's");
        return npy_numbers(bytes(0, array_.bytes()), array_);
    }

  private:
    [[nodiscard]] std::uint64_t size() const { return file_ ? file_->size() : member_->size(); }
    [[nodiscard]] std::string raw(std::uint64_t at, std::uint64_t count) const {
        return file_ ? file_->bytes(at, count) : member_->bytes(at, count);
    }
    [[nodiscard]] NpyArray header() const {
        NpyArray array = npy_array_in(raw(0, std::min(size(), most_npy_header)), name_);
        if (const std::uint64_t found = size() - array.data; found != array.bytes())
            throw Error(fmt::format("{}: an array of {} needs {} bytes of elements, found {}", name_,
                                    fmt::join(array.shape, "x"), array.bytes(), found));
        return array;
    }

    std::string name_;
    std::shared_ptr<const FileBytes> file_;
    std::shared_ptr<const ZipArchive> archive_;
    std::unique_ptr<ZipMemberStream> member_;
    NpyArray array_;
};

/// An array as images, one after the other.
struct Stack {
    std::unique_ptr<ArrayBytes> array;
    std::uint64_t frames = 0, channels = 1;
    cv::Size size;

    [[nodiscard]] std::string bytes(std::size_t place) const {
        const std::uint64_t each = static_cast<std::uint64_t>(size.area()) * channels * array->array().element_bytes;
        return array->bytes(place * each, each);
    }
};

/// (H,W), (H,W,1) or (N,H,W), and with colours (H,W,3) or (N,H,W,3).
Stack stack_of(std::unique_ptr<ArrayBytes> array, bool colours) {
    std::vector<std::uint64_t> shape = array->array().shape;
    const std::string& name = array->name();
    Stack stack;
    if (colours &&
        (shape.size() < 3 || shape.back() != 3 || array->array().kind != 'u' || array->array().element_bytes != 1))
        throw Error(fmt::format("{}: {}{} of {}, expected u1 of (H,W,3) or (N,H,W,3)", name, array->array().kind,
                                array->array().element_bytes, fmt::join(shape, "x")));
    if (colours)
        stack.channels = 3;
    if ((colours || shape.size() > 3 || (shape.size() == 3 && shape[2] == 1)) && !shape.empty() &&
        shape.back() == stack.channels)
        shape.pop_back();
    if (shape.size() == 2)
        shape.insert(shape.begin(), 1);
    if (shape.size() != 3)
        throw Error(
            fmt::format("{}: an array of {}, expected (H,W) or (N,H,W)", name, fmt::join(array->array().shape, "x")));
    if (array->array().column_major && shape[0] != 1)
        throw Error(name + ": a stack in Fortran's order, expected C's");
    if (shape[0] == 0 || shape[0] > most_frames)
        throw Error(fmt::format("{}: {}, expected 1 to {}", name, counted(shape[0], "frame"), most_frames));
    stack.frames = shape[0];
    stack.size = image_check::checked_size(shape[2], shape[1], name);
    stack.array = std::move(array);
    return stack;
}

class Arrays final : public FrameContainer {
  public:
    [[nodiscard]] cv::Mat image(Part part, std::size_t place) const override {
        if (part == Part::depth)
            return during(where(depth, place),
                          [&] { return npy_image(depth.bytes(place), depth.array->array(), depth.size); });
        const std::string bytes = colour.bytes(place);
        cv::Mat3b image(colour.size);
        if (colour.array->array().column_major)
            throw Error(where(colour, place) + ": in Fortran's order, expected C's");
        for (std::size_t i = 0; i < image.total(); ++i)
            image(static_cast<int>(i) / image.cols, static_cast<int>(i) % image.cols) =
                cv::Vec3b(static_cast<uchar>(bytes[i * 3 + 2]), static_cast<uchar>(bytes[i * 3 + 1]),
                          static_cast<uchar>(bytes[i * 3]));
        return image;
    }
    [[nodiscard]] cv::Size size(Part part, std::size_t /*place*/) const override {
        return part == Part::depth ? depth.size : colour.size;
    }

    Stack depth, colour;

  private:
    static std::string where(const Stack& stack, std::size_t place) {
        return fmt::format("{}: frame {}", stack.array->name(), place);
    }
};

/// Floats are metres by custom, integers millimetres.
DepthEncoding encoding_of(const NpyArray& depth) {
    if (depth.kind == 'f')
        return usual_encoding("m", "assumed: floats are metres");
    return depth.element_bytes == 2 && depth.kind == 'u'
               ? usual_encoding("mm", "assumed: 16-bit integers are millimetres")
               : usual_encoding("1000", "assumed: integers are millimetres");
}

Listing listing_of(const std::shared_ptr<Arrays>& arrays, const fs::path& path) {
    Listing listing;
    Capture& capture = listing.capture;
    capture.depth = encoding_of(arrays->depth.array->array());
    capture.registration_reason = arrays->colour.array ? "arrays do not say" : "there is no colour";
    for (std::size_t i = 0; i < arrays->depth.frames; ++i) {
        CaptureEntry entry;
        entry.name = fmt::format("{:06}", i);
        entry.depth = path.string();
        if (i < arrays->colour.frames)
            entry.colour = path.string();
        entry.container = arrays;
        entry.place = i;
        capture.entries.push_back(std::move(entry));
    }
    listing.find_camera = [](cv::Size, std::vector<std::string>&) { return std::nullopt; };
    return listing;
}

/// The 4x4 or 3x3 matrices of an array, one after the other.
std::vector<Eigen::Matrix4d> matrices_in(const ArrayBytes& array) {
    const std::vector<std::uint64_t>& shape = array.array().shape;
    const std::size_t n = shape.size();
    const bool sound = (n == 2 || n == 3) && (shape[n - 2] == 3 || shape[n - 2] == 4) &&
                       (shape[n - 1] == 3 || shape[n - 1] == 4) && shape[n - 1] >= shape[n - 2];
    if (!sound)
        throw Error(fmt::format("{}: an array of {}, expected matrices of 3x3, 3x4 or 4x4", array.name(),
                                fmt::join(shape, "x")));
    const auto rows = static_cast<int>(shape[n - 2]), columns = static_cast<int>(shape[n - 1]);
    const std::vector<double> numbers = array.numbers();
    std::vector<Eigen::Matrix4d> matrices;
    for (std::size_t at = 0; at < numbers.size(); at += static_cast<std::size_t>(rows * columns)) {
        Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
        matrix.topLeftCorner(rows, columns) =
            Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
                numbers.data() + at, rows, columns);
        matrices.push_back(matrix);
    }
    return matrices;
}

/// An archive's arrays by their keys.
class Keys {
  public:
    explicit Keys(std::shared_ptr<const ZipArchive> archive) : archive_(std::move(archive)) {}
    /// The array of the first of these keys that is there; null where none is.
    [[nodiscard]] std::unique_ptr<ArrayBytes> first_of(std::initializer_list<const char*> keys) const {
        for (const char* key : keys)
            if (const ZipMember* member = archive_->find(std::string(key) + ".npy"))
                return std::make_unique<ArrayBytes>(archive_, *member);
        return nullptr;
    }

  private:
    std::shared_ptr<const ZipArchive> archive_;
};

void take_cameras(Listing& listing, const ArrayBytes& array, cv::Size size) {
    std::vector<Eigen::Matrix4d> matrices = matrices_in(array);
    Capture& capture = listing.capture;
    const auto camera_of = [&](const Eigen::Matrix4d& k) {
        return Camera{{k(0, 0), k(1, 1), k(0, 2), k(1, 2), size}, {}, array.name()};
    };
    if (matrices.size() == 1) {
        listing.find_camera = [camera = camera_of(matrices.front())](cv::Size, std::vector<std::string>&) {
            CameraFile file;
            file.camera = camera;
            return file;
        };
        return;
    }
    if (matrices.size() != capture.entries.size())
        throw Error(
            fmt::format("{}: {} cameras, expected 1 or {}", array.name(), matrices.size(), capture.entries.size()));
    for (std::size_t i = 0; i < matrices.size(); ++i) {
        auto camera = std::make_shared<Camera>(camera_of(matrices[i]));
        camera->origin += fmt::format(" [{}]", i);
        try {
            check(*camera);
            capture.entries[i].camera = std::move(camera);
        } catch (const Error& failure) {
            capture.entries[i].problem = failure.what();
        }
    }
    settle_own_cameras(listing);
}

void take_poses(Capture& capture, const ArrayBytes& array) {
    const std::vector<Eigen::Matrix4d> matrices = matrices_in(array);
    capture.warnings.push_back(
        fmt::format("{}: taken as camera to world, with x right, y down, z forward; it does not say.", array.name()));
    if (matrices.size() != capture.entries.size())
        capture.warnings.push_back(
            fmt::format("{}: {} poses for {} frames.", array.name(), matrices.size(), capture.entries.size()));
    for (std::size_t i = 0; i < std::min(matrices.size(), capture.entries.size()); ++i) {
        CaptureEntry& entry = capture.entries[i];
        MatrixPose pose = checked_pose(matrices[i], fmt::format("{} [{}]", array.name(), i));
        entry.world_from_camera = pose.world_from_camera;
        for (std::string* sentence : {&pose.warning, &pose.problem})
            if (!sentence->empty())
                entry.warnings.push_back(std::move(*sentence));
    }
}

} // namespace

bool is_npy_stack(std::string_view start) {
    if (!is_npy(start))
        return false;
    try {
        const auto shape = npy_array_in(start, "").shape;
        return shape.size() == 3 && shape[0] > 1 && shape[2] > 4;
    } catch (const Error&) { // reading it as an image will say why
        return false;
    }
}

Listing list_npy_stack(const fs::path& file) {
    auto arrays = std::make_shared<Arrays>();
    arrays->depth = stack_of(std::make_unique<ArrayBytes>(std::make_shared<FileBytes>(file)), false);
    Listing listing = listing_of(arrays, file);
    listing.find_camera = [file](cv::Size, std::vector<std::string>& warnings) {
        return camera_in(fs::absolute(file).parent_path(), warnings);
    };
    return listing;
}

Listing list_npz(const std::shared_ptr<const ZipArchive>& archive) {
    const fs::path& path = archive->path();
    const Keys keys(archive);
    auto depth = keys.first_of({"depth", "depths", "depth_map", "arr_0"});
    if (!depth) {
        std::vector<std::string_view> found;
        for (const ZipMember& member : archive->members())
            if (found.size() < 20)
                found.push_back(member.name);
        throw Error(fmt::format("{}: no array depth, depths, depth_map or arr_0; it has {}", path.string(),
                                in_quotes(fmt::format("{}", fmt::join(found, ", ")))));
    }
    auto arrays = std::make_shared<Arrays>();
    arrays->depth = stack_of(std::move(depth), false);
    std::vector<std::string> warnings;
    try {
        if (auto colour = keys.first_of({"rgb", "image", "images", "color"}))
            arrays->colour = stack_of(std::move(colour), true);
    } catch (const Outage&) {
        throw;
    } catch (const Error& failure) {
        warnings.push_back(fmt::format("{}; no colour.", failure.what()));
    }
    Listing listing = listing_of(arrays, path);
    Capture& capture = listing.capture;
    if (!archive->damage().empty())
        capture.warnings.push_back(archive->damage() + ".");
    capture.warnings.insert(capture.warnings.end(), warnings.begin(), warnings.end());
    if (const auto scale = keys.first_of({"depth_scale"})) {
        const std::vector<double> units = scale->numbers();
        if (units.size() != 1 || !(units[0] > 0) || !std::isfinite(units[0]))
            throw Error(fmt::format("{}: {}, expected one positive number of units per metre", scale->name(),
                                    units.size() == 1 ? fmt::format("{}", units[0]) : counted(units.size(), "number")));
        capture.depth = depth_encoding(fmt::format("{}", units[0]), "the archive's depth_scale");
    }
    if (const auto cameras = keys.first_of({"K", "intrinsics", "intrinsic", "camera_matrix"}))
        take_cameras(listing, *cameras, arrays->depth.size);
    if (const auto poses = keys.first_of({"poses", "pose", "c2w", "extrinsics", "world_from_camera"}))
        take_poses(capture, *poses);
    return listing;
}

Listing list_zip(const fs::path& file) {
    auto archive = std::make_shared<ZipArchive>(file);
    const auto any = [&](const auto& wanted) { return std::ranges::any_of(archive->members(), wanted); };
    if (any([](const ZipMember& member) { return member.name.ends_with(".npy"); }))
        return list_npz(archive);
    if (any([](const ZipMember& member) { return member.name.starts_with("rgbd/"); }))
        return list_record3d(archive);
    throw NoFrames(fmt::format("{}: a zip archive of {}, expected NumPy arrays (.npz) or a Record3D recording (.r3d){}",
                               file.string(), counted(archive->members().size(), "whole member"),
                               archive->damage().empty() ? "" : "; the file is cut or damaged"));
}

} // namespace scanshade
