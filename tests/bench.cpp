// bench: milliseconds of every CACAO quality and of each pass, beside a calibration gather timed in the same run.
//   bench --write-maps FOLDER | --compare-maps FOLDER     the same maps on two devices, and how far they differ
//   bench [--sizes 640x480,1920x1080] [--repeat 20] [--device NAME] [--passes] [--profile scan|reference]
// Times are device time (timestamps) where the device has them, medians over the repeats. The scene is a generated room.
#include "ao/cacao/cacao.h"
#include "ao/gpu/device.h"
#include "ao/gpu/program.h"
#include "projection/error.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <CLI/CLI.hpp>
#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <map>

using namespace scanshade;

namespace {

/// A room of walls, floor and boxes seen from its middle: depth in closed form, enough relief for every tap to matter.
DepthImage room(cv::Size size) {
    const double f = 0.82 * size.width;
    DepthImage image{{f, f, (size.width - 1) / 2.0, (size.height - 1) / 2.0, size}, cv::Mat1f(size), {}};
    for (int v = 0; v < size.height; ++v)
        for (int u = 0; u < size.width; ++u) {
            const double x = (u - image.camera.cx) / f, y = (v - image.camera.cy) / f;
            double z = 6.3;                                             // back wall
            if (y > 0) z = std::min(z, 1.4 / y);                        // floor
            if (y < 0) z = std::min(z, 1.4 / -y);                       // ceiling
            z = std::min(z, 2.0 / std::max(std::abs(x), 1e-6));         // side walls
            for (int i = 0; i < 5; ++i) {                               // boxes standing on the floor, faces towards us
                const double front = 3.0 + 0.6 * i, left = -1.6 + 0.7 * i, top = 1.4 - 0.3 * (i + 1);
                if (x * front > left && x * front < left + 0.5 && y * front > top) z = std::min(z, front);
            }
            image.z_m(v, u) = static_cast<float>(z);
        }
    return image;
}

double median(std::vector<double> values) {
    std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
    return std::getenv("BENCH_MIN") ? *std::min_element(values.begin(), values.end()) : values[values.size() / 2];
}

struct Timed {
    double wall = 0, device = 0;
    std::vector<std::pair<std::string, double>> passes;
};

template <class Run, class Timings>
Timed timed(int repeat, Run run, Timings timings) {
    for (int i = 0; i < 3; ++i) run();
    std::vector<double> wall, device;
    std::map<std::string, std::vector<double>> passes;
    std::vector<std::string> order;
    for (int i = 0; i < repeat; ++i) {
        const auto start = std::chrono::steady_clock::now();
        run();
        wall.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
        double sum = 0;
        for (const auto& [name, ms] : timings()) {
            if (i == 0) order.push_back(name);
            passes[name].push_back(ms);
            if (name.find("load") == std::string::npos && name.rfind("host", 0) != 0) sum += ms;
        }
        device.push_back(sum);
    }
    Timed result{median(wall), median(device), {}};
    for (const std::string& name : order) result.passes.emplace_back(name, median(passes[name]));
    return result;
}

Timed calibration(gpu::Device& device, cv::Size size, int repeat) {
    const auto pixels = static_cast<std::size_t>(size.area());
    const auto groups = [](int n) { return static_cast<std::uint32_t>((n + 7) / 8); };
    gpu::Program program(device, {{"from", pixels * 4, gpu::BufferRow::Host::upload, gpu::BufferRow::Texels::r32f}, {"to", pixels * 4}},
                         {{"calibrate", "calibrate", {0}, {1}, {groups(size.width), groups(size.height), 1}, {}}}, 8);
    const std::int32_t constants[2] = {size.width, size.height};
    return timed(repeat, [&] { program.run(std::as_bytes(std::span(constants))); }, [&] { return program.timings(); });
}

cv::Size parse_size(const std::string& text) {
    cv::Size size;
    if (std::sscanf(text.c_str(), "%dx%d", &size.width, &size.height) != 2) throw Misuse("size '" + text + "': WIDTHxHEIGHT expected");
    return size;
}

/// The configurations whose maps two devices must agree on: every quality and resolution, holes included.
template <class Use>
void each_map(gpu::Device& device, Use use) {
    DepthImage depth = room({641, 479});
    depth.z_m(cv::Rect(200, 150, 60, 7)) = 0;
    depth.z_m(cv::Rect(400, 0, 5, 300)) = 0;
    for (const bool downsampled : {false, true})
        for (const char* quality : {"lowest", "low", "medium", "high", "highest"}) {
            CacaoOptions options;
            options.quality = quality;
            options.downsampled = downsampled;
            Cacao method(device, options);
            use(fmt::format("{}_{}", quality, downsampled ? "downsampled" : "native"), method.compute({depth}).visibility);
        }
}

void write_maps(gpu::Device& device, const std::filesystem::path& folder) {
    std::filesystem::create_directories(folder);
    each_map(device, [&](const std::string& name, const cv::Mat1f& map) {
        std::ofstream(folder / (name + ".f32"), std::ios::binary)
            .write(reinterpret_cast<const char*>(map.data), static_cast<std::streamsize>(map.total() * 4));
    });
}

int compare_maps(gpu::Device& device, const std::filesystem::path& folder) {
    int missed = 0;
    fmt::print("{:<32} {:>10} {:>8} {:>8}   differences in 1/255 to {}\n", "map", "mean", "p99", "worst", folder.string());
    each_map(device, [&](const std::string& name, const cv::Mat1f& map) {
        cv::Mat1f theirs(map.size());
        if (!std::ifstream(folder / (name + ".f32"), std::ios::binary)
                 .read(reinterpret_cast<char*>(theirs.data), static_cast<std::streamsize>(theirs.total() * 4)))
            throw Error((folder / name).string() + ".f32 is missing or short");
        std::vector<double> differences;
        double sum = 0;
        for (std::size_t i = 0; i < map.total(); ++i) {
            const float a = map.ptr<float>()[i], b = theirs.ptr<float>()[i];
            differences.push_back(std::isnan(a) != std::isnan(b) ? 255.0 : std::isnan(a) ? 0.0 : 255.0 * std::abs(a - b));
            sum += differences.back();
        }
        std::sort(differences.begin(), differences.end());
        const double mean = sum / static_cast<double>(differences.size()), p99 = differences[differences.size() * 99 / 100];
        const bool met = mean <= 0.5 && p99 <= 2;
        fmt::print("{:<32} {:>10.4f} {:>8.3f} {:>8.2f}{}\n", name, mean, p99, differences.back(), met ? "" : "  MISSED");
        missed += !met;
    });
    return missed ? 1 : 0;
}

} // namespace

int main(int argc, char** argv) {
    std::vector<std::string> sizes{"640x480"}, qualities{"lowest", "low", "medium", "high", "highest"};
    std::string choice, profile = "scan";
    int repeat = 20;
    bool passes = false;
    std::string written, compared;
    CLI::App app{"milliseconds of CACAO"};
    app.add_option("--sizes", sizes)->delimiter(',');
    app.add_option("--qualities", qualities)->delimiter(',');
    app.add_option("--repeat", repeat);
    app.add_option("--device", choice);
    app.add_option("--profile", profile);
    app.add_flag("--passes", passes);
    app.add_option("--write-maps", written);
    app.add_option("--compare-maps", compared);
    CLI11_PARSE(app, argc, argv);
    try {
        gpu::Device device(choice);
        fmt::print("{} ({}), profile {}\n", device.info().name, device.info().driver, profile);
        if (!written.empty()) return write_maps(device, written), 0;
        if (!compared.empty()) return compare_maps(device, compared);
        for (const std::string& text : sizes) {
            const cv::Size size = parse_size(text);
            const DepthImage depth = room(size);
            const Timed gather = calibration(device, size, repeat);
            const double mtaps = 32.0 * size.area() / (gather.device * 1e3);
            fmt::print("\n{}: calibration gather {:.3f} ms ({:.0f} Mtaps/s)\n{:<10} {:>11} {:>9} {:>9} {:>9}\n", text, gather.device, mtaps,
                       "quality", "resolution", "device ms", "wall ms", "x gather");
            for (const bool downsampled : {false, true})
                for (const std::string& quality : qualities) {
                    CacaoOptions options;
                    options.profile = profile;
                    options.quality = quality;
                    options.downsampled = downsampled;
                    options.radius = 1.2F;
                    Cacao method(device, options);
                    const Timed t = timed(repeat, [&] { return method.compute({depth}); }, [&] { return method.timings(); });
                    fmt::print("{:<10} {:>11} {:>9.3f} {:>9.3f} {:>9.2f}\n", quality, downsampled ? "downsampled" : "native", t.device,
                               t.wall, t.device / gather.device);
                    if (passes)
                        for (const auto& [name, ms] : t.passes) fmt::print("    {:<20} {:>8.4f}\n", name, ms);
                }
        }
    } catch (const std::exception& failure) {
        fmt::print(stderr, "{}\n", failure.what());
        return 3;
    }
}
