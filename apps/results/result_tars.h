// --tar: the results of every so many frames as one tar, `tars/000000.tar`, in the form that WebDataset reads.
#pragma once

#include "apps/frame/frame_row.h"
#include "apps/frame/outputs.h"
#include "io/output_file.h"
#include "io/tar_output.h"

#include <cstdint>
#include <memory>
#include <string>
#include <unordered_map>
#include <vector>

namespace scanshade {

/// Frames come in their order; each leaves KEY.json and its files, KEY.ao.png and so on, beside each other. A tar gets
/// its name once it is whole, so a frame is done if its tar is there. Bytes depend on input and settings alone.
class ResultTars {
  public:
    /// `frames` are those of the whole task, `outputs.frames_in_tar` of which go into each tar. `block`: "" or of a
    /// job.
    ResultTars(const Capture& capture, const Outputs& outputs, const std::vector<std::size_t>& frames,
               const std::string& block);
    ~ResultTars() { clean_up(); }
    ResultTars(const ResultTars&) = delete;
    ResultTars& operator=(const ResultTars&) = delete;

    /// The frames among those of the task that have to be computed if `left` have to: those of their tars.
    [[nodiscard]] std::vector<std::size_t> with_neighbours(const std::vector<std::size_t>& left) const;
    /// Takes over the files that the walk left, which are gone then; row.files becomes their places in the tar. Returns
    /// their bytes. Throws Outage where the tar cannot be written.
    std::vector<std::uintmax_t> add(FrameRow& row);
    /// Whether the tar of a frame that was added is whole.
    [[nodiscard]] bool has(std::size_t index) const;
    /// Removes what is left of tars that are not whole.
    void clean_up();

    /// A frame's name without dots, unique in the capture.
    [[nodiscard]] const std::string& key_of(std::size_t index) const { return keys_.at(index); }

  private:
    [[nodiscard]] std::size_t tar_of(std::size_t index) const { return position_.at(index) / in_each_; }
    [[nodiscard]] std::filesystem::path file_of(std::size_t tar) const; ///< relative to the folder

    const Capture& capture_;
    const Outputs& outputs_;
    std::vector<std::size_t> frames_;
    std::string block_;
    std::size_t in_each_;
    std::vector<std::string> keys_;
    std::unordered_map<std::size_t, std::size_t> position_; ///< of a frame in the task
    UnsyncedFolder waiting_;                                ///< files there are moved into a tar, which is synced
    std::unique_ptr<TarOutput> open_;
    std::size_t next_ = 0; ///< the position that the open tar needs
    std::vector<bool> whole_;
};

} // namespace scanshade
