// Fuzz target: Matroska and Azure Kinect's recordings: the bytes are the content of a segment, behind sound
// descriptions of a small depth track. With an odd first byte, they are the whole file.
#include "io/captures/capture.h"
#include "tests/fuzz/fuzz.h"

namespace {

using namespace std::string_literals;

/// EBML head; segment of unknown size; the track DEPTH of 4x2 pixels, b16g; a tag K4A_DEPTH_MODE.
const std::string start = "\x1A\x45\xDF\xA3\x80\x18\x53\x80\x67\xFF"
                          "\x16\x54\xAE\x6B\xD4\xAE\xD2\xD7\x81\x02\x83\x81\x01\x53\x6E\x85"s +
                          "DEPTH\x86\x8FV_MS/VFW/FOURCC\x63\xA2\xA8"s + std::string(16, '\0') + "b16g"s +
                          std::string(20, '\0') + "\xE0\x86\xB0\x81\x04\xBA\x81\x02"s +
                          "\x12\x54\xC3\x67\xAA\x73\x73\xA7\x67\xC8\xA4\x45\xA3\x8E"s +
                          "K4A_DEPTH_MODE\x44\x87\x90NFOV_2X2BINNED\0\0"s;

} // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace scanshade;
    using namespace scanshade::fuzz;
    if (size == 0)
        return 0;
    const std::string bytes(text_of(data + 1, size - 1));
    const std::filesystem::path file = as_file(data[0] % 2 == 1 ? bytes : start + bytes, "recording.mkv");
    (void)accepted([&] {
        const Capture capture = open_capture(file);
        for (std::size_t i = 0; i < std::min<std::size_t>(capture.entries.size(), 3); ++i)
            (void)accepted([&] {
                const Frame frame = capture.load(i);
                for (const float z : frame.depth_m)
                    must_hold(z >= 0);
            });
    });
    return 0;
}
