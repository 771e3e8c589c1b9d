// Fuzz target: poses; the first byte chooses the format.
#include "io/captures/listing/trajectory.h"
#include "tests/fuzz/fuzz.h"

namespace {

using namespace scanshade;
using namespace scanshade::fuzz;

void must_be_rigid(const Eigen::Isometry3d& pose) {
    must_hold(pose.matrix().allFinite());
    must_hold((pose.linear().transpose() * pose.linear()).isIdentity(1e-6));
}

} // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    if (size == 0)
        return 0;
    const auto file = as_file(text_of(data + 1, size - 1), "poses.txt");
    std::vector<std::string> warnings;
    switch (data[0] % 4) {
    case 0:
        for (const StampedPose& pose : read_tum_trajectory(file, warnings))
            must_be_rigid(pose.world_from_camera);
        break;
    case 1:
        for (const auto& [row, pose] : read_pose_rows(file, warnings))
            must_be_rigid(pose);
        break;
    case 2:
        for (const auto& [index, pose] : read_redwood_log(file, warnings))
            must_be_rigid(pose);
        break;
    default:
        if (const MatrixPose pose = read_matrix_pose(file); pose.world_from_camera)
            must_be_rigid(*pose.world_from_camera);
    }
    return 0;
}
