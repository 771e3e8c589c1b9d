// Cameras to numbers and back; the parameter groups.
#include "projection/calibration/model.h"

namespace scanshade::calibration {

std::string_view name_of(Unknown unknown) {
    constexpr std::array<std::string_view, unknown_count> names = {"f",
                                                                   "fy/fx",
                                                                   "cx",
                                                                   "cy",
                                                                   "k1",
                                                                   "k2",
                                                                   "p1",
                                                                   "p2",
                                                                   "k3",
                                                                   "k4",
                                                                   "k5",
                                                                   "k6",
                                                                   "depth scale",
                                                                   "depth offset",
                                                                   "depth curve",
                                                                   "rotation x",
                                                                   "rotation y",
                                                                   "rotation z",
                                                                   "translation x",
                                                                   "translation y",
                                                                   "translation z",
                                                                   "time offset"};
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
    model[k5] = d.k5;
    model[k6] = d.k6;
    model[depth_scale] = 1;
    return model;
}

Camera camera_of(const Model& m, std::string origin) {
    return {{m[f], m[f] * m[aspect], m[cx], m[cy], m.size},
            {m[k1], m[k2], m[p1], m[p2], m[k3], m[k4], m[k5], m[k6], m.lens},
            std::move(origin)};
}

DepthCorrection depth_correction_of(const Model& model) {
    return {model[depth_scale], model[depth_offset], model[depth_curve]};
}

double corrected_m(const Model& model, double z_m) {
    return model[depth_scale] * z_m + model[depth_offset] + model[depth_curve] * z_m * z_m;
}

std::vector<ParameterGroup> camera_groups(LensModel lens) {
    std::vector<ParameterGroup> groups = {
        {"f", {f}}, {"fx, fy", {aspect}}, {"cx, cy", {cx, cy}}, {"k1", {k1}}, {"k2", {k2}}};
    if (lens == LensModel::kannala_brandt)
        groups.insert(groups.end(), {{"k3", {k3}}, {"k4", {k4}}});
    else
        groups.insert(groups.end(), {{"p1, p2", {p1, p2}}, {"k3", {k3}}});
    return groups;
}

ParameterGroup extrinsics_group() {
    return {"extrinsics", {rotation_x, rotation_y, rotation_z, translation_x, translation_y, translation_z}};
}

std::vector<ParameterGroup> depth_groups() {
    return {{"depth offset", {depth_offset}}, {"depth scale", {depth_scale}, f}, {"depth curve", {depth_curve}}};
}

} // namespace scanshade::calibration
