// A tile of a survey made in code: LAS 1.4 with colours, classes, returns and intensities.
#pragma once

#include "tests/support/laz_file.h"
#include "tests/support/points.h"

#include <cmath>

namespace scanshade::tests {

inline constexpr std::size_t points_of_a_tile = 12000;
inline constexpr double tile_side_m = 20;

/// Ground (class 2), a house of 6 x 6 x 4 m in the middle (6) and a tree (5) whose points are returns 1 to 3. Tiles at
/// different shifts have the same records. Intensities are millimetres along x.
inline std::string tile(const Eigen::Vector3d& shift) {
    constexpr std::size_t length = 36;
    Dice dice;
    std::string records;
    for (std::size_t i = 0; i < points_of_a_tile; ++i) {
        Eigen::Vector3d at(tile_side_m * dice.roll(), tile_side_m * dice.roll(), 0);
        std::uint8_t kind = 2, number = 1;
        std::array<std::uint16_t, 3> colour{22000, 30000, 16000};
        if (i % 4 == 3) {
            const double across = 1.5 * std::sqrt(dice.roll()), turn = 2 * std::numbers::pi * dice.roll();
            at = {16 + across * std::cos(turn), 15 + across * std::sin(turn), 2 + 3 * dice.roll()};
            kind = 5, number = static_cast<std::uint8_t>(1 + i / 4 % 3);
            colour = {9000, 24000, 8000};
        } else if ((at.head<2>() - Eigen::Vector2d(10, 10)).cwiseAbs().maxCoeff() < 3) {
            at.z() = 4, kind = 6;
            colour = {50000, 22000, 18000};
        }
        std::string r(length, '\0');
        for (Eigen::Index axis = 0; axis < 3; ++axis)
            store(r.data() + 4 * axis, static_cast<std::int32_t>(std::lround(1000 * at[axis])));
        store(r.data() + 12, static_cast<std::uint16_t>(std::lround(1000 * at.x())));
        r[14] = static_cast<char>(number | (kind == 5 ? 3 : 1) << 4);
        r[16] = static_cast<char>(kind);
        store(r.data() + 22, 300000 + 0.001 * static_cast<double>(i));
        store(r.data() + 30, colour);
        records += r;
    }
    std::string file = las_file(7, length, records);
    for (std::size_t axis = 0; axis < 3; ++axis) {
        store(file.data() + 131 + 8 * axis, 0.001);
        store(file.data() + 155 + 8 * axis, shift[static_cast<Eigen::Index>(axis)]);
    }
    return file;
}

} // namespace scanshade::tests
