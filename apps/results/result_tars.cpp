#include "apps/results/result_tars.h"

#include "apps/results/report.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <set>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

/// WebDataset takes a name's first dot for the end of the key.
std::vector<std::string> keys_for(const std::vector<CaptureEntry>& entries) {
    std::set<std::string> taken;
    std::vector<std::string> keys;
    for (const CaptureEntry& entry : entries) {
        std::string wanted = entry.name;
        std::ranges::replace(wanted, '.', '_');
        std::string key = wanted;
        for (int n = 2; !taken.insert(key).second; ++n)
            key = fmt::format("{}-{}", wanted, n);
        keys.push_back(std::move(key));
    }
    return keys;
}

/// "ao/NAME.png" -> "ao.png"
std::string part_of(const fs::path& file, const std::string& name) {
    const std::string folder = file.parent_path().filename().string();
    return (folder == "clouds" ? "cloud" : folder) + file.filename().string().substr(name.size());
}

} // namespace

ResultTars::ResultTars(const Capture& capture, const Outputs& outputs, const std::vector<std::size_t>& frames,
                       const std::string& block)
    : capture_(capture), outputs_(outputs), frames_(frames), block_(block), in_each_(outputs.frames_in_tar),
      keys_(keys_for(capture.entries)), waiting_(outputs.files_folder()), whole_(frames.size() / in_each_ + 1) {
    for (std::size_t i = 0; i < frames.size(); ++i)
        position_.emplace(frames[i], i);
    std::error_code trouble;
    fs::remove_all(outputs_.files_folder(), trouble); // of a run that was killed
    fs::create_directories(outputs_.files_folder(), trouble);
    if (trouble)
        throw Outage(fmt::format("{}: cannot be made: {}", outputs_.files_folder().string(), trouble.message()));
}

fs::path ResultTars::file_of(std::size_t tar) const {
    return fs::path(tar_folder) / fmt::format("{}{}{:06}.tar", block_, block_.empty() ? "" : "-", tar);
}

std::vector<std::size_t> ResultTars::with_neighbours(const std::vector<std::size_t>& left) const {
    std::set<std::size_t> tars;
    for (const std::size_t index : left)
        tars.insert(tar_of(index));
    std::vector<std::size_t> all;
    std::ranges::copy_if(frames_, std::back_inserter(all), [&](std::size_t i) { return tars.contains(tar_of(i)); });
    return all;
}

std::vector<std::uintmax_t> ResultTars::add(FrameRow& row) {
    const std::size_t position = position_.at(row.index), tar = tar_of(row.index), first = tar * in_each_,
                      end = std::min(first + in_each_, frames_.size());
    if (position == first) {
        open_ = std::make_unique<TarOutput>(outputs_.files_folder() / fmt::format("{:06}.tar", tar));
        next_ = first;
    }
    // A frame that is tried again later leaves its tar unfinished.
    const bool settled = row.status != FrameStatus::skipped && row.fault != Fault::outage;
    if (!open_ || position != next_ || !settled) {
        open_.reset();
        row.files.clear();
        return {};
    }
    std::vector<std::pair<std::string, std::string>> members;
    for (const fs::path& file : row.files) {
        members.emplace_back(part_of(file, row.name), read_bytes(outputs_.files_folder() / file));
        fs::remove(outputs_.files_folder() / file);
    }
    members.emplace_back("json", json_line(sample_json(row, capture_.entries.at(row.index), capture_.unit)) + "\n");
    std::ranges::sort(members);
    row.files.clear();
    std::vector<std::uintmax_t> sizes;
    const fs::path target = file_of(tar);
    for (const auto& [part, bytes] : members) {
        const std::string name = keys_[row.index] + "." + part;
        open_->add(name, bytes);
        row.files.push_back(target / name);
        sizes.push_back(bytes.size());
    }
    if (++next_ == end) {
        open_->finish(outputs_.folder / target);
        open_.reset();
        whole_[tar] = true;
    }
    return sizes;
}

bool ResultTars::has(std::size_t index) const { return whole_[tar_of(index)]; }

void ResultTars::clean_up() {
    open_.reset();
    std::error_code gone_already;
    fs::remove_all(outputs_.files_folder(), gone_already);
}

} // namespace scanshade
