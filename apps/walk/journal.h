// What is done: a line per finished frame, kept beside the results. A run that is to go on trusts it, `status` and
// `merge` read it.
#pragma once

#include "apps/walk/frame_row.h"
#include "projection/error.h"

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

namespace scanshade {

/// One finished frame: its row of the report, and what it was made from.
struct Record {
    FrameRow row;
    std::string settings;              ///< hash of what was asked for, and of the program's version
    std::string stamp, input;          ///< of the frame's files, joined: as stat tells, and hashed
    std::vector<std::uintmax_t> sizes; ///< bytes of row.files
};

/// Who last wrote to a journal, and how its task stands.
struct JournalFacts {
    std::string complete;                       ///< Journal::complete()'s key, unless frames were added since
    std::string host, device, started;          ///< of the last process that worked here
    std::string begun;                          ///< a frame that was begun alone and did not come to its end
    std::map<std::string, Record> records = {}; ///< by frame name; the latest of each
};

/// The journal of a whole capture ("") or of a block of its frames ("0-500") in the folder of its results.
[[nodiscard]] std::filesystem::path journal_file(const std::filesystem::path& folder, const std::string& block);

/// Every line that makes sense; a torn last one is what a kill leaves. Nothing is locked. Empty where there is no file.
[[nodiscard]] JournalFacts read_journal(const std::filesystem::path& file);

/// Whether a process holds the journal now.
[[nodiscard]] bool in_use(const std::filesystem::path& file);

/// Whether the journal's last line says that its task is complete, whatever it was made from: a look at a few bytes.
[[nodiscard]] bool is_complete(const std::filesystem::path& file);

/// "settings" of a Record, or the key of a task: parts joined in order and hashed, the program's version among them.
[[nodiscard]] std::string key_of(const std::vector<std::string>& parts);

/// Another process holds the journal.
class Busy : public Outage {
  public:
    using Outage::Outage;
};

/// The journal held for writing; of what it says no more is in memory than where it says it. Its lock is the kernel's
/// (flock): it goes with the process, however that ends, so that there are no stale ones; over NFS and Lustre it holds
/// between machines.
class Journal {
  public:
    /// Makes the folder and the file where missing, waits for nobody. Throws Busy where another process holds it.
    /// Frames of the folder's other journals (blocks of another plan) are known, too.
    Journal(std::filesystem::path folder, const std::string& block);
    ~Journal();
    Journal(const Journal&) = delete;
    Journal& operator=(const Journal&) = delete;

    /// Forgets everything; the journal of a whole capture removes those of blocks beside it.
    void clear();
    /// The frame's row if it was made from the same settings (where given) and input, and its files lie there in full;
    /// a failed row counts unless its fault was an outage or `retry` asks for all.
    [[nodiscard]] std::optional<FrameRow> done(const CaptureEntry& entry, const std::optional<std::string>& settings,
                                               bool retry) const;
    /// A row with all that shorten() took of it; rows that are not recorded come back as they are.
    [[nodiscard]] FrameRow whole(const FrameRow& row) const;
    /// One line, the kernel's when this returns, so that it outlives the process; the disk has it a second later: a
    /// frame whose line a power cut takes is done again. Skipped frames are not recorded. Throws Outage where it cannot
    /// be.
    void add(const FrameRow& row, const CaptureEntry& entry, const std::string& settings, const std::string& device);
    /// Frames that are about to be done again: their records no longer say what lies in their files.
    void forget(const Capture& capture, const std::vector<std::size_t>& frames);
    /// A frame that is tried alone, because one of its neighbours killed an earlier process.
    void begin_alone(const std::string& frame);
    /// All of the task's frames are recorded; `key` stands for settings and stamps of everything it was made from.
    void complete(const std::string& key);
    /// Those of this journal, without the records.
    [[nodiscard]] const JournalFacts& facts() const { return facts_; }

  private:
    /// Where a frame's line begins.
    struct Place {
        std::size_t journal; ///< of journals_
        std::int64_t at;     ///< bytes from its begin
    };
    enum class Sync { now, soon };
    /// Where the line begins.
    std::int64_t append(const std::string& line, Sync sync = Sync::now);
    void take_places(std::size_t journal);
    [[nodiscard]] std::optional<Record> record_of(const std::string& frame) const;
    [[nodiscard]] bool files_are_there(const Record& record) const;

    std::filesystem::path folder_, file_;
    int handle_ = -1;
    bool introduced_ = false;
    std::chrono::steady_clock::time_point synced_; ///< when the disk last had every line
    JournalFacts facts_;
    std::vector<std::filesystem::path> journals_;   ///< of the folder, this one last
    std::unordered_map<std::string, Place> places_; ///< by frame name
};

} // namespace scanshade
