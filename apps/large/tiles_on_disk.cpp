// Chunks of records in one file, and a file of values for each tile.
#include "apps/large/tiles_on_disk.h"

#include "io/content_hash.h"
#include "io/file_bytes.h"
#include "io/output_file.h"
#include "projection/base/error.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fcntl.h>
#include <fmt/format.h>
#include <limits>
#include <sys/file.h>
#include <system_error>
#include <unistd.h>
#include <utility>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

using Eigen::Vector3d, Eigen::Vector3f;

constexpr std::uint32_t in_rim = 0x80000000U; ///< of a record's number; readers have fewer points
constexpr std::string_view index_words = "scanshade tiles 2\n", values_words = "tile values 3\n\0\0";
constexpr std::size_t value_bytes = 14, shown_bytes = 16;

template <class Number>
void put(std::string& bytes, Number value) {
    char raw[sizeof(Number)];
    std::memcpy(raw, &value, sizeof raw);
    bytes.append(raw, sizeof raw);
}
template <class Number>
Number load(const char* from) {
    Number value;
    std::memcpy(&value, from, sizeof value);
    return value;
}

/// What a file of values begins with.
struct ValuesHead {
    std::uint64_t count = 0, shown = 0, round = 0, twins = 0, moved = 0, discs = 0, fitted_from = 0;
    float noise = 0;
    std::uint32_t flags = 0; ///< 1: checked, 2: on a GPU
};
constexpr std::size_t head_bytes = 16 + sizeof(ValuesHead);

ValuesHead head_of(const FileBytes& file) {
    const std::string bytes = file.bytes(0, std::min<std::uint64_t>(head_bytes, file.size()));
    const auto head = bytes.size() < head_bytes ? ValuesHead() : load<ValuesHead>(bytes.data() + 16);
    const std::uint64_t most = file.size() / value_bytes + 1;
    if (bytes.size() < head_bytes || !std::string_view(bytes).starts_with(values_words) || head.count > most ||
        head.shown > most || file.size() != head_bytes + shown_bytes * head.shown + value_bytes * head.count)
        throw Error(fmt::format("{}: damaged (values of a tile)", file.path().string()));
    return head;
}

[[noreturn]] void fail(const fs::path& file, const char* what) {
    throw Outage(fmt::format("{}: {}: {}", file.string(), what, std::generic_category().message(errno)));
}

std::string gib(double bytes) { return fmt::format("{:.3g} GiB", bytes / (1024.0 * 1024 * 1024)); }

} // namespace

TilesOnDisk::TilesOnDisk(fs::path folder, std::string key, std::size_t source_points, std::uint64_t output_bytes,
                         std::size_t buffers, std::function<void(const std::string&)> say, bool helps)
    : folder_(std::move(folder)), key_(std::move(key)), source_points_(source_points), output_bytes_(output_bytes),
      buffers_(buffers), say_(std::move(say)), helps_(helps) {}

TilesOnDisk::~TilesOnDisk() {
    release();
    if (handle_ >= 0)
        ::close(handle_);
}

std::size_t TilesOnDisk::record_bytes() const { return normals_ ? 40 : 28; }
fs::path TilesOnDisk::values_file(std::size_t tile) const { return folder_ / fmt::format("values-{}", tile); }

bool TilesOnDisk::begin(const std::string& plan, std::size_t tiles, bool normals, double copies, std::string& decided) {
    normals_ = normals;
    tiles_.assign(tiles, {});
    whole_key_ = hash_of(key_ + "\n" + plan);
    if (read_index(whole_key_, decided)) {
        std::size_t done = 0;
        for (std::size_t tile = 0; tile < tiles; ++tile)
            done += fs::exists(values_file(tile));
        if (say_)
            say_(fmt::format("{} {} of {}: {} of {} tiles are done.", helps_ ? "helps with" : "goes on with",
                             folder_.string(), helps_ ? "another process" : "an earlier run", done, tiles - 1));
        open(false);
        return true;
    }
    if (helps_)
        throw Outage(folder_.string() + ": tiles of other points or settings, or by another device: no help with them");
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
    require_space(copies);
    fs::create_directories(folder_);
    open(true);
    constexpr std::size_t least = 4096, most = 1 << 20;
    chunk_bytes_ =
        std::clamp(buffers_ / std::max<std::size_t>(tiles, 1), least, most) / record_bytes() * record_bytes();
    return false;
}

void TilesOnDisk::require_space(double copies) const {
    const double points = static_cast<double>(source_points_);
    const double needed = points * (copies * static_cast<double>(record_bytes()) + value_bytes) +
                          static_cast<double>(shown_bytes) * std::min(points, 1e6);
    fs::path there = folder_;
    while (!fs::exists(there) && there.has_parent_path() && there != there.parent_path())
        there = there.parent_path();
    const double free = static_cast<double>(fs::space(there.empty() ? "." : there).available);
    const std::string sentence =
        fmt::format("{} of temporary files in {}, and {} for the result; {} are free", gib(needed), folder_.string(),
                    gib(static_cast<double>(output_bytes_)), gib(free));
    if (needed + static_cast<double>(output_bytes_) > free)
        throw Error(sentence + ": too little. A larger --cloud.memory needs less; so does another -o with more space");
    if (say_)
        say_(sentence + ".");
}

void TilesOnDisk::open(bool anew) {
    const fs::path file = folder_ / "points";
    handle_ = ::open(file.c_str(), O_RDWR | O_CLOEXEC | (anew ? O_CREAT | O_TRUNC : 0), 0666);
    if (handle_ < 0)
        fail(file, "cannot be opened");
}

void TilesOnDisk::add(std::size_t tile, std::uint32_t number, const Vector3d& point, const Vector3f& normal,
                      bool core) {
    Tile& to = tiles_[tile];
    put(to.waiting, core ? number : number | in_rim);
    for (const double along : point)
        put(to.waiting, along);
    if (normals_)
        for (const float along : normal)
            put(to.waiting, along);
    if (to.waiting.size() >= chunk_bytes_)
        flush(to);
}

void TilesOnDisk::flush(Tile& tile) {
    if (tile.waiting.empty())
        return;
    tile.chunks.push_back({end_, static_cast<std::uint32_t>(tile.waiting.size() / record_bytes())});
    std::string_view bytes = tile.waiting;
    while (!bytes.empty()) {
        const ssize_t done = ::pwrite(handle_, bytes.data(), bytes.size(), static_cast<off_t>(end_));
        if (done < 0 && errno == EINTR)
            continue;
        if (done < 0)
            fail(folder_ / "points", "cannot be written");
        bytes.remove_prefix(static_cast<std::size_t>(done));
        end_ += static_cast<std::uint64_t>(done);
    }
    tile.waiting.clear();
}

void TilesOnDisk::decide(const std::string& decided) {
    for (Tile& tile : tiles_) {
        flush(tile);
        tile.waiting = {};
    }
    if (::fdatasync(handle_) != 0 && errno != EINVAL)
        fail(folder_ / "points", "cannot be synced");
    std::string bytes(index_words);
    put(bytes, static_cast<std::uint64_t>(whole_key_.size()));
    bytes += whole_key_;
    put(bytes, static_cast<std::uint64_t>(decided.size()));
    bytes += decided;
    put(bytes, end_);
    put(bytes, static_cast<std::uint64_t>(tiles_.size()));
    for (const Tile& tile : tiles_) {
        put(bytes, static_cast<std::uint64_t>(tile.chunks.size()));
        for (const Chunk& chunk : tile.chunks)
            put(bytes, chunk.at), put(bytes, chunk.count);
    }
    write_atomically(folder_ / "index", bytes + hash_of(bytes));
}

/// Whether an earlier run's index is there, whole, and of the same key.
bool TilesOnDisk::read_index(const std::string& key, std::string& decided) {
    const fs::path file = folder_ / "index";
    if (!fs::exists(file))
        return false;
    const FileBytes index(file);
    const std::string all = index.bytes(0, index.size());
    constexpr std::size_t hash_length = 32;
    if (all.size() < index_words.size() + hash_length || !all.starts_with(index_words))
        return false;
    const std::string_view bytes = std::string_view(all).substr(0, all.size() - hash_length);
    if (hash_of(bytes) != std::string_view(all).substr(bytes.size()))
        return false;
    // The hash is right, so that this is what decide() wrote.
    std::size_t at = index_words.size();
    const auto number = [&] {
        const auto value = load<std::uint64_t>(bytes.data() + at);
        at += 8;
        return value;
    };
    const auto text = [&] {
        const std::size_t size = number();
        at += size;
        return std::string(bytes.substr(at - size, size));
    };
    if (text() != key)
        return false;
    decided = text();
    end_ = number();
    if (number() != tiles_.size() || !fs::exists(folder_ / "points") || fs::file_size(folder_ / "points") < end_)
        return false;
    for (Tile& tile : tiles_) {
        tile.chunks.resize(number());
        for (Chunk& chunk : tile.chunks) {
            chunk.at = number();
            chunk.count = load<std::uint32_t>(bytes.data() + at);
            at += 4;
        }
    }
    return true;
}

std::size_t TilesOnDisk::count(std::size_t tile) const {
    std::size_t all = tiles_[tile].waiting.size() / record_bytes();
    for (const Chunk& chunk : tiles_[tile].chunks)
        all += chunk.count;
    return all;
}

TilePoints TilesOnDisk::points(std::size_t tile) {
    const std::size_t all = count(tile), record = record_bytes();
    TilePoints points;
    points.numbers.reserve(all);
    points.points.reserve(all);
    points.in_core.reserve(all);
    if (normals_)
        points.normals.reserve(all);
    std::string bytes;
    for (const Chunk& chunk : tiles_[tile].chunks) {
        bytes.resize(chunk.count * record);
        for (std::size_t done = 0; done < bytes.size();) {
            const ssize_t got =
                ::pread(handle_, bytes.data() + done, bytes.size() - done, static_cast<off_t>(chunk.at + done));
            if (got < 0 && errno == EINTR)
                continue;
            if (got <= 0)
                fail(folder_ / "points", "cannot be read");
            done += static_cast<std::size_t>(got);
        }
        for (std::size_t k = 0; k < chunk.count; ++k) {
            const char* from = bytes.data() + k * record;
            const auto number = load<std::uint32_t>(from);
            points.numbers.push_back(number & ~in_rim);
            points.in_core.push_back((number & in_rim) == 0);
            points.points.emplace_back(load<double>(from + 4), load<double>(from + 12), load<double>(from + 20));
            if (normals_)
                points.normals.push_back(
                    Vector3f(load<float>(from + 28), load<float>(from + 32), load<float>(from + 36)).cast<double>());
        }
    }
    return points;
}

void TilesOnDisk::keep(std::size_t tile, TileValues values) {
    std::string bytes(values_words.substr(0, 16));
    bytes.resize(16, '\0');
    put(bytes,
        ValuesHead{values.numbers.size(), values.shown.size(), values.round, values.twins, values.moved, values.discs,
                   values.fitted_from, values.noise, (values.checked ? 1U : 0U) | (values.on_gpu ? 2U : 0U)});
    bytes.reserve(bytes.size() + value_bytes * values.numbers.size() + shown_bytes * values.shown.size());
    for (std::size_t k = 0; k < values.shown.size(); ++k) {
        put(bytes, values.shown[k]);
        for (const float along : values.normals[k])
            put(bytes, along);
    }
    for (std::size_t k = 0; k < values.numbers.size(); ++k) {
        put(bytes, values.numbers[k]);
        put(bytes, values.visibility[k]);
        put(bytes, values.error[k]);
        put(bytes, values.kept_signs.empty() ? KeptSigns() : values.kept_signs[k]);
    }
    write_atomically(values_file(tile), bytes);
}

bool TilesOnDisk::claim(std::size_t tile) {
    release();
    if (helps_ && fs::exists(values_file(tile)))
        return false;
    const fs::path file = folder_ / fmt::format("lock-{}", tile);
    lock_ = ::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    if (lock_ < 0 && errno == ENOENT && helps_) // the cloud is done
        return false;
    if (lock_ < 0)
        fail(file, "cannot be opened");
    if (::flock(lock_, LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK)
        return true;
    release();
    return false;
}

void TilesOnDisk::release() {
    if (lock_ >= 0)
        ::close(std::exchange(lock_, -1));
}

std::optional<TileValues> TilesOnDisk::values(std::size_t tile) {
    if (!fs::exists(values_file(tile)))
        return std::nullopt;
    const FileBytes file(values_file(tile));
    const ValuesHead head = head_of(file);
    const std::string bytes = file.bytes(head_bytes, file.size() - head_bytes);
    TileValues values;
    const char* from = bytes.data();
    for (std::uint64_t k = 0; k < head.shown; ++k, from += shown_bytes) {
        values.shown.push_back(load<std::uint32_t>(from));
        values.normals.emplace_back(load<float>(from + 4), load<float>(from + 8), load<float>(from + 12));
    }
    values.numbers.reserve(head.count), values.visibility.reserve(head.count), values.error.reserve(head.count);
    for (std::uint64_t k = 0; k < head.count; ++k, from += value_bytes) {
        values.numbers.push_back(load<std::uint32_t>(from));
        values.visibility.push_back(load<float>(from + 4));
        values.error.push_back(load<float>(from + 8));
        values.kept_signs.push_back(load<KeptSigns>(from + 12));
    }
    values.round = head.round, values.twins = head.twins, values.moved = head.moved, values.discs = head.discs;
    values.fitted_from = head.fitted_from, values.noise = head.noise;
    values.checked = (head.flags & 1U) != 0, values.on_gpu = (head.flags & 2U) != 0;
    return values;
}

/// One tile's values, read part by part.
class ValuesInOrder::Cursor {
  public:
    /// The file is open only while it is read: there may be more tiles than a process may have files open.
    Cursor(fs::path path, std::size_t buffered) : path_(std::move(path)), buffered_(buffered) {
        head_ = head_of(FileBytes(path_));
    }

    void seek(std::size_t first) {
        const FileBytes file(path_);
        std::uint64_t low = 0, high = head_.count;
        while (low < high) {
            const std::uint64_t middle = low + (high - low) / 2;
            if (number(file, middle) < first)
                low = middle + 1;
            else
                high = middle;
        }
        next_ = low;
        buffer_.clear();
        at_ = 0;
    }

    template <class Visit>
    void until(std::size_t end, Visit&& visit) {
        while (true) {
            if (at_ == buffer_.size() && !refill())
                return;
            const char* from = buffer_.data() + at_;
            const auto number = load<std::uint32_t>(from);
            if (number >= end)
                return;
            visit(number, load<float>(from + 4), load<float>(from + 8));
            at_ += value_bytes;
            ++next_;
        }
    }

    void shown(std::size_t first, std::size_t end, std::vector<Shown>& all) const {
        const FileBytes file(path_);
        const std::string bytes = file.bytes(head_bytes, shown_bytes * head_.shown);
        for (std::uint64_t k = 0; k < head_.shown; ++k) {
            const char* from = bytes.data() + k * shown_bytes;
            const std::uint32_t which = number(file, load<std::uint32_t>(from));
            if (which >= first && which < end)
                all.push_back({which, {load<float>(from + 4), load<float>(from + 8), load<float>(from + 12)}});
        }
    }

  private:
    [[nodiscard]] std::uint64_t place(std::uint64_t k) const {
        return head_bytes + shown_bytes * head_.shown + value_bytes * k;
    }
    [[nodiscard]] std::uint32_t number(const FileBytes& file, std::uint64_t k) const {
        return load<std::uint32_t>(file.bytes(place(k), 4).data());
    }
    bool refill() {
        const std::uint64_t more = std::min<std::uint64_t>(buffered_ / value_bytes, head_.count - next_);
        if (more == 0)
            return false;
        buffer_ = FileBytes(path_).bytes(place(next_), more * value_bytes);
        at_ = 0;
        return true;
    }

    fs::path path_;
    ValuesHead head_;
    std::size_t buffered_;
    std::uint64_t next_ = 0; ///< behind what until() has given
    std::string buffer_;
    std::size_t at_ = 0;
};

ValuesInOrder::ValuesInOrder(const TilesOnDisk& tiles) {
    constexpr std::size_t all = 32 << 20, least = 4096, most = 1 << 20;
    for (std::size_t tile = 0; tile < tiles.tiles(); ++tile)
        if (fs::exists(tiles.values_file(tile)))
            cursors_.push_back(
                std::make_shared<Cursor>(tiles.values_file(tile), std::clamp(all / tiles.tiles(), least, most)));
}

void ValuesInOrder::seek(std::size_t first) {
    for (const auto& cursor : cursors_)
        cursor->seek(first);
}

void ValuesInOrder::read(std::size_t first, std::size_t count, std::vector<float>& visibility,
                         std::vector<float>& error) {
    visibility.assign(count, std::numeric_limits<float>::quiet_NaN());
    error.assign(count, std::numeric_limits<float>::quiet_NaN());
    for (const auto& cursor : cursors_)
        cursor->until(first + count, [&](std::uint32_t number, float value, float expected) {
            visibility[number - first] = value;
            error[number - first] = expected;
        });
}

std::vector<ValuesInOrder::Shown> ValuesInOrder::shown(std::size_t first, std::size_t end) const {
    std::vector<Shown> all;
    for (const auto& cursor : cursors_)
        cursor->shown(first, end, all);
    std::ranges::sort(all, {}, &Shown::number);
    return all;
}

} // namespace scanshade
