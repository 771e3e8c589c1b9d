// Sources of a job: names of captures in a store, as a hook knows them. They are not looked at.
#pragma once

#include <cstdint>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

namespace scanshade {

struct Source {
    std::string name;
    std::uint64_t bytes = 0; ///< 0 = not listed
};

/// Those on the command line, then those of the list: a file, "-" for standard input, or "" for none. A line holds a
/// source, and maybe a tab and its size in bytes. Throws Error naming file and line, or the source, for one that is
/// empty, twice there, not UTF-8, or begins with '-'.
[[nodiscard]] std::vector<Source> sources_from(const std::vector<std::string>& given,
                                               const std::filesystem::path& list);

/// Names tasks after their sources: "s3:bucket/scans/a.ply" is s3/bucket/scans/a.ply. Two names are never equal, and
/// none is a folder in another's.
class SourceNames {
  public:
    /// Throws Error where the source lies within an earlier one, or an earlier one in it.
    [[nodiscard]] std::string name_of(const std::string& source);

  private:
    std::set<std::string> taken_;   ///< names
    std::set<std::string> folders_; ///< in which a name is
};

} // namespace scanshade
