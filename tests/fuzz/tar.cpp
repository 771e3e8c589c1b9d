// Fuzz target: a tar, its index and everything in it read through the door, and opened as a capture.
#include "io/captures/capture.h"
#include "io/files.h"
#include "io/text.h"
#include "tests/fuzz/fuzz.h"

namespace {

using namespace scanshade;
using namespace scanshade::fuzz;

/// Every folder and file, to a depth.
void walk(const std::filesystem::path& folder, std::size_t whole, int levels) {
    std::error_code trouble;
    for (const auto& [name, kind] : items_in(folder, trouble)) {
        must_hold(!name.empty() && name != ".." && name.find('/') == std::string::npos);
        const std::filesystem::path path = folder / name;
        must_hold(kind == FolderItem::Kind::folder ? is_folder(path) : is_file(path));
        if (kind == FolderItem::Kind::folder && levels > 0)
            walk(path, whole, levels - 1);
        if (kind == FolderItem::Kind::file)
            (void)accepted([&] { must_hold(read_bytes(path).size() <= whole); });
    }
    must_hold(!trouble);
}

} // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static int count = 0; // an index is kept for a file that looks unchanged
    const auto file = as_file(text_of(data, size), "input" + std::to_string(count++) + ".tar");
    (void)accepted([&] {
        if (is_folder(file))
            walk(file, size, 6);
    });
    (void)accepted([&] {
        const Capture capture = open_capture(file);
        for (std::size_t i = 0; i < std::min<std::size_t>(capture.entries.size(), 2); ++i)
            (void)accepted([&] { (void)capture.load(i); });
    });
    std::filesystem::remove(file);
    return 0;
}
