// The journal: a line per finished frame, kept with the results. --resume trusts it; `status` and `merge` read it.
#pragma once

#include "apps/frame/frame_row.h"
#include "apps/results/task_sums.h"
#include "projection/base/error.h"

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <unordered_map>
#include <vector>

namespace scanshade {

/// One finished frame: its row of the report, and what it was made from.
struct Record {
    FrameRow row;
    std::string settings;              ///< hash of the settings and of the program's version
    std::string stamp, input;          ///< of the frame's files, joined: stamp_of() and hash of the content
    std::vector<std::uintmax_t> sizes; ///< bytes of row.files
};

/// The progress of a task whose input is fetched, or whose results are delivered, by hooks.
struct StoredFacts {
    std::string in;         ///< where the input was last; messages about frames name files in it
    std::size_t frames = 0; ///< in the fetched input; 0 = not known yet
    std::string computed;   ///< key of the task whose results were complete, unless frames were added since
    int code = 0;           ///< its exit code
    std::string refused;    ///< why the input cannot be computed
    std::string ended;      ///< key of the task after which nothing is left to do
    std::string trouble;    ///< the last failure of a hook, if nothing went well since
};

/// The last process that wrote to a journal, and the progress of its task.
struct JournalFacts {
    std::string complete;                       ///< Journal::complete()'s key, unless frames were added since
    std::string host, device, started;          ///< of the last process that worked here
    std::string begun;                          ///< a frame that was begun alone and did not end
    StoredFacts stored = {};                    ///< where hooks fetch and deliver
    std::map<std::string, Record> records = {}; ///< by frame name; the latest of each
};

/// The end of a complete task's journal, without its frames.
struct JournalEnd {
    TaskSums sums;
    std::string host, device; ///< of the last process that computed frames
    StoredFacts stored;       ///< as far as lines after the frames tell
};
/// Reads the last kilobytes of a journal. Nothing where its task is not complete, or an earlier version wrote it: then
/// read_journal() knows.
[[nodiscard]] std::optional<JournalEnd> read_journal_end(const std::filesystem::path& file);

/// The journal of a whole capture ("") or of a block of its frames ("0-500") in the folder of its results.
[[nodiscard]] std::filesystem::path journal_file(const std::filesystem::path& folder, const std::string& block);

/// Reads every valid line, without a lock. A kill may leave the last line torn. Empty if there is no file.
[[nodiscard]] JournalFacts read_journal(const std::filesystem::path& file);

/// Whether a journal in the folder records a frame with results.
[[nodiscard]] bool has_results(const std::filesystem::path& folder);

/// The path of the capture whose results the folder's journal records, if that is another one than `capture`. One that
/// was moved is not another: then its frames' files are the same.
[[nodiscard]] std::optional<std::string> other_capture_in(const std::filesystem::path& folder, const Capture& capture);

/// Whether a process holds the journal now.
[[nodiscard]] bool in_use(const std::filesystem::path& file);

/// Whether the journal's last line says that its task is complete, with whatever settings; or "ended", where hooks
/// deliver. Reads a few bytes only.
[[nodiscard]] bool is_complete(const std::filesystem::path& file, std::string_view kind = "complete");

/// "settings" of a Record, or the key of a task: parts joined in order and hashed, the program's version among them.
[[nodiscard]] std::string key_of(const std::vector<std::string>& parts);

/// Another process holds the journal.
class Busy : public Outage {
  public:
    using Outage::Outage;
};

/// A journal held for writing. Memory holds only the position of each frame's line. The kernel's lock (flock) ends with
/// the process, so it is never stale. Over NFS and Lustre it holds between machines.
class Journal {
  public:
    /// Makes the folder and the file if missing. Throws Busy at once if another process holds the journal, and
    /// Misuse if it may not be written. Also reads
    /// the folder's other journals (blocks of another plan).
    /// `results`: where the frames' files are; empty = in the folder. `siblings`: names of journals of the same plan's
    /// blocks, which hold other frames and are not read.
    Journal(std::filesystem::path folder, const std::string& block, std::filesystem::path results = {},
            const std::set<std::string>* siblings = nullptr);
    ~Journal();
    Journal(const Journal&) = delete;
    Journal& operator=(const Journal&) = delete;

    /// Deletes all records. The journal of a whole capture also removes the journals of its blocks.
    void clear();
    /// The frame's row, if settings (where given) and input are the same and all its files are complete. A failed row
    /// counts, unless its fault was an outage or `retry` is set.
    [[nodiscard]] std::optional<FrameRow> done(const CaptureEntry& entry, const std::optional<std::string>& settings,
                                               bool retry) const;
    /// The row with everything that shorten() removed. Rows that are not recorded come back unchanged.
    [[nodiscard]] FrameRow whole(const FrameRow& row) const;
    /// Names the capture in the lines that follow; other_capture_in() reads it.
    void set_capture(const Capture& capture);
    /// Writes one line. When this returns the kernel has it, so it outlives the process. The disk has it a second
    /// later; a frame whose line is lost in a power cut is done again. Skipped frames are not recorded. Throws Outage
    /// if the line cannot be written.
    /// `sizes`: bytes of row.files, where these are not in the folder yet.
    void add(const FrameRow& row, const CaptureEntry& entry, const std::string& settings, const std::string& device,
             const std::vector<std::uintmax_t>* sizes = nullptr);
    /// Drops the records of frames that are about to be computed again: their files will change.
    void forget(const Capture& capture, const std::vector<std::size_t>& frames);
    /// Records that a frame is tried alone, because it or another one killed an earlier process.
    void begin_alone(const std::string& frame);
    /// Records that all frames of the task are done; `key` is the task's task_key(), `sums` are of its frames.
    void complete(const std::string& key, const TaskSums& sums);
    /// The input lies in the folder, and has so many frames.
    void fetched(const std::filesystem::path& in, std::size_t frames);
    /// A hook failed: which, on which of its tries, why, and the end of what it said.
    void hook_failed(const std::string& hook, int attempt, const std::string& reason, const std::string& said);
    /// The results under this key are complete; what the run's exit code would be.
    void computed(const std::string& key, int code);
    /// Nothing is left to do for the task: its results are where they belong, or its input is refused.
    void ended(const std::string& key, const std::string& refused = "");
    /// Whether all recorded frames' files are complete.
    [[nodiscard]] bool all_files_are_there() const;
    /// Whether this made the file, and no other journal was read: no process was at work on these frames before.
    [[nodiscard]] bool is_first() const { return made_ && journals_.size() == 1; }
    /// The handle that holds the lock.
    [[nodiscard]] int lock() const { return handle_; }
    /// The facts of this journal, without the records.
    [[nodiscard]] const JournalFacts& facts() const { return facts_; }

  private:
    /// Where a frame's line begins.
    struct Position {
        std::size_t journal; ///< of journals_
        std::int64_t at;     ///< bytes from its start
    };
    enum class Sync { now, soon };
    /// Where the line begins.
    std::int64_t append(const std::string& line, Sync sync = Sync::now);
    void read_positions(std::size_t journal);
    [[nodiscard]] std::optional<Record> record_of(const std::string& frame) const;
    [[nodiscard]] bool files_are_there(const Record& record) const;

    std::filesystem::path folder_, file_, results_;
    int handle_ = -1;
    std::string capture_;
    bool introduced_ = false, made_ = false;
    std::chrono::steady_clock::time_point synced_; ///< when the disk last had every line
    JournalFacts facts_;
    std::vector<std::filesystem::path> journals_;         ///< of the folder, this one last
    std::unordered_map<std::string, Position> positions_; ///< by frame name
};

} // namespace scanshade
