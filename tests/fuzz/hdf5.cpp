// Fuzz target: HDF5 files, and a scene of Hypersim made of one.
#include "io/hdf5/hdf5.h"
#include "io/captures/capture.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace scanshade;
    using namespace scanshade::fuzz;
    const std::string_view bytes = text_of(data, size);
    const auto file = as_file(bytes, "scene/images/scene_a_geometry_hdf5/frame.0.depth_meters.hdf5");
    (void)accepted([&] {
        const Hdf5File opened(file);
        for (const std::string& name : opened.names())
            (void)accepted([&] {
                const Hdf5Dataset set = opened.dataset(name);
                constexpr std::uint64_t most = 1 << 20;
                must_hold(set.numbers(most).size() <= most);
            });
    });
    for (const char* part : {"frame_indices", "orientations", "positions"})
        (void)as_file(bytes, std::string("scene/_detail/a/camera_keyframe_") + part + ".hdf5");
    (void)as_file("meters_per_asset_unit,1\n", "scene/_detail/metadata_scene.csv");
    (void)accepted([&] {
        const Frame frame = open_capture(folder() / "scene").load(0);
        for (const float z : frame.depth_m)
            must_hold(z >= 0);
    });
    return 0;
}
