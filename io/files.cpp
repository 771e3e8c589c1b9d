// The door to input files: ordinary ones by the system's calls alone; only a path through a file that is no folder
// makes it look for a tar.
#include "io/files.h"

#include "io/tar_index.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <array>
#include <cerrno>
#include <fcntl.h>
#include <fmt/format.h>
#include <list>
#include <mutex>
#include <sys/stat.h>
#include <unistd.h>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

/// Facts of what a path leads to; `error` is the system's answer where that is nothing.
struct Status {
    struct stat facts = {};
    int error = 0;
    explicit Status(const char* path) : error(::stat(path, &facts) == 0 ? 0 : errno) {}
    explicit Status(const fs::path& path) : Status(path.c_str()) {}
    [[nodiscard]] bool file() const { return error == 0 && S_ISREG(facts.st_mode); }
    [[nodiscard]] bool folder() const { return error == 0 && S_ISDIR(facts.st_mode); }
};

/// Changes whenever the file's content does, as far as `stat` tells.
std::string stamp_from(const struct stat& facts) {
    return fmt::format("{}:{}", facts.st_size, facts.st_mtim.tv_sec * 1'000'000'000 + facts.st_mtim.tv_nsec);
}

bool begins_so(const std::string& file) {
    constexpr std::size_t enough = 512;
    std::array<char, enough> start;
    const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (descriptor < 0)
        return false;
    const OpenFile closes(descriptor);
    const ssize_t got = ::pread(descriptor, start.data(), start.size(), 0);
    return got == static_cast<ssize_t>(enough) && begins_as_tar({start.data(), enough});
}

/// The tars in use. An index lives as long as somebody has it or it is among the last few.
class Tars {
  public:
    /// Null for a file that is no tar.
    std::shared_ptr<const TarIndex> open(const std::string& file, const struct stat& facts) {
        constexpr std::size_t most = 16;
        const std::string stamp = fmt::format("{}:{}:{}", stamp_from(facts), facts.st_dev, facts.st_ino);
        const std::lock_guard alone(mutex_);
        for (auto at = opened_.begin(); at != opened_.end(); ++at) {
            if (at->file != file)
                continue;
            if (at->stamp == stamp) {
                opened_.splice(opened_.begin(), opened_, at);
                return opened_.front().index;
            }
            opened_.erase(at);
            break;
        }
        if (!begins_so(file))
            return nullptr;
        opened_.push_front({file, stamp, std::make_shared<const TarIndex>(file)});
        if (opened_.size() > most)
            opened_.pop_back();
        return opened_.front().index;
    }

  private:
    struct Opened {
        std::string file, stamp;
        std::shared_ptr<const TarIndex> index;
    };
    std::mutex mutex_;
    std::list<Opened> opened_; ///< the last used first
};

Tars& tars() {
    static Tars all;
    return all;
}

/// A place in a tar; `index` is null where a path leads through none.
struct InTar {
    std::shared_ptr<const TarIndex> index;
    std::string name;  ///< of the member; "" = the root
    std::string stamp; ///< of the tar
};

InTar opened(const std::string& file, const struct stat& facts, std::string name) {
    return {tars().open(file, facts), std::move(name), stamp_from(facts)};
}

/// For a path of which the system said ENOTDIR: a part before its end is a file.
InTar inside_tar(const fs::path& path) {
    const std::string& whole = path.native();
    for (std::size_t slash = whole.rfind('/'); slash != std::string::npos && slash > 0;
         slash = whole.rfind('/', slash - 1)) {
        const std::string file = whole.substr(0, slash);
        const Status status(file.c_str());
        if (status.error == ENOTDIR)
            continue;
        if (!status.file())
            return {};
        std::string name = whole.substr(slash + 1);
        if (name.find("//") != std::string::npos || name.starts_with('.') || name.find("/.") != std::string::npos ||
            name.ends_with('/')) {
            name = fs::path(name).lexically_normal().string();
            while (name.ends_with('/'))
                name.pop_back();
            if (name == ".")
                name.clear();
            if (name.starts_with(".."))
                return {};
        }
        return opened(file, status.facts, std::move(name));
    }
    return {};
}

/// The same for any path, that of the tar itself as well.
InTar at_tar(const fs::path& path, const Status& status) {
    if (status.file())
        return opened(path.native(), status.facts, "");
    return status.error == ENOTDIR ? inside_tar(path) : InTar{};
}

std::optional<TarIndex::Member> member_at(const fs::path& path) {
    const InTar place = inside_tar(path);
    return place.index ? place.index->find(place.name) : std::nullopt;
}

FolderItem::Kind kind_of(const fs::directory_entry& entry) {
    std::error_code ignored;
    return entry.is_regular_file(ignored) ? FolderItem::Kind::file
           : entry.is_directory(ignored)  ? FolderItem::Kind::folder
                                          : FolderItem::Kind::other;
}

} // namespace

bool is_there(const fs::path& path) {
    const Status status(path);
    return status.error == 0 || (status.error == ENOTDIR && member_at(path).has_value());
}

bool is_file(const fs::path& path) {
    const Status status(path);
    if (status.error != ENOTDIR)
        return status.file();
    const auto member = member_at(path);
    return member && !member->folder;
}

bool is_folder(const fs::path& path) {
    const Status status(path);
    if (status.file())
        return begins_so(path.native());
    if (status.error != ENOTDIR)
        return status.folder();
    const auto member = member_at(path);
    return member && member->folder;
}

std::optional<std::uint64_t> size_of_file(const fs::path& path) {
    const Status status(path);
    if (status.file())
        return static_cast<std::uint64_t>(status.facts.st_size);
    const auto member = status.error == ENOTDIR ? member_at(path) : std::nullopt;
    return member && !member->folder ? std::optional(member->size) : std::nullopt;
}

std::vector<FolderItem> items_in(const fs::path& folder, std::error_code& trouble) {
    std::vector<FolderItem> items;
    trouble.clear();
    fs::directory_iterator entry(folder, trouble);
    if (trouble == std::errc::not_a_directory) {
        const InTar place = at_tar(folder, Status(folder));
        if (!place.index)
            return items;
        trouble.clear();
        if (const auto member = place.index->find(place.name); !member || !member->folder)
            trouble = std::make_error_code(member ? std::errc::not_a_directory : std::errc::no_such_file_or_directory);
        return place.index->items_in(place.name);
    }
    for (const fs::directory_iterator end; !trouble && entry != end; entry.increment(trouble))
        items.push_back({entry->path().filename().string(), kind_of(*entry)});
    return items;
}

bool is_tar(const fs::path& path) { return Status(path).file() && begins_so(path.native()); }

std::vector<std::string> oddities_of_tar(const fs::path& path) {
    const InTar place = at_tar(path, Status(path));
    return place.index ? place.index->oddities() : std::vector<std::string>();
}

std::optional<StoredBytes> stored_in_tar(const fs::path& path) {
    const InTar place = inside_tar(path);
    const auto member = place.index ? place.index->find(place.name) : std::nullopt;
    if (!member || member->folder)
        return std::nullopt;
    return place.index->bytes_of(*member, path);
}

std::string stamp_in_tar(const fs::path& path) {
    const InTar place = inside_tar(path);
    const auto member = place.index ? place.index->find(place.name) : std::nullopt;
    if (!member || member->folder)
        return "";
    // Tars made with fixed times are told apart by the time of the archive alone.
    return fmt::format("{}:{}@{}", member->size, member->at, place.stamp);
}

} // namespace scanshade
