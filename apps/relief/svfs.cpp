#include "apps/relief/svfs.h"

#include "io/file_bytes.h"
#include "io/output_file.h"
#include "projection/base/error.h"

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <fmt/format.h>
#include <system_error>
#include <unistd.h>
#include <vector>
#include <zlib.h>

namespace scanshade::relief {

namespace fs = std::filesystem;
using horizon::Sky;

namespace {

constexpr std::array vegetation{"svfveg",  "svfNveg",  "svfEveg",  "svfSveg",  "svfWveg",
                                "svfaveg", "svfNaveg", "svfEaveg", "svfSaveg", "svfWaveg"};

/// Files of a zip, stored as they are (PKWARE's APPNOTE 6.3: 4.3.7, 4.3.12, 4.3.16).
class Zip {
  public:
    explicit Zip(const fs::path& file) : stream_(std::fopen(file.c_str(), "wb"), &std::fclose) {
        if (!stream_)
            throw std::system_error(errno, std::generic_category(), "cannot be created");
    }

    void add(const std::string& name, const fs::path& content) {
        const FileBytes bytes(content);
        constexpr std::uint64_t at_once = 1 << 24;
        uLong sum = ::crc32(0, nullptr, 0);
        const auto by_parts = [&](const auto& take) {
            for (std::uint64_t at = 0; at < bytes.size(); at += at_once)
                take(bytes.bytes(at, std::min(at_once, bytes.size() - at)));
        };
        by_parts([&](const std::string& part) {
            sum = ::crc32(sum, reinterpret_cast<const Bytef*>(part.data()), static_cast<uInt>(part.size()));
        });
        constexpr std::uint64_t version = 20, first_of_1980 = 33; // a date that each run has
        const std::string entry = words({{version, 2},
                                         {0, 2},
                                         {0, 2},
                                         {0, 2},
                                         {first_of_1980, 2},
                                         {sum, 4},
                                         {bytes.size(), 4},
                                         {bytes.size(), 4},
                                         {name.size(), 2},
                                         {0, 2}});
        directory_ +=
            "PK\1\2" + words({{version, 2}}) + entry + words({{0, 2}, {0, 2}, {0, 2}, {0, 4}, {at_, 4}}) + name;
        ++count_;
        write("PK\3\4" + entry + name);
        by_parts([&](const std::string& part) { write(part); });
    }

    void finish() {
        const std::uint64_t begin = at_;
        write(directory_);
        write("PK\5\6" + words({{0, 2}, {0, 2}, {count_, 2}, {count_, 2}, {directory_.size(), 4}, {begin, 4}, {0, 2}}));
        if (std::fflush(stream_.get()) != 0)
            throw std::system_error(errno, std::generic_category(), "cannot be written");
    }

  private:
    struct Word {
        std::uint64_t value;
        int bytes;
    };
    static std::string words(std::initializer_list<Word> all) {
        std::string text;
        for (const Word& word : all)
            for (int i = 0; i < word.bytes; ++i)
                text += static_cast<char>(word.value >> (8 * i) & 255);
        return text;
    }
    void write(const std::string& bytes) {
        if (std::fwrite(bytes.data(), 1, bytes.size(), stream_.get()) != bytes.size())
            throw std::system_error(errno, std::generic_category(), "cannot be written");
        at_ += bytes.size();
    }

    std::unique_ptr<std::FILE, int (*)(std::FILE*)> stream_;
    std::string directory_;
    std::uint64_t at_ = 0, count_ = 0;
};

} // namespace

const std::array<SvfsView, 5>& svfs_views() {
    static const std::array<SvfsView, 5> views{SvfsView{"svf", Sky::whole}, SvfsView{"svfN", Sky::north},
                                               SvfsView{"svfE", Sky::east}, SvfsView{"svfS", Sky::south},
                                               SvfsView{"svfW", Sky::west}};
    return views;
}

struct SvfsZip::Parts {
    fs::path zip, folder; ///< of the GeoTIFFs, until the zip has them
    std::vector<rasters::RasterWriter> views{};
    rasters::RasterWriter open;

    [[nodiscard]] fs::path file(const std::string& name) const { return folder / (name + ".tif"); }
};

SvfsZip::SvfsZip(fs::path zip, cv::Size size, const rasters::Grid& grid, const rasters::RasterText& text) {
    constexpr double most_bytes = 4e9;                       // of numbers of 32 bits, give or take directories
    constexpr double a_cell = 4.0 / 3 * sizeof(float) * 1.4; // with overviews, where LZW gains nothing
    if (size.width * double(size.height) * a_cell * 5 > most_bytes)
        throw Error(fmt::format("{}: views of {}x{} cells may not fit into a zip of 4 GiB; cut the raster into parts",
                                zip.string(), size.width, size.height));
    const fs::path folder = fs::path(zip).replace_extension(fmt::format("tmp-{}", ::getpid()));
    const auto writer = [&](const std::string& name) {
        return rasters::RasterWriter(folder / (name + ".tif"), size, CV_32FC1, grid, text);
    };
    parts_.reset(new Parts{std::move(zip), folder, {}, writer("open")});
    for (const SvfsView& view : svfs_views())
        parts_->views.push_back(writer(view.name));
}

SvfsZip::~SvfsZip() {
    std::error_code ignored;
    fs::remove_all(parts_->folder, ignored);
}

void SvfsZip::write(std::size_t view, const cv::Mat& rows) {
    parts_->views[view].write(rows);
    if (view == 0)
        parts_->open.write(cv::Mat1f(rows.size(), 1.0F));
}

void SvfsZip::finish() {
    const UnsyncedFolder unsynced(parts_->folder);
    for (rasters::RasterWriter& view : parts_->views)
        view.finish();
    parts_->open.finish();
    write_atomically(parts_->zip, [&](const fs::path& temporary) {
        Zip zip(temporary);
        for (const SvfsView& view : svfs_views())
            zip.add(view.name + ".tif", parts_->file(view.name));
        for (const char* name : vegetation)
            zip.add(std::string(name) + ".tif", parts_->file("open"));
        zip.finish();
    });
}

} // namespace scanshade::relief
