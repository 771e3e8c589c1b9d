#include "apps/lists.h"

#include "io/text.h"
#include "projection/base/error.h"

#include <fmt/format.h>
#include <limits>
#include <sstream>

namespace scanshade {

std::vector<std::string> comma_separated(const std::string& list) {
    std::vector<std::string> words;
    std::istringstream stream(list);
    for (std::string word; std::getline(stream, word, ',');)
        if (!word.empty())
            words.push_back(word);
    return words;
}

std::vector<int> whole_numbers(const std::string& flag, const std::string& list, int least) {
    std::vector<int> numbers;
    for (const std::string& word : comma_separated(list)) {
        const auto value = whole_number(word);
        if (!value || *value > static_cast<std::uint64_t>(std::numeric_limits<int>::max()) ||
            static_cast<int>(*value) < least)
            throw Misuse(fmt::format("{}: '{}' given, expected whole numbers from {} with commas", flag, word, least));
        numbers.push_back(static_cast<int>(*value));
    }
    return numbers;
}

std::vector<double> numbers(const std::string& flag, const std::string& list, double least) {
    std::vector<double> found;
    for (const std::string& word : comma_separated(list)) {
        const auto value = number(word);
        if (!value || !(*value >= least))
            throw Misuse(fmt::format("{}: '{}' given, expected numbers from {} with commas", flag, word, least));
        found.push_back(*value);
    }
    return found;
}

} // namespace scanshade
