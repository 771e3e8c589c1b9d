// `developers_bench cacao`: device milliseconds of CACAO's qualities and of a plain gather in the same run.
// `cacao-maps`: whether two devices make the same maps.
//
// Times are the device's own (timestamps), transfers left out. Each run takes turns with a 32-tap gather over the same
// image. The median of their ratios remains comparable on a busy machine.
#include "ao/cacao/cacao.h"
#include "ao/gpu/device.h"
#include "ao/gpu/program.h"
#include "apps/lists.h"
#include "apps/scenes/generate.h"
#include "projection/base/error.h"
#include "projection/base/statistics.h"
#include "tests/bench/part.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <map>
#include <set>
#include <span>
#include <utility>

namespace scanshade::bench {
namespace {

namespace fs = std::filesystem;

double least(const std::vector<double>& values) { return *std::ranges::min_element(values); }

/// A room of walls, floor and boxes seen from its middle. Its depth is in closed form, with enough relief for all taps.
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
            for (int i = 0; i < 5; ++i) {                       // boxes on the floor that face the camera
                const double front = 3.0 + 0.6 * i, left = -1.6 + 0.7 * i, top = 1.4 - 0.3 * (i + 1);
                if (x * front > left && x * front < left + 0.5 && y * front > top)
                    z = std::min(z, front);
            }
            image.z_m(v, u) = static_cast<float>(z);
        }
    return image;
}

/// Device milliseconds of a program's passes, transfers left out. The host's images stay as they are between runs.
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
    void print_passes(const std::string& quality, Table& table) {
        for (const auto& [name, ms] : program_.timings())
            if (const auto& all = passes_[name]; !all.empty())
                table.row({quality, name, fmt::format("{:.4f}", median(all)), fmt::format("{:.4f}", least(all)),
                           fmt::format("{:.0f}", 1e-6 * bytes_[name] / least(all))});
    }

  private:
    gpu::Program program_;
    std::vector<std::byte> constants_;
    std::map<std::string, std::vector<double>> passes_;
    std::map<std::string, double> bytes_; // of the buffers a pass touches
};

struct PlainTaps {
    std::array<std::int32_t, 2> size;
    CacaoTables tables;
};

/// 32 taps over the same image. Their time relates machines, and busy and quiet minutes of one machine.
PlainTaps calibration(cv::Size size) {
    const auto pixels = static_cast<std::size_t>(size.area());
    const auto groups = [](int n) { return static_cast<std::uint32_t>((n + 7) / 8); };
    return {{size.width, size.height},
            {{{"from", pixels * 4, gpu::BufferRow::Host::upload, gpu::BufferRow::Texels::r32f}, {"to", pixels * 4}},
             {{"calibrate", "calibrate", {0}, {1}, {groups(size.width), groups(size.height), 1}, {}}}}};
}

/// CACAO at these settings over one depth image.
std::unique_ptr<Timed> timed_cacao(gpu::Device& device, CacaoOptions options, const DepthImage& depth,
                                   gpu::Program::Stamps stamps) {
    options.radius = 1.2F;
    const shared::CacaoConstants constants = constants_from(options, depth.camera);
    auto method =
        std::make_unique<Timed>(device, cacao_tables(options, constants, false, cacao_storage(options, device)),
                                std::as_bytes(std::span(&constants, 1)), stamps);
    std::memcpy(method->host<float>(cacao_depth_in).data(), depth.z_m.data, depth.z_m.total() * 4);
    return method;
}

constexpr int warm_up = 3; // runs before those that count

/// Fits ms = fixed + pixels (base + tap taps + blur passes) to native LOW, MEDIUM and HIGH with 0, 2 and 4 blur passes.
void print_model(gpu::Device& device, const std::vector<cv::Size>& sizes, int repeat) {
    constexpr std::array<std::pair<Quality, int>, 3> taps_of{
        {{Quality::low, 6}, {Quality::medium, 10}, {Quality::high, 24}}};
    cv::Mat1d terms, times;
    for (const cv::Size size : sizes) {
        const DepthImage depth = room(size);
        for (const auto& [quality, taps] : taps_of)
            for (const int blur : {0, 2, 4}) {
                CacaoOptions options;
                options.quality = quality;
                options.blur_passes = blur;
                const auto method = timed_cacao(device, options, depth, gpu::Program::Stamps::total);
                std::vector<double> ms;
                for (int i = 0; i < repeat + warm_up; ++i)
                    ms.push_back(method->run());
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

class CacaoTimes final : public Part {
    std::vector<Parameter> rows() override {
        return {
            {"sizes", "image sizes, with commas", &sizes_, "pixels"},
            {"repeat", "how often each is timed", &repeat_, "", 1, 100000},
            {"passes", "times each pass by itself, too, with its GB/s; each time stamp adds microseconds", &passes_},
            {"profile", "which profile", OneOf(&options_.profile, cacao_profile_words)},
            {"model", "instead, fits milliseconds to a formula of pixels, taps and blur passes", &model_}};
    }

    int measure(const std::string& choice) override {
        std::vector<cv::Size> sizes;
        for (const std::string& text : comma_separated(sizes_))
            sizes.push_back(parsed_size(text));
        gpu::Device device(choice);
        fmt::print("{} ({}), profile {}\n", device.info().name, device.info().driver,
                   word_for(options_.profile, cacao_profile_words));
        if (model_)
            print_model(device, sizes, repeat_);
        else
            for (const cv::Size size : sizes)
                print_times(device, size);
        return all_well;
    }

    void print_times(gpu::Device& device, cv::Size size) {
        const DepthImage depth = room(size);
        const PlainTaps plain = calibration(size);
        Timed gather(device, plain.tables, std::as_bytes(std::span(plain.size)), gpu::Program::Stamps::total);
        std::vector<std::pair<std::string, std::unique_ptr<Timed>>> all;
        fmt::print("\n{}x{}\n", size.width, size.height);
        Table table({"quality", "median ms", "least ms", "x gather", "gather ms"});
        for (const bool downsampled : {false, true})
            for (const auto& [word, quality] : quality_words) {
                options_.quality = quality;
                options_.downsampled = downsampled;
                auto method = timed_cacao(device, options_, depth,
                                          passes_ ? gpu::Program::Stamps::passes : gpu::Program::Stamps::total);
                std::vector<double> ms, taps, ratios;
                for (int i = -warm_up; i < repeat_; ++i) { // in turns, so that a busy minute slows both
                    const double a = method->run(), b = gather.run();
                    if (i < 0)
                        continue;
                    ms.push_back(a);
                    taps.push_back(b);
                    ratios.push_back(a / b);
                }
                const std::string name = fmt::format("{}, {}", word, downsampled ? "downsampled" : "native");
                table.row({name, fmt::format("{:.4f}", median(ms)), fmt::format("{:.4f}", least(ms)),
                           fmt::format("{:.2f}", median(ratios)), fmt::format("{:.4f}", median(taps))});
                if (passes_)
                    all.emplace_back(name, std::move(method));
            }
        if (!passes_)
            return;
        Table of_passes({"quality", "pass", "median ms", "least ms", "GB/s"});
        for (const auto& [name, method] : all)
            method->print_passes(name, of_passes);
    }

    CacaoOptions options_;
    std::string sizes_ = "640x480";
    int repeat_ = 20;
    bool passes_ = false, model_ = false;
};

// ---------------------------------------------------------------------------------------------------- maps

/// The configurations whose maps two devices must agree on: every quality and resolution, holes included.
template <class Use>
void each_map(gpu::Device& device, Use use) {
    DepthImage depth = room({641, 479});
    depth.z_m(cv::Rect(200, 150, 60, 7)) = 0;
    depth.z_m(cv::Rect(400, 0, 5, 300)) = 0;
    for (const bool downsampled : {false, true})
        for (const auto& [word, quality] : quality_words) {
            CacaoOptions options;
            options.quality = quality;
            options.downsampled = downsampled;
            Cacao method(device, options);
            use(fmt::format("{}_{}", word, downsampled ? "downsampled" : "native"), method.compute({depth}).visibility);
        }
}

void write_maps(gpu::Device& device, const fs::path& folder) {
    fs::create_directories(folder);
    each_map(device, [&](const std::string& name, const cv::Mat1f& map) {
        std::ofstream(folder / (name + ".f32"), std::ios::binary)
            .write(reinterpret_cast<const char*>(map.data), static_cast<std::streamsize>(map.total() * 4));
    });
}

/// Prints each map's differences from the folder's. Returns whether all are small enough.
bool compare_maps(gpu::Device& device, const fs::path& folder) {
    bool all_close = true;
    fmt::print("differences in 1/255 to {}\n", folder.string());
    Table table({"map", "mean", "p99", "worst", "limits"});
    each_map(device, [&](const std::string& name, const cv::Mat1f& map) {
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
        const bool close = mean <= 0.5 && p99 <= 2;
        table.row({name, fmt::format("{:.4f}", mean), fmt::format("{:.3f}", p99),
                   fmt::format("{:.2f}", differences.back()), close ? "kept" : "MISSED"});
        all_close &= close;
    });
    return all_close;
}

class CacaoMaps final : public Part {
    std::vector<Parameter> rows() override {
        return {{"write", "folder for the maps of every quality on this device", &written_},
                {"compare", "folder of another device's maps: prints the differences; exit 2 where they are too large",
                 &compared_}};
    }

    int measure(const std::string& choice) override {
        gpu::Device device(choice);
        fmt::print("{} ({}), profile {}\n", device.info().name, device.info().driver,
                   word_for(CacaoOptions().profile, cacao_profile_words));
        if (!written_.empty())
            write_maps(device, written_);
        return compared_.empty() || compare_maps(device, compared_) ? all_well : some_failed;
    }

    std::string written_, compared_;
};

} // namespace

std::unique_ptr<Command> cacao_part() { return std::make_unique<CacaoTimes>(); }
std::unique_ptr<Command> cacao_maps_part() { return std::make_unique<CacaoMaps>(); }

} // namespace scanshade::bench
