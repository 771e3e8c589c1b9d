// bench: milliseconds of every CACAO quality and of each pass, beside a calibration gather timed in the same run.
//   bench --write-maps FOLDER | --compare-maps FOLDER     the same maps on two devices, and how far they differ
//   bench [--sizes 640x480,1920x1080] [--repeat 20] [--device NAME] [--passes] [--profile scan|reference] [--storage
//   buffers|images] bench --model [--sizes ...]     milliseconds as a formula of pixels, taps and blur passes, and how
//   far measurements are from it
// Times are the device's own (timestamps), transfers left out, over `repeat` runs. Each is taken in turns with a plain
// 32-tap gather over the same image; "x gather" is the median of their ratios, what remains comparable on a busy
// machine. The scene is a generated room. --passes stamps every pass, which costs a GPU some microseconds each, and
// says how many GB/s it moved if it read and wrote each of its buffers once.
#include "ao/cacao/cacao.h"
#include "ao/gpu/device.h"
#include "ao/gpu/program.h"
#include "projection/error.h"
#include "projection/statistics.h"

#include <algorithm>
#include <array>
#include <CLI/CLI.hpp>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <map>
#include <set>
#include <span>

using namespace scanshade;

namespace {

/// A room of walls, floor and boxes seen from its middle: depth in closed form, enough relief for every tap to matter.
DepthImage room(cv::Size size) {
    const double f = 0.82 * size.width;
    DepthImage image{{f, f, (size.width - 1) / 2.0, (size.height - 1) / 2.0, size}, cv::Mat1f(size), {}};
    for (int v = 0; v < size.height; ++v)
        for (int u = 0; u < size.width; ++u) {
            const double x = (u - image.camera.cx) / f, y = (v - image.camera.cy) / f;
            double z = 6.3; // back wall
            if (y > 0)
                z = std::min(z, 1.4 / y); // floor
            if (y < 0)
                z = std::min(z, 1.4 / -y);                      // ceiling
            z = std::min(z, 2.0 / std::max(std::abs(x), 1e-6)); // side walls
            for (int i = 0; i < 5; ++i) {                       // boxes standing on the floor, faces towards us
                const double front = 3.0 + 0.6 * i, left = -1.6 + 0.7 * i, top = 1.4 - 0.3 * (i + 1);
                if (x * front > left && x * front < left + 0.5 && y * front > top)
                    z = std::min(z, front);
            }
            image.z_m(v, u) = static_cast<float>(z);
        }
    return image;
}

double least(const std::vector<double>& values) { return *std::min_element(values.begin(), values.end()); }

/// Device milliseconds of a program's passes, transfers left out, resubmitted without touching the host's images.
class Timed {
  public:
    Timed(gpu::Device& device, const CacaoTables& tables, std::span<const std::byte> constants,
          gpu::Program::Stamps stamps)
        : program_(device, tables.buffers, tables.passes, constants.size(), stamps),
          constants_(constants.begin(), constants.end()) {
        for (const gpu::PassRow& pass : tables.passes)
            for (const auto* side : {&pass.reads, &pass.writes})
                for (const int i : std::set<int>(side->begin(), side->end()))
                    bytes_[pass.name] += static_cast<double>(tables.buffers[i].bytes);
    }

    double run() {
        program_.run(constants_);
        double sum = 0;
        for (const auto& [name, ms] : program_.timings()) {
            if (name == "upload" || name == "download")
                continue;
            passes_[name].push_back(ms);
            sum += ms;
        }
        return sum;
    }
    template <class T>
    std::span<T> host(int buffer) {
        return program_.host_as<T>(buffer);
    }
    void print_passes() {
        for (const auto& [name, ms] : program_.timings())
            if (const auto& all = passes_[name]; !all.empty())
                fmt::print("    {:<20} {:>8.4f} {:>8.4f} {:>8.0f} GB/s\n", name, median(all), least(all),
                           1e-6 * bytes_[name] / least(all));
    }

  private:
    gpu::Program program_;
    std::vector<std::byte> constants_;
    std::map<std::string, std::vector<double>> passes_;
    std::map<std::string, double> bytes_; // of the buffers a pass touches
};

struct Calibration {
    std::array<std::int32_t, 2> size;
    CacaoTables tables;
};

/// 32 taps over the same image: what relates the times of machines, and of one machine's better and worse minutes.
Calibration calibration(cv::Size size) {
    const auto pixels = static_cast<std::size_t>(size.area());
    const auto groups = [](int n) { return static_cast<std::uint32_t>((n + 7) / 8); };
    return {{size.width, size.height},
            {{{"from", pixels * 4, gpu::BufferRow::Host::upload, gpu::BufferRow::Texels::r32f}, {"to", pixels * 4}},
             {{"calibrate", "calibrate", {0}, {1}, {groups(size.width), groups(size.height), 1}, {}}}}};
}

cv::Size parse_size(const std::string& text) {
    cv::Size size;
    if (std::sscanf(text.c_str(), "%dx%d", &size.width, &size.height) != 2)
        throw Misuse("size '" + text + "': WIDTHxHEIGHT expected");
    return size;
}

/// The configurations whose maps two devices must agree on: every quality and resolution, holes included.
template <class Use>
void each_map(gpu::Device& device, const std::string& storage, Use use) {
    DepthImage depth = room({641, 479});
    depth.z_m(cv::Rect(200, 150, 60, 7)) = 0;
    depth.z_m(cv::Rect(400, 0, 5, 300)) = 0;
    for (const bool downsampled : {false, true})
        for (const char* quality : {"lowest", "low", "medium", "high", "highest"}) {
            CacaoOptions options;
            options.quality = quality;
            options.downsampled = downsampled;
            options.storage = storage;
            Cacao method(device, options);
            use(fmt::format("{}_{}", quality, downsampled ? "downsampled" : "native"),
                method.compute({depth}).visibility);
        }
}

void write_maps(gpu::Device& device, const std::string& storage, const std::filesystem::path& folder) {
    std::filesystem::create_directories(folder);
    each_map(device, storage, [&](const std::string& name, const cv::Mat1f& map) {
        std::ofstream(folder / (name + ".f32"), std::ios::binary)
            .write(reinterpret_cast<const char*>(map.data), static_cast<std::streamsize>(map.total() * 4));
    });
}

int compare_maps(gpu::Device& device, const std::string& storage, const std::filesystem::path& folder) {
    int missed = 0;
    fmt::print("{:<32} {:>10} {:>8} {:>8}   differences in 1/255 to {}\n", "map", "mean", "p99", "worst",
               folder.string());
    each_map(device, storage, [&](const std::string& name, const cv::Mat1f& map) {
        cv::Mat1f theirs(map.size());
        if (!std::ifstream(folder / (name + ".f32"), std::ios::binary)
                 .read(reinterpret_cast<char*>(theirs.data), static_cast<std::streamsize>(theirs.total() * 4)))
            throw Error((folder / name).string() + ".f32 is missing or short");
        std::vector<double> differences;
        double sum = 0;
        for (std::size_t i = 0; i < map.total(); ++i) {
            const float a = map.ptr<float>()[i], b = theirs.ptr<float>()[i];
            differences.push_back(std::isnan(a) != std::isnan(b) ? 255.0
                                  : std::isnan(a)                ? 0.0
                                                                 : 255.0 * std::abs(a - b));
            sum += differences.back();
        }
        std::sort(differences.begin(), differences.end());
        const double mean = sum / static_cast<double>(differences.size()),
                     p99 = differences[differences.size() * 99 / 100];
        const bool met = mean <= 0.5 && p99 <= 2;
        fmt::print("{:<32} {:>10.4f} {:>8.3f} {:>8.2f}{}\n", name, mean, p99, differences.back(),
                   met ? "" : "  MISSED");
        missed += !met;
    });
    return missed ? 1 : 0;
}

/// Fits ms = fixed + pixels (base + tap taps + blur passes) to native LOW, MEDIUM and HIGH with 0, 2 and 4 blur passes.
void print_model(gpu::Device& device, const std::vector<std::string>& sizes, int repeat) {
    const std::vector<std::pair<std::string, int>> taps_of{{"low", 6}, {"medium", 10}, {"high", 24}};
    cv::Mat1d terms, times;
    for (const std::string& text : sizes) {
        const DepthImage depth = room(parse_size(text));
        for (const auto& [quality, taps] : taps_of)
            for (const int blur : {0, 2, 4}) {
                CacaoOptions options;
                options.quality = quality;
                options.blur_passes = blur;
                options.radius = 1.2F;
                const shared::CacaoConstants constants = constants_from(options, depth.camera);
                Timed method(device, cacao_tables(options, constants, false, cacao_storage(options, device)),
                             std::as_bytes(std::span(&constants, 1)), gpu::Program::Stamps::total);
                std::memcpy(method.host<float>(cacao_depth_in).data(), depth.z_m.data, depth.z_m.total() * 4);
                std::vector<double> ms;
                for (int i = 0; i < repeat + 3; ++i)
                    ms.push_back(method.run());
                const double megapixels = 1e-6 * static_cast<double>(depth.z_m.total()), best = least(ms);
                // Divided by the time, so that small images count as much as large ones.
                terms.push_back(cv::Mat1d(
                    {1, 4}, {1 / best, megapixels / best, megapixels * taps / best, megapixels * blur / best}));
                times.push_back(1.0);
            }
    }
    cv::Mat1d model;
    cv::solve(terms, times, model, cv::DECOMP_SVD);
    fmt::print("ms = {:.4f} + megapixels ({:.4f} + {:.5f} taps + {:.5f} blur passes), within {:.0f} % of each of {} "
               "measurements\n",
               model(0), model(1), model(2), model(3), 100 * cv::norm(terms * model - times, cv::NORM_INF), terms.rows);
}

} // namespace

int main(int argc, char** argv) {
    std::vector<std::string> sizes{"640x480"}, qualities{"lowest", "low", "medium", "high", "highest"};
    std::string choice, profile = "scan", storage = "auto";
    int repeat = 20;
    bool passes = false, model = false;
    std::string written, compared;
    CLI::App app{"milliseconds of CACAO"};
    app.add_option("--sizes", sizes)->delimiter(',');
    app.add_option("--qualities", qualities)->delimiter(',');
    app.add_option("--repeat", repeat);
    app.add_option("--device", choice);
    app.add_option("--profile", profile);
    app.add_option("--storage", storage);
    app.add_flag("--passes", passes);
    app.add_flag("--model", model);
    app.add_option("--write-maps", written);
    app.add_option("--compare-maps", compared);
    CLI11_PARSE(app, argc, argv);
    try {
        gpu::Device device(choice);
        fmt::print("{} ({}), profile {}\n", device.info().name, device.info().driver, profile);
        if (!written.empty())
            return write_maps(device, storage, written), 0;
        if (!compared.empty())
            return compare_maps(device, storage, compared);
        if (model)
            return print_model(device, sizes, repeat), 0;
        for (const std::string& text : sizes) {
            const cv::Size size = parse_size(text);
            const DepthImage depth = room(size);
            const Calibration plain = calibration(size);
            Timed gather(device, plain.tables, std::as_bytes(std::span(plain.size)), gpu::Program::Stamps::total);
            fmt::print("\n{}\n{:<10} {:>11} {:>10} {:>10} {:>10} {:>10}\n", text, "quality", "resolution", "median ms",
                       "least ms", "x gather", "gather ms");
            for (const bool downsampled : {false, true})
                for (const std::string& quality : qualities) {
                    CacaoOptions options;
                    options.profile = profile;
                    options.quality = quality;
                    options.downsampled = downsampled;
                    options.radius = 1.2F;
                    const shared::CacaoConstants constants = constants_from(options, depth.camera);
                    options.storage = storage;
                    const CacaoTables tables = cacao_tables(options, constants, false, cacao_storage(options, device));
                    Timed method(device, tables, std::as_bytes(std::span(&constants, 1)),
                                 passes ? gpu::Program::Stamps::passes : gpu::Program::Stamps::total);
                    std::memcpy(method.host<float>(cacao_depth_in).data(), depth.z_m.data, depth.z_m.total() * 4);
                    std::vector<double> ms, taps, ratios;
                    for (int i = -3; i < repeat;
                         ++i) { // three to warm up; method and gather in turns, so that both see the same minutes
                        const double a = method.run(), b = gather.run();
                        if (i < 0)
                            continue;
                        ms.push_back(a);
                        taps.push_back(b);
                        ratios.push_back(a / b);
                    }
                    fmt::print("{:<10} {:>11} {:>10.4f} {:>10.4f} {:>10.2f} {:>10.4f}\n", quality,
                               downsampled ? "downsampled" : "native", median(ms),
                               *std::min_element(ms.begin(), ms.end()), median(ratios), median(taps));
                    if (passes)
                        method.print_passes();
                }
        }
    } catch (const std::exception& failure) {
        fmt::print(stderr, "{}\n", failure.what());
        return 3;
    }
}
