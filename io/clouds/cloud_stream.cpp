// Blocks of records, read and written one after the other.
#include "io/clouds/cloud_stream.h"

#include "io/clouds/format.h"
#include "io/file_bytes.h"
#include "io/output_file.h"
#include "projection/base/error.h"

#include <algorithm>
#include <cerrno>
#include <fcntl.h>
#include <fmt/format.h>
#include <system_error>
#include <tbb/parallel_for.h>
#include <unistd.h>
#include <utility>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t block_bytes = 4 << 20;

/// A new file, written from front to back.
class Sink {
  public:
    explicit Sink(const fs::path& file)
        : handle_(::open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666)) {
        if (handle_ < 0)
            fail();
    }
    ~Sink() {
        if (handle_ >= 0)
            ::close(handle_);
    }
    Sink(const Sink&) = delete;
    Sink& operator=(const Sink&) = delete;

    void put(std::string_view bytes) {
        while (!bytes.empty()) {
            const ssize_t done = ::write(handle_, bytes.data(), bytes.size());
            if (done < 0 && errno == EINTR)
                continue;
            if (done < 0)
                fail();
            bytes.remove_prefix(static_cast<std::size_t>(done));
        }
    }
    /// In place of bytes that were written.
    void put_at(std::uint64_t place, std::string_view bytes) {
        if (::lseek(handle_, static_cast<off_t>(place), SEEK_SET) < 0)
            fail();
        put(bytes);
    }
    void close() {
        if (::close(std::exchange(handle_, -1)) != 0)
            fail();
    }

  private:
    [[noreturn]] static void fail() { throw std::system_error(errno, std::generic_category()); }
    int handle_;
};

std::vector<AddedField> added_fields(const std::vector<std::string>& names,
                                     const std::vector<std::vector<float>>& values) {
    std::vector<AddedField> added;
    for (std::size_t k = 0; k < names.size(); ++k)
        added.push_back({names[k], values[k]});
    return added;
}

} // namespace

std::optional<CloudShape> cloud_shape(const fs::path& path, std::vector<std::string>& warnings) {
    const FileBytes file(path);
    constexpr std::uint64_t enough = 4096;
    const CloudFormat* format = cloud_format(file.bytes(0, std::min(file.size(), enough)), path);
    if (!format)
        return std::nullopt;
    CloudShape shape;
    if (format->shape)
        shape = format->shape(file, warnings);
    else
        shape.whole_since = fmt::format("{} is read as a whole", format->name);
    shape.records.format = format;
    return shape;
}

CloudStream::CloudStream(fs::path file, CloudShape shape) : file_(std::move(file)), shape_(std::move(shape)) {}

CloudRecords CloudStream::empty_block() const {
    const CloudRecords& all = shape_.records;
    CloudRecords block;
    block.format = all.format;
    block.encoding = all.encoding;
    block.fields = all.fields;
    block.stride = all.stride;
    block.scale = all.scale;
    block.shift = all.shift;
    block.colour_step = all.colour_step;
    return block;
}

std::optional<Eigen::AlignedBox3d> CloudStream::box() const {
    if (shape_.box)
        return shape_.box;
    constexpr std::size_t looks = 64, at_once = 2048;
    const FileBytes file(file_);
    CloudRecords block = empty_block();
    Eigen::AlignedBox3d box;
    const std::size_t all = size(), step = std::max(at_once, all / looks);
    for (std::size_t first = 0; first < all && shape_.chunks.empty(); first += step) {
        block.point_count = std::min(at_once, all - first);
        block.points = file.bytes(shape_.at + std::uint64_t(first) * block.stride, block.point_count * block.stride);
        PointOddities odd;
        for (const Eigen::Vector3d& point : points_of(block, odd))
            if (point.allFinite())
                box.extend(point);
    }
    return box.isEmpty() ? std::nullopt : std::optional(box);
}

void CloudStream::pass(const Visit& visit) const {
    const FileBytes file(file_);
    const CloudRecords& all = shape_.records;
    CloudRecords block = empty_block();
    if (!shape_.chunks.empty() || all.encoding == CloudRecords::Encoding::compressed)
        return pass_chunks(file, block, visit);
    const std::size_t at_once = std::max<std::size_t>(1, block_bytes / all.stride);
    for (std::size_t first = 0; first < all.point_count; first += at_once) {
        block.point_count = std::min(at_once, all.point_count - first);
        block.points = file.bytes(shape_.at + std::uint64_t(first) * all.stride, block.point_count * all.stride);
        visit(first, block);
    }
}

/// Several chunks at once, so that all cores unpack.
void CloudStream::pass_chunks(const FileBytes& file, CloudRecords& block, const Visit& visit) const {
    const std::vector<laz::Chunk>& chunks = shape_.chunks;
    for (std::size_t k = 0; k < chunks.size();) {
        std::size_t end = k;
        for (std::uint64_t bytes = 0; end < chunks.size() && (end == k || bytes < block_bytes); ++end)
            bytes += chunks[end].count * block.stride;
        std::vector<std::string> points(end - k);
        during(file_.string(), [&] {
            tbb::parallel_for(std::size_t(0), points.size(), [&](std::size_t i) {
                const laz::Chunk& chunk = chunks[k + i];
                points[i] = laz::unpacked_chunk(file.bytes(chunk.begin, chunk.bytes), chunk, k + i, shape_.packing);
            });
        });
        block.points.clear();
        for (const std::string& part : points)
            block.points += part;
        block.point_count = block.points.size() / block.stride;
        visit(chunks[k].first, block);
        k = end;
    }
}

void CloudStream::write(const fs::path& target, const std::vector<std::string>& names,
                        const std::function<BlockValues(std::size_t, const CloudRecords&)>& values) const {
    const auto write_to = [&](const fs::path& temporary) {
        Sink sink(temporary);
        bool begun = false;
        const bool packs = shape_.records.encoding == CloudRecords::Encoding::compressed;
        std::optional<LazHead> laz;
        std::optional<laz::Packer> packer;
        const auto begin = [&](const CloudEdit& edit) {
            const CloudRecords& all = shape_.records;
            begun = true;
            if (packs) {
                laz = laz_head(all, edit.additions, shape_.end);
                packer.emplace(packer_of(*laz));
                sink.put(laz->header + std::string(8, '\0'));
                return;
            }
            sink.put(all.format->written == &las_bytes ? las_head(all, edit.additions, shape_.end)
                                                       : all.format->written(all, {}, edit.additions));
        };
        pass([&](std::size_t first, const CloudRecords& block) {
            const BlockValues found = values(first, block);
            const CloudEdit edit = edit_of(block, added_fields(names, found.fields), found.colours);
            if (!begun)
                begin(edit);
            const std::string points = edited_points(block, edit.replacements, edit.additions);
            sink.put(packs ? packer->add(points) : points);
        });
        if (!begun) {
            CloudRecords none;
            none.format = shape_.records.format;
            none.fields = shape_.records.fields;
            none.stride = shape_.records.stride;
            begin(edit_of(none, added_fields(names, std::vector<std::vector<float>>(names.size())), {}));
        }
        if (packs) {
            sink.put(packer->finish());
            finish(*laz, *packer);
            sink.put(laz->after);
            sink.put_at(0, laz->header + packer->table(laz->header.size()));
            sink.close();
            return;
        }
        const FileBytes file(file_);
        for (std::uint64_t at = shape_.end; at < file.size(); at += block_bytes)
            sink.put(file.bytes(at, std::min<std::uint64_t>(block_bytes, file.size() - at)));
        sink.close();
    };
    write_atomically(target, write_to);
}

} // namespace scanshade
