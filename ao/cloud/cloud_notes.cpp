#include "ao/cloud/cloud_notes.h"

#include <fmt/format.h>

namespace scanshade {

std::optional<std::string> told_noise(const FittedCounts& fitted) {
    if (fitted.moved == 0)
        return std::nullopt;
    return fmt::format("noise of {:.2g} (sigma across surfaces): {:.0f} % of the points were moved onto fitted planes; "
                       "{} discs stand for them.",
                       fitted.noise, 100.0 * static_cast<double>(fitted.moved) / static_cast<double>(fitted.from),
                       fitted.kept);
}

void check_noise_left(const FittedCounts& fitted, Findings& findings) {
    // 0.46 .. 0.61 of noisy surfaces at a radius too small to tell their noise. At most 0.2 once noise is moved away,
    // and 0.38 of real clouds, in woods.
    constexpr double most = 0.42;
    at_most(findings, Check::noise_left, fitted.backs, most, [&] {
        return fmt::format("noise larger than the spacing of the points is left: {:.0f} % of the rays that leave a "
                           "front meet a back. A larger --radius tells more of it.",
                           100 * fitted.backs);
    });
}

std::string turned_how(const SettledSides& sides) {
    const bool to_place = sides.orientation.kind == NormalOrientation::Kind::viewpoint;
    return (to_place ? "turned to " : "turned ") + sides.orientation.why;
}

std::string told_sides(const SettledSides& sides, bool recorded) {
    if (recorded && sides.turned_points > 0)
        return fmt::format("normals: recorded; {:.2g} % of them were turned, since {}{}.",
                           100.0 * static_cast<double>(sides.turned_points) / static_cast<double>(sides.judged_points),
                           sides.turned_why, sides.repaired ? "" : "; " + turned_how(sides));
    return recorded ? "normals: recorded." : "normals: from planes through 16 neighbours, " + turned_how(sides) + ".";
}

ToldError told_error(double error, double by_check) {
    constexpr double largest_by_check = 0.3; // noise alone makes up to 0.26 of what errs by less than 0.1
    ToldError told{fmt::format("an error of {:.2f} RMS is expected (--write error: of every point).", error), {}};
    constexpr double precise = 0.12; // a result that says it errs more needs no contradiction
    told.by_part = {Check::error_by_part, by_check, largest_by_check, {}};
    if (error <= precise && by_check > largest_by_check)
        told.by_part.sentence =
            fmt::format("a part of the points by themselves give quite other values, as if the error "
                        "were {:.2f} RMS; ao_confidence shows where.",
                        by_check);
    return told;
}

} // namespace scanshade
