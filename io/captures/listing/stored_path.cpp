// Folders that entries share.
#include "io/captures/listing/stored_path.h"

#include <algorithm>
#include <array>

namespace scanshade {
namespace {

/// One of the folders that this thread met last: an entry has up to four files, and the next one's lie beside them.
std::shared_ptr<const std::string> shared_folder(std::string_view folder) {
    thread_local std::array<std::shared_ptr<const std::string>, 4> last;
    const auto same = [&](const auto& each) { return each && *each == folder; };
    const auto found = std::ranges::find_if(last, same);
    if (found != last.end())
        return *found;
    std::rotate(last.begin(), last.end() - 1, last.end());
    return last.front() = std::make_shared<const std::string>(folder);
}

} // namespace

StoredPath::StoredPath(std::string_view path) {
    if (path.empty())
        return;
    const std::size_t name = path.rfind('/') + 1; // 0 where there is no folder
    parts_ = Parts{shared_folder(path.substr(0, name)), std::string(path.substr(name))};
}

} // namespace scanshade
