// Gaussian splats in binary glTF, made in code.
#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace scanshade::tests {

inline const std::string splat_prefix = "KHR_gaussian_splatting:";

/// Two splats in each of two primitives, each shown by a node of its own. `change` is made to the JSON.
struct SplatGlb {
    bool logarithms = false;
    std::function<void(nlohmann::json&)> change = [](nlohmann::json&) {};

    [[nodiscard]] std::string bytes() const {
        std::string bin;
        nlohmann::json gltf =
            nlohmann::json::parse(R"({"asset": {"version": "2.0"}, "extensionsUsed": ["KHR_gaussian_splatting"],
            "scenes": [{"nodes": [0, 1]}], "extras": {"keep": "this"},
            "nodes": [{"mesh": 0}, {"mesh": 1, "translation": [10, 0, 0], "rotation": [0, 0, 1, 0], "scale": [2, 2, 2]}]})");
        const auto add = [&](int type, const char* shape, const std::string& values, std::size_t count) {
            gltf["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", bin.size()}, {"byteLength", values.size()}});
            gltf["accessors"].push_back({{"bufferView", gltf["bufferViews"].size() - 1},
                                         {"componentType", type},
                                         {"count", count},
                                         {"type", shape}});
            bin += values;
            return gltf["accessors"].size() - 1;
        };
        const auto floats = [&](const char* shape, const std::vector<float>& values) {
            return add(5126, shape, std::string(reinterpret_cast<const char*>(values.data()), 4 * values.size()), 2);
        };
        for (int mesh = 0; mesh < 2; ++mesh) {
            std::vector<float> sigma{0.5F, 0.25F, 0.01F, 0.5F, 0.25F, 0.01F};
            for (float& value : sigma)
                value = logarithms ? std::log(value) : value;
            nlohmann::json attributes;
            attributes["POSITION"] = floats("VEC3", {1, 2, 3, 1.5, 2, 3});
            gltf["accessors"].back()["min"] = {1, 2, 3};
            gltf["accessors"].back()["max"] = {1.5, 2, 3};
            attributes[splat_prefix + "ROTATION"] =
                floats("VEC4", {0, 0, 0, 1, 2, 0, 0, 2}); // the second a quarter about x
            attributes[splat_prefix + "SCALE"] = floats("VEC3", sigma);
            attributes[splat_prefix + "OPACITY"] = add(5121, "SCALAR", "\xff\x33", 2);
            gltf["accessors"].back()["normalized"] = true;
            bin.resize(bin.size() + 2, '\0');
            attributes[splat_prefix + "SH_DEGREE_0_COEF_0"] = floats("VEC3", {1, 0, -1, 0.5, 0.5, 0.5});
            for (int k = 0; k < 3; ++k)
                attributes[splat_prefix + "SH_DEGREE_1_COEF_" + std::to_string(k)] =
                    floats("VEC3", {0.1F, 0.2F, 0.3F, 1, 1, 1});
            attributes["COLOR_0"] = add(5121, "VEC4", "\x80\x80\x80\xff\x80\x80\x80\x33", 2);
            gltf["accessors"].back()["normalized"] = true;
            gltf["meshes"].push_back(
                {{"primitives",
                  {{{"attributes", attributes},
                    {"mode", 0},
                    {"extensions",
                     {{"KHR_gaussian_splatting", {{"kernel", "ellipse"}, {"colorSpace", "srgb_rec709_display"}}}}}}}}});
        }
        gltf["buffers"] = nlohmann::json::array({{{"byteLength", bin.size()}}});
        change(gltf);
        std::string text = gltf.dump(), all = "glTF";
        text.resize((text.size() + 3) / 4 * 4, ' ');
        const auto put = [&](std::size_t value) {
            const auto word = static_cast<std::uint32_t>(value);
            all.append(reinterpret_cast<const char*>(&word), 4);
        };
        put(2), put(28 + text.size() + bin.size()), put(text.size());
        all += "JSON" + text;
        put(bin.size());
        return all + std::string("BIN\0", 4) + bin;
    }
};

} // namespace scanshade::tests
