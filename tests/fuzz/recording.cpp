// Fuzz target: files that hold a recording. The first byte chooses the kind: by its own first bytes (zip archives,
// .npy, .sens), ScanNet++'s depth.bin, or LZFSE alone.
#include "io/captures/capture.h"
#include "io/compression/lzfse.h"
#include "tests/fuzz/fuzz.h"

namespace {

using namespace scanshade;
using namespace scanshade::fuzz;

void open(const std::filesystem::path& path) {
    (void)accepted([&] {
        const Capture capture = open_capture(path);
        for (std::size_t i = 0; i < std::min<std::size_t>(capture.entries.size(), 3); ++i)
            (void)accepted([&] {
                const Frame frame = capture.load(i);
                for (const float z : frame.depth_m)
                    must_hold(z >= 0);
            });
    });
}

} // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    if (size == 0)
        return 0;
    const std::string_view bytes = text_of(data + 1, size - 1);
    switch (data[0] % 3) {
    case 0:
        open(as_file(bytes, "recording.bin"));
        break;
    case 1:
        (void)as_file("{}", "scan/pose_intrinsic_imu.json");
        open(as_file(bytes, "scan/depth.bin").parent_path());
        break;
    default:
        constexpr std::size_t most = 1 << 20;
        (void)accepted([&] { must_hold(unpacked_lzfse(bytes, most).size() <= most); });
    }
    return 0;
}
