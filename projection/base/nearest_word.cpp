#include "projection/base/nearest_word.h"

#include <algorithm>

namespace scanshade {
namespace {

/// Optimal string alignment: Levenshtein's distance with swaps of neighbours.
std::size_t edits_between(std::string_view a, std::string_view b) {
    std::vector<std::vector<std::size_t>> edits(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
    for (std::size_t i = 0; i <= a.size(); ++i)
        for (std::size_t j = 0; j <= b.size(); ++j) {
            if (i == 0 || j == 0) {
                edits[i][j] = i + j;
                continue;
            }
            const std::size_t changed = a[i - 1] == b[j - 1] ? 0 : 1;
            edits[i][j] = std::min({edits[i - 1][j] + 1, edits[i][j - 1] + 1, edits[i - 1][j - 1] + changed});
            if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
                edits[i][j] = std::min(edits[i][j], edits[i - 2][j - 2] + 1);
        }
    return edits[a.size()][b.size()];
}

} // namespace

std::string nearest_word(std::string_view word, const std::vector<std::string>& candidates) {
    std::size_t least = std::min<std::size_t>((word.size() + 2) / 3, 3) + 1;
    std::string nearest;
    for (const std::string& candidate : candidates)
        if (const std::size_t edits = edits_between(word, candidate); edits < least) {
            least = edits;
            nearest = candidate;
        }
    return nearest;
}

std::string suggestion(std::string_view word, const std::vector<std::string>& candidates) {
    const std::string nearest = nearest_word(word, candidates);
    return nearest.empty() ? "" : "; did you mean " + nearest + "?";
}

} // namespace scanshade
