// Cameras to numbers and back; the rungs.
#include "projection/calibration/model.h"

namespace scanshade::calibration {

std::string_view name_of(Unknown unknown) {
    constexpr std::array<std::string_view, unknown_count> names = {
        "f",      "fy/fx",  "cx",      "cy",          "k1",           "k2",          "p1",
        "p2",     "k3",     "k4",      "depth scale", "depth offset", "depth curve", "turn x",
        "turn y", "turn z", "shift x", "shift y",     "shift z",      "time offset"};
    return names[unknown];
}

Model model_of(const Camera& camera) {
    const Distortion& d = camera.distortion;
    Model model{d.model, camera.pinhole.size, {}};
    model[f] = camera.pinhole.fx;
    model[aspect] = camera.pinhole.fy / camera.pinhole.fx;
    model[cx] = camera.pinhole.cx;
    model[cy] = camera.pinhole.cy;
    model[k1] = d.k1;
    model[k2] = d.k2;
    model[p1] = d.p1;
    model[p2] = d.p2;
    model[k3] = d.k3;
    model[k4] = d.k4;
    model[depth_scale] = 1;
    return model;
}

Camera camera_of(const Model& m, std::string origin) {
    return {{m[f], m[f] * m[aspect], m[cx], m[cy], m.size},
            {m[k1], m[k2], m[p1], m[p2], m[k3], m[k4], m.lens},
            std::move(origin)};
}

std::vector<Rung> camera_rungs(LensModel lens) {
    std::vector<Rung> rungs = {{"f", {f}}, {"fx, fy", {aspect}}, {"cx, cy", {cx, cy}}, {"k1", {k1}}, {"k2", {k2}}};
    if (lens == LensModel::kannala_brandt)
        rungs.insert(rungs.end(), {{"k3", {k3}}, {"k4", {k4}}});
    else
        rungs.insert(rungs.end(), {{"p1, p2", {p1, p2}}, {"k3", {k3}}});
    return rungs;
}

Rung place_rung() { return {"place", {turn_x, turn_y, turn_z, shift_x, shift_y, shift_z}}; }

std::vector<Rung> depth_rungs() {
    return {{"depth offset", {depth_offset}}, {"depth scale", {depth_scale}, f}, {"depth curve", {depth_curve}}};
}

} // namespace scanshade::calibration
