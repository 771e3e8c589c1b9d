// Recordings, real and generated, each perturbed in every way of a table: where is the result of `scanshade run` wrong
// without a word?
#include "apps/doubts/checks.h"
#include "io/captures/capture.h"
#include "io/images/image_file.h"
#include "projection/base/stopwatch.h"
#include "projection/project.h"
#include "tests/gauntlet/check_rows.h"
#include "tests/gauntlet/perturb_recordings.h"
#include "tests/support/data.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <unistd.h>

namespace scanshade::gauntlet {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using Maps = std::map<std::string, cv::Mat1f>; ///< visibility by the frame's name

constexpr std::size_t most_frames = 3;   ///< of a TUM recording: what its lists say is tested, too
constexpr std::size_t most_unlisted = 2; ///< of others
constexpr double largest_rms = 0.1;      ///< beyond which a result is wrong
constexpr double hardly_any_rms = 0.03;  ///< errors that grow so little do not matter

// --- the folder of all copies ---

class TemporaryFolder {
  public:
    TemporaryFolder() {
        std::string name = (fs::temp_directory_path() / "recording_gauntlet.XXXXXX").string();
        if (!mkdtemp(name.data()))
            throw Error(name + ": cannot be made");
        path_ = name;
    }
    ~TemporaryFolder() { fs::remove_all(path_); }
    TemporaryFolder(const TemporaryFolder&) = delete;
    TemporaryFolder& operator=(const TemporaryFolder&) = delete;
    [[nodiscard]] const fs::path& path() const { return path_; }

  private:
    fs::path path_;
};

std::string quoted(const std::string& text) { return "'" + text + "'"; }

/// Runs the program in a folder; what it says goes to a file there.
int run_program(const fs::path& folder, const std::string& arguments) {
    const std::string command =
        fmt::format("cd {} && {} {} >said 2>&1", quoted(folder.string()), quoted(SCANSHADE_PROGRAM), arguments);
    return std::system(command.c_str()); // NOLINT(concurrency-mt-unsafe): one thread
}

std::vector<std::string> lines_of(const fs::path& file) {
    std::ifstream stream(file);
    std::vector<std::string> lines;
    for (std::string line; std::getline(stream, line);)
        lines.push_back(line);
    return lines;
}

// --- recordings ---

/// A recording whose copies are made one after the other.
struct Recording {
    std::string name, kind; ///< kind: a column of the table
    std::function<RecordingCopy(const fs::path& folder)> copy_to;
    bool tum = false;
    Maps truth = {}; ///< of generated recordings
};

/// The lines of a list that name one of these files, and comments.
void copy_list(const fs::path& from, const fs::path& to, const std::set<std::string>& files) {
    std::ofstream stream(to);
    for (const std::string& line : lines_of(from))
        if (line.starts_with('#') || files.contains(line.substr(line.find(' ') + 1)))
            stream << line << '\n';
}

/// The poses of these frames: a line of three numbers, then four rows of a matrix.
void copy_trajectory(const fs::path& from, const fs::path& to, const std::vector<std::size_t>& frames) {
    const std::vector<std::string> lines = lines_of(from);
    std::ofstream stream(to);
    for (std::size_t i = 0; i < frames.size(); ++i) {
        stream << fmt::format("{} {} {}\n", i, i, i + 1);
        for (std::size_t row = 1; row < 5; ++row)
            stream << lines.at(5 * frames[i] + row) << '\n';
    }
}

/// A few frames of a folder in its own layout, with its camera in camera.json.
RecordingCopy copy_folder(const Capture& capture, const fs::path& folder) {
    const bool tum = capture.kind == "TUM RGB-D";
    RecordingCopy copy{
        .folder = folder, .camera = capture.camera->pinhole, .layout_units_per_metre = capture.depth.units_per_metre};
    if (capture.depth.origin == capture.camera->origin)
        copy.units_per_metre = capture.depth.units_per_metre;
    std::set<std::string> files;
    std::vector<std::size_t> chosen;
    const auto take = [&](const std::string& file) {
        if (file.empty())
            return fs::path();
        const fs::path name = fs::relative(file, capture.path);
        fs::path to = folder / name;
        fs::create_directories(to.parent_path());
        fs::copy_file(file, to);
        files.insert(name.string());
        return to;
    };
    const std::size_t count = std::min(capture.entries.size(), tum ? most_frames : most_unlisted);
    for (std::size_t i = 0; i < count; ++i) { // spread over the recording
        const std::size_t index = count > 1 ? i * (capture.entries.size() - 1) / (count - 1) : 0;
        chosen.push_back(index);
        const CaptureEntry& entry = capture.entries[index];
        copy.depth.push_back(take(entry.depth));
        take(entry.colour);
        if (capture.kind == "7-Scenes / BundleFusion") {
            const std::string depth = entry.depth.string(), pose = depth.substr(0, depth.rfind(".depth")) + ".pose.txt";
            take(fs::exists(pose) ? pose : "");
        }
    }
    if (tum) {
        copy_list(capture.path / "depth.txt", folder / "depth.txt", files);
        copy_list(capture.path / "rgb.txt", folder / "rgb.txt", files);
        if (fs::exists(capture.path / "groundtruth.txt"))
            fs::copy_file(capture.path / "groundtruth.txt", folder / "groundtruth.txt");
    }
    if (fs::exists(capture.path / "trajectory.log"))
        copy_trajectory(capture.path / "trajectory.log", folder / "trajectory.log", chosen);
    write_camera(copy);
    return copy;
}

/// One depth image, or organised cloud, as a folder of depth images in millimetres.
RecordingCopy copy_image(const DepthImage& image, const std::string& name, const fs::path& folder) {
    RecordingCopy copy{.folder = folder, .depth = {folder / "depth" / (name + ".png")}, .camera = image.camera};
    fs::create_directories(folder / "depth");
    write_depth_png(copy.depth.front(), image.z_m, 1000);
    write_camera(copy);
    return copy;
}

// --- results ---

/// What `run` made of one copy.
struct Outcome {
    Maps visibility;
    std::map<std::string, int> frames;  ///< by status
    std::vector<std::string> sentences; ///< errors, doubts and warnings; the copy's name is left out
    Findings findings;                  ///< of all frames
    [[nodiscard]] std::size_t count() const {
        std::size_t all = 0;
        for (const auto& [status, number] : frames)
            all += static_cast<std::size_t>(number);
        return all;
    }
};

std::string without(std::string text, const std::string& part) {
    for (auto at = text.find(part); at != std::string::npos; at = text.find(part))
        text.erase(at, part.size());
    return text;
}

/// Reads what is in `home`/out/NAME. A capture that cannot be opened leaves nothing there but a line of what was said.
Outcome outcome_of(const fs::path& home, const std::string& name) {
    Outcome outcome;
    const auto add = [&](const json& sentences) {
        for (const std::string sentence : sentences)
            outcome.sentences.push_back(without(sentence, name + "/"));
    };
    const fs::path out = home / "out" / name;
    if (!fs::exists(out / "manifest.json")) {
        outcome.frames["failed"] = 1;
        for (const std::string& line : lines_of(home / "said"))
            if (line.find(name + ":") != std::string::npos)
                outcome.sentences.push_back(without(line, name + ": "));
        return outcome;
    }
    const json manifest = json::parse(std::ifstream(out / "manifest.json"));
    for (const json& frame : manifest.at("frames")) {
        const std::string status = frame.at("status"), frame_name = frame.at("name");
        ++outcome.frames[status];
        if (frame.contains("why"))
            add(json::array({frame["why"]}));
        add(frame.value("doubts", json::array()));
        add(frame.value("warnings", json::array()));
        if (const fs::path map = out / "ao" / (frame_name + ".png"); fs::exists(map))
            outcome.visibility[frame_name] = read_ao(map);
    }
    const json checks = json::parse(std::ifstream(out / "checks.json"));
    for (const json& frame : checks.at("frames"))
        for (const json& each : frame.at("found"))
            outcome.findings.push_back({check_named(each.at("check").get<std::string>()),
                                        each.at("value").is_number() ? each["value"].get<double>() : NAN,
                                        each.at("limit").is_number() ? each["limit"].get<double>() : NAN,
                                        each.at("doubtful").get<bool>() ? "doubtful" : ""});
    add(manifest.value("warnings", json::array()));
    add(manifest.at("capture").value("warnings", json::array()));
    return outcome;
}

/// RMS difference on the pixels that both have, by name of the frame; NaN where there is none.
double rms_between(const Maps& some, const Maps& others, const RecordingPerturbation& perturbation) {
    double squares = 0, values = 0;
    for (const auto& [name, map] : some) {
        const auto other = others.find(name);
        if (other == others.end())
            continue;
        const cv::Rect inside({}, other->second.size());
        for (int v = 0; v < map.rows; ++v)
            for (int u = 0; u < map.cols; ++u) {
                const cv::Point there =
                    perturbation.original_of ? perturbation.original_of({u, v}, map.size()) : cv::Point(u, v);
                if (!inside.contains(there))
                    continue;
                const auto off = static_cast<double>(map(v, u) - other->second(there));
                squares += std::isnan(off) ? 0 : off * off;
                values += !std::isnan(off);
            }
    }
    return std::sqrt(squares / values);
}

// --- the table ---

class Gauntlet {
  public:
    explicit Gauntlet(std::vector<std::string> words) : words_(std::move(words)) {
        fmt::print("{:<34} {:<17} {:>6} {:>6}  {:<22} {}\n", "recording", "perturbation", "rms", "rmse", "frames",
                   "first new sentence");
    }

    [[nodiscard]] bool wants(const std::string& name) const {
        return words_.empty() || std::ranges::any_of(words_, [&](const std::string& word) {
                   return name.find(word) != std::string::npos;
               });
    }

    /// All copies are captures of one run: the program and the driver start once.
    void run(const Recording& recording) {
        const fs::path home = folder_.path() / std::to_string(recordings_++);
        std::vector<RecordingPerturbation> rows;
        std::string names;
        for (const RecordingPerturbation& row : recording_perturbations()) {
            if (row.lists && !recording.tum)
                continue;
            const fs::path folder = home / row.name;
            fs::create_directories(folder);
            RecordingCopy copy = recording.copy_to(folder);
            row.apply(copy);
            rows.push_back(row);
            names += fmt::format("{} ", row.name);
        }
        run_program(home, "run " + names + "-o out --write ao --quiet");
        const Outcome plain = outcome_of(home, std::string(rows.front().name));
        if (plain.visibility.empty())
            throw Error(fmt::format("{}: no result: {}", recording.name, fmt::join(lines_of(home / "said"), "; ")));
        const double error = rms_between(plain.visibility, recording.truth, rows.front());
        for (const RecordingPerturbation& row : rows)
            print(recording, row, plain, outcome_of(home, std::string(row.name)), error);
        fs::remove_all(home);
    }

    /// The README's table, and the rows that are wrong without a word; the exit code. Nothing run is a failure, too.
    [[nodiscard]] int result() const {
        print_table();
        fmt::print("\n{} of {} rows are silently wrong:\n{}\n", wrong_.size(), rows_, fmt::join(wrong_, "\n"));
        return rows_ == 0 || !wrong_.empty();
    }

    [[nodiscard]] const fs::path& folder() const { return folder_.path(); }

  private:
    /// One perturbation of all recordings of one kind.
    struct Cell {
        double largest_rms = NAN; ///< of those with a result
        std::size_t rows = 0, silent = 0, told = 0;
    };

    void print_table() const {
        fmt::print("\n| perturbation |");
        for (const std::string& kind : kinds_)
            fmt::print(" {} ({}) |", kind, cells_.at({kind, "unperturbed"}).rows);
        for (const RecordingPerturbation& row : recording_perturbations()) {
            if (row.name == "unperturbed")
                continue;
            fmt::print("\n| {} |", row.name);
            for (const std::string& kind : kinds_) {
                const auto found = cells_.find({kind, std::string(row.name)});
                fmt::print(" {} |", found == cells_.end() ? "" : told(found->second));
            }
        }
        fmt::print("\n");
    }

    static std::string told(const Cell& cell) {
        const std::string rms = std::isnan(cell.largest_rms) ? "none" : fmt::format("{:.2f}", cell.largest_rms);
        if (cell.silent > 0)
            return cell.rows > 1 ? fmt::format("**{}** ({})", rms, cell.silent) : fmt::format("**{}**", rms);
        return rms + (cell.told == cell.rows ? " d" : "");
    }

    void print(const Recording& recording, const RecordingPerturbation& row, const Outcome& plain,
               const Outcome& outcome, double plain_error) {
        const double rms = rms_between(outcome.visibility, plain.visibility, row);
        const double error = rms_between(outcome.visibility, recording.truth, row);
        std::vector<std::string> statuses, sentences; // what the unperturbed copy is told of, too, is no news
        for (const auto& [status, number] : outcome.frames)
            statuses.push_back(fmt::format("{} {}", number, status));
        const std::string frames = fmt::format("{}", fmt::join(statuses, ", "));
        const bool is_plain = row.name == "unperturbed";
        for (const std::string& sentence : outcome.sentences)
            if (is_plain || std::ranges::find(plain.sentences, sentence) == plain.sentences.end())
                sentences.push_back(sentence);
        const bool all_ok = outcome.frames.size() == 1 && outcome.frames.contains("ok");
        // What comes no farther from the truth is not wrong, however it differs. Lost frames are wrong, too.
        const bool moved = !(rms <= largest_rms) && !(error <= plain_error + hardly_any_rms);
        const bool wrong = moved || outcome.count() < plain.count();
        const bool silent = all_ok && sentences.empty() && wrong;
        if (outcome.count() == outcome.visibility.size()) // what is refused or failed has no checks
            write_checks(recording.name, std::string(row.name),
                         is_plain ? RowKind::valid
                         : wrong  ? RowKind::wrong
                                  : RowKind::harmless,
                         outcome.findings);
        const std::string line = fmt::format("{:<34} {:<17} {:>6.3f} {:>6}  {:<22} {}", recording.name, row.name, rms,
                                             std::isnan(error) ? "" : fmt::format("{:.3f}", error),
                                             fmt::join(statuses, ", "), sentences.empty() ? "" : sentences.front());
        fmt::print("{}{}\n", line, silent ? "SILENTLY WRONG" : "");
        std::fflush(stdout);
        ++rows_;
        if (silent)
            wrong_.push_back(line);
        if (std::ranges::find(kinds_, recording.kind) == kinds_.end())
            kinds_.push_back(recording.kind);
        Cell& cell = cells_[{recording.kind, std::string(row.name)}];
        cell.largest_rms = std::fmax(cell.largest_rms, rms);
        ++cell.rows;
        cell.silent += silent;
        cell.told += !all_ok || !sentences.empty();
    }

    TemporaryFolder folder_;
    std::vector<std::string> words_;
    std::vector<std::string> wrong_, kinds_;
    std::map<std::pair<std::string, std::string>, Cell> cells_; ///< by kind and perturbation
    std::size_t rows_ = 0, recordings_ = 0;
};

/// Without poses, nothing tells the unit of depth.
void run_generated(Gauntlet& gauntlet, const std::string& sensor, bool poses) {
    const std::string name = fmt::format("generated office, {}{}", sensor, poses ? "" : ", no poses");
    if (!gauntlet.wants(name))
        return;
    const fs::path made = gauntlet.folder() / name;
    run_program(gauntlet.folder(), fmt::format("generate office --frames 3 --step 10 --sensor {} --size 320x240 -o {}",
                                               sensor, quoted(made.string())));
    if (!poses)
        fs::remove(made / "groundtruth.txt");
    const Capture capture = open_capture(made);
    Recording recording{name, poses ? "generated" : "no poses",
                        [&](const fs::path& folder) { return copy_folder(capture, folder); }, true};
    for (const auto& file : fs::directory_iterator(made / "truth/ao"))
        recording.truth[file.path().stem().string()] = read_ao(file.path());
    gauntlet.run(recording);
}

void run_folders(Gauntlet& gauntlet, const fs::path& data) {
    // This one names no camera; the book that it comes from does.
    const std::map<std::string, std::string> cameras{{"rgbd_kinect_pgm", "518,519,325.5,253.5"}};
    constexpr std::pair<const char*, const char*> folders[] = {
        {"rgbd_7scenes", "7-Scenes"}, {"rgbd_7scenes_sentinel", "7-Scenes"}, {"rgbd_tum_converted", "TUM"},
        {"rgbd_tum_fr1_desk", "TUM"}, {"rgbd_redwood", "Redwood"},           {"rgbd_realsense", "RealSense"},
        {"rgbd_kinect_pgm", "PGM"}};
    for (const auto& [name, kind] : folders) {
        if (!gauntlet.wants(name) || !fs::is_directory(data / name))
            continue;
        CaptureOptions options;
        if (const auto camera = cameras.find(name); camera != cameras.end())
            options.camera = camera->second;
        const Capture capture = open_capture(data / name, options);
        gauntlet.run({name, kind, [&](const fs::path& folder) { return copy_folder(capture, folder); },
                      capture.kind == "TUM RGB-D"});
    }
}

void run_images(Gauntlet& gauntlet, const fs::path& data) {
    struct Image {
        std::string file, depth_scale, camera;
    };
    std::vector<Image> images{{"single_frames/NYU_depth.pgm", "nyu", "525,525,319.5,239.5"},
                              {"single_frames/SUN_depth.png", "sun", "525,525,319.5,239.5"},
                              {"single_frames/TUM_depth.png", "tum", "525,525,319.5,239.5"},
                              {"pclzf/frame_20121214T142255.814212_depth.pclzf", "", ""}};
    if (fs::is_directory(data / "organised"))
        for (const auto& file : fs::directory_iterator(data / "organised"))
            if (file.path().extension() == ".pcd")
                images.push_back({"organised/" + file.path().filename().string(), "", ""});
    std::ranges::sort(images, {}, &Image::file);
    for (const Image& image : images) {
        const std::string name = image.file.substr(0, 33);
        if (!gauntlet.wants(name) || !fs::exists(data / image.file))
            continue;
        const Capture capture =
            open_capture(data / image.file, {.camera = image.camera, .depth_scale = image.depth_scale});
        const DepthImage depth = project(capture.load(0, false));
        const std::string kind = name.starts_with("single") ? "single" : "organised";
        gauntlet.run({name, kind, [&](const fs::path& folder) { return copy_image(depth, "frame", folder); }});
    }
}

} // namespace
} // namespace scanshade::gauntlet

/// Arguments: words, one of which the recordings' names must contain. Exit code: 0 = no row is silently wrong, 1 = some
/// are.
int main(int count, char** arguments) {
    using namespace scanshade::gauntlet;
    const scanshade::Stopwatch stopwatch;
    Gauntlet gauntlet({arguments + 1, arguments + count});
    const std::filesystem::path folder = scanshade::tests::data_folder();
    for (const char* sensor : {"ideal", "kinect", "tof"})
        run_generated(gauntlet, sensor, true);
    run_generated(gauntlet, "kinect", false);
    run_folders(gauntlet, folder);
    run_images(gauntlet, folder);
    const int result = gauntlet.result();
    fmt::print("{:.0f} s\n", stopwatch.ms() / 1000);
    return result;
}
