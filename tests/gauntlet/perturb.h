// What may be wrong with a cloud, as a table: each row changes a cloud in a way that should not change its visibility.
#pragma once

#include "io/clouds/cloud_records.h"

#include <cstdint>
#include <Eigen/Core>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace scanshade::gauntlet {

/// A cloud, and what its file says of it.
struct TestCloud {
    std::string name;
    std::vector<Eigen::Vector3d> points, normals = {}; ///< normals as recorded; empty = none
    std::optional<Eigen::Vector3d> scanner = {};
    bool z_up = false;
    std::shared_ptr<const CloudRecords> records = {}; ///< of the file; null for generated clouds
};

/// What perturbations need to know of the unperturbed cloud.
struct Known {
    double spacing = 0, extent = 0;
    std::span<const Eigen::Vector3d> normals; ///< recorded, or as found; zero where there is none
};

/// A changed cloud, and where its points come from.
struct Perturbed {
    TestCloud cloud;
    std::vector<std::uint32_t> original = {}; ///< by point: its index in the unperturbed cloud; `none` for strays
    Eigen::Matrix3d turned = Eigen::Matrix3d::Identity(); ///< applied to the coordinates
    double scaled = 1;                                    ///< likewise

    static constexpr std::uint32_t none = ~0U;
};

struct Perturbation {
    std::string_view name;
    void (*apply)(Perturbed& perturbed, const Known& known);
    bool normals = false;       ///< of recorded normals: needs an unperturbed result that nothing makes doubtful
    bool recorded_only = false; ///< makes sense only where normals are recorded
    bool turns_all = false;     ///< makes sense only where the cloud itself tells its sides
    bool other_density = false; ///< the automatic radius may differ: the unperturbed cloud is computed again with it
};

/// The first row changes nothing.
[[nodiscard]] std::span<const Perturbation> perturbations();
[[nodiscard]] Perturbed perturbed(const TestCloud& cloud, const Perturbation& perturbation, const Known& known);
/// About `most` of the points, chosen by a hash.
[[nodiscard]] TestCloud thinned(const TestCloud& cloud, std::size_t most);

} // namespace scanshade::gauntlet
