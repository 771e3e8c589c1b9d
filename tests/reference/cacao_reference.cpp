// cacao_reference: runs the `reference` profile over a folder of AMD's own CACAO outputs and says how equal we are.
//   cacao_reference [FOLDER] [--intermediates] [--only TEXT]      FOLDER holds manifest.json, inputs/, outputs/
// Without FOLDER: SCANSHADE_FIXTURES. Exit 0 all cases within the contract, 1 a case misses or fails to run, 2 manifest
// unreadable, 77 no folder.
#include "ao/cacao/cacao.h"
#include "ao/gpu/device.h"
#include "projection/base/error.h"
#include "tests/reference/npz.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fmt/format.h>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

using namespace scanshade;
using nlohmann::json;
namespace fs = std::filesystem;

namespace {

constexpr double wanted_share = 0.999; // of pixels within 1/255
constexpr double wanted_mean = 0.05;   // mean difference in 1/255

struct Score {
    double share = 0, mean = 0, worst = 0;
    [[nodiscard]] bool met() const { return share >= wanted_share && mean <= wanted_mean; }
};

/// Constants of a case: its own set over what all sets share.
json constants_of(const json& manifest, const json& one) {
    json all = manifest.value("common_constants", json::object());
    all.update(manifest.at("constant_sets").at(one.at("constants").get<std::string>()));
    return all;
}

CacaoOptions options_of(const json& manifest, const json& one) {
    json s = manifest.value("defaults", json::object());
    s.update(one.value("settings", json::object()));
    const json constants = constants_of(manifest, one);
    CacaoOptions o;
    o.profile = CacaoProfile::reference;
    set(*row_named(o.parameters(), "quality"), one.at("qualityLevel").get<std::string>());
    o.downsampled = one.at("useDownsampledSsao").get<bool>();
    const auto take = [&](const char* name, auto& value) {
        if (s.contains(name))
            value = s.at(name).get<std::decay_t<decltype(value)>>();
    };
    take("radius", o.radius);
    take("shadowMultiplier", o.shadow_multiplier);
    take("shadowPower", o.shadow_power);
    take("shadowClamp", o.shadow_clamp);
    take("horizonAngleThreshold", o.horizon_angle);
    take("fadeOutFrom", o.fade_from);
    take("fadeOutTo", o.fade_to);
    take("adaptiveQualityLimit", o.adaptive_limit);
    take("blurPassCount", o.blur_passes);
    take("sharpness", o.sharpness);
    take("detailShadowStrength", o.detail_strength);
    take("bilateralSigmaSquared", o.sigma_squared);
    take("bilateralSimilarityDistanceSigma", o.depth_sigma_squared);
    if (constants.contains("DepthUnpackConsts")) { // loads outside the image read device depth 0
        const float mu = constants["DepthUnpackConsts"][0], alpha = constants["DepthUnpackConsts"][1];
        o.outside_depth = alpha == 0 ? 0.0F : mu / alpha;
    }
    return o;
}

struct Input {
    DepthImage depth;
    NormalImage normals;
};

Input input_of(const fs::path& folder, const json& row) {
    const auto arrays = reference::read_npz(folder / row.at("file").get<std::string>());
    const auto& z = arrays.at("depth");
    Input input;
    input.depth.camera = {row.at("fx"), row.at("fy"), row.at("cx"), row.at("cy"), {row.at("width"), row.at("height")}};
    const cv::Size size = input.depth.camera.size;
    if (z.type != "f4" || z.count() != static_cast<std::size_t>(size.area()))
        throw Error("depth is not float32 of the stated size");
    input.depth.z_m = cv::Mat1f(size);
    std::memcpy(input.depth.z_m.data, z.data.data(), z.data.size());
    if (arrays.count("normals")) {
        input.normals.normals = cv::Mat3f(size);
        std::memcpy(input.normals.normals.data, arrays.at("normals").data.data(), arrays.at("normals").data.size());
    }
    return input;
}

Score score(const cv::Mat1f& ours, const cv::Mat1b& theirs) {
    Score s;
    int within = 0;
    for (int y = 0; y < ours.rows; ++y)
        for (int x = 0; x < ours.cols; ++x) {
            const double difference = std::abs(std::nearbyint(255.0 * ours(y, x)) - theirs(y, x));
            if (!(difference > 1))
                ++within;
            s.mean += difference;
            s.worst = std::max(s.worst, difference);
        }
    const double total = static_cast<double>(ours.total());
    s.share = within / total;
    s.mean /= total;
    return s;
}

/// Our packed words in the fixture's layout: component c of element i of the named intermediate.
double component(const Intermediate& ours, std::size_t i, std::size_t c) {
    if (ours.type == "f4") {
        float value;
        std::memcpy(&value, ours.data.data() + 4 * i, 4);
        return value;
    }
    std::uint32_t word;
    std::memcpy(&word, ours.data.data() + 4 * i, 4);
    if (ours.name == "normals")
        return static_cast<std::int8_t>(word >> (8 * c) & 0xffU);
    if (ours.name.rfind("ao", 0) == 0)
        return c == 0 ? word & 0xffffU : word >> 16 & 0xffU;
    return word;
}

void compare_intermediates(const fs::path& folder, const json& row, Cacao& method) {
    const auto theirs = reference::read_npz(folder / row.at("file").get<std::string>());
    const auto all = method.intermediates();
    const std::vector<std::pair<std::string, std::string>> names{{"depth_mip0", "deinterleaved_depth_mip0"},
                                                                 {"depth_mip1", "deinterleaved_depth_mip1"},
                                                                 {"depth_mip2", "deinterleaved_depth_mip2"},
                                                                 {"depth_mip3", "deinterleaved_depth_mip3"},
                                                                 {"normals", "normals"},
                                                                 {"importance", "importance_map_b"},
                                                                 {"load_counter", "load_counter"},
                                                                 {"ao", "ssao_raw"},
                                                                 {"ao_blurred", "ssao_blurred"}};
    for (const auto& [mine, yours] : names) {
        const auto found = std::find_if(all.begin(), all.end(), [&](const Intermediate& i) { return i.name == mine; });
        if (found == all.end() || !theirs.count(yours))
            continue;
        const auto& array = theirs.at(yours);
        const std::size_t components = array.shape.size() > found->shape.size() ? array.shape.back() : 1;
        const std::size_t compared = mine == "normals" ? 3 : components; // their fourth is unused
        const std::size_t elements = array.count() / components,
                          per_slice = array.shape.size() > 2 ? elements / 4 : elements;
        const bool two = row.at("case").get<std::string>().find("__lowest_") != std::string::npos && mine != "normals";
        std::size_t different = 0, total = 0;
        for (std::size_t i = 0; i < elements; ++i) {
            if (two && (i / per_slice == 1 || i / per_slice == 2))
                continue;
            for (std::size_t c = 0; c < compared; ++c, ++total)
                different += component(*found, i, c) != array.at(components * i + c);
        }
        fmt::print("    {:<14} {:>9} values, {:>7} differ ({:.4f} %)\n", mine, total, different,
                   100.0 * static_cast<double>(different) / static_cast<double>(total));
    }
}

std::string default_folder() {
    const char* set = std::getenv("SCANSHADE_FIXTURES");
    return set ? set : "SCANSHADE_FIXTURES is not set";
}

int check(const fs::path& folder, bool with_intermediates, const std::string& only) {
    const json manifest = json::parse(std::ifstream(folder / "manifest.json"));
    gpu::Device device(std::getenv("SCANSHADE_DEVICE") ? std::getenv("SCANSHADE_DEVICE") : "");
    fmt::print("{} on {}\n{:<52} {:>10} {:>9} {:>6}\n", folder.string(), device.info().name, "case", "within 1", "mean",
               "worst");
    Score lowest{1, 0, 0};
    int missed = 0, failed = 0, ran = 0;
    for (const json& one : manifest.at("cases")) {
        std::string id = "a case without a name";
        try { // whatever is wrong with a case, the next one runs
            id = one.value("id", id);
            if (id.find(only) == std::string::npos)
                continue;
            const Input input = input_of(folder, manifest.at("inputs").at(one.at("input").get<std::string>()));
            const cv::Mat theirs =
                cv::imread((folder / one.at("output").get<std::string>()).string(), cv::IMREAD_UNCHANGED);
            if (theirs.type() != CV_8U || theirs.size() != input.depth.z_m.size())
                throw Error("output is not 8-bit grey of the input's size");
            Cacao method(device, options_of(manifest, one));
            const bool derived = one.at("generateNormals");
            const AoMap ao = method.compute({derived ? Surfaces(input.depth) : Surfaces(input.depth, input.normals)});
            const Score s = score(ao.visibility, theirs);
            fmt::print("{:<52} {:>9.3f}% {:>9.4f} {:>6.0f}{}\n", id, 100 * s.share, s.mean, s.worst,
                       s.met() ? "" : "  MISSED");
            if (with_intermediates && manifest.contains("intermediates"))
                for (const json& row : manifest["intermediates"]["files"])
                    if (row.at("case") == id)
                        compare_intermediates(folder, row, method);
            lowest = {std::min(lowest.share, s.share), std::max(lowest.mean, s.mean), std::max(lowest.worst, s.worst)};
            missed += !s.met();
            ++ran;
        } catch (const std::exception& failure) {
            fmt::print("{:<52} FAILED: {}\n", id, failure.what());
            ++failed;
        }
    }
    for (const std::string& message : device.validation_messages())
        fmt::print("validation: {}\n", message);
    fmt::print("worst of the {} cases that ran: {:.3f} % within 1/255 (wanted {:.1f}), mean {:.4f} (wanted {}), {} "
               "missed, {} failed\n",
               ran, 100 * lowest.share, 100 * wanted_share, lowest.mean, wanted_mean, missed, failed);
    return missed > 0 || failed > 0 || ran == 0 || !device.validation_messages().empty() ? 1 : 0;
}

} // namespace

int main(int argc, char** argv) {
    std::string folder, only;
    bool with_intermediates = false;
    for (int i = 1; i < argc; ++i) {
        if (std::string(argv[i]) == "--intermediates")
            with_intermediates = true;
        else if (std::string(argv[i]) == "--only" && i + 1 < argc)
            only = argv[++i];
        else
            folder = argv[i];
    }
    if (folder.empty())
        folder = default_folder();
    if (!fs::exists(fs::path(folder) / "manifest.json")) {
        fmt::print("skipped: no manifest.json in {}; SCANSHADE_FIXTURES names the folder of recorded outputs\n",
                   folder);
        return 77;
    }
    try {
        return check(folder, with_intermediates, only);
    } catch (const std::exception& failure) {
        fmt::print(stderr, "{}\n", failure.what());
        return 2;
    }
}
