#include "io/rasters/well_known_text.h"

#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <fmt/format.h>

namespace scanshade::rasters::wkt {

namespace {

class Parser {
  public:
    explicit Parser(std::string_view text) : text_(text) {}

    Node whole() {
        Node node = this->node(word(), 0);
        return node;
    }

  private:
    static constexpr int deepest = 64;

    [[noreturn]] void fail() const {
        throw Error(fmt::format("well-known text of a coordinate system: unexpected at byte {}: {}", at_,
                                in_quotes(text_.substr(at_))));
    }
    void skip_blanks() {
        while (at_ < text_.size() && std::isspace(static_cast<unsigned char>(text_[at_])))
            ++at_;
    }
    bool take(std::string_view any) {
        skip_blanks();
        if (at_ >= text_.size() || any.find(text_[at_]) == std::string_view::npos)
            return false;
        ++at_;
        return true;
    }
    /// A keyword or a number.
    std::string word() {
        skip_blanks();
        const std::size_t begin = at_;
        while (at_ < text_.size() && (std::isalnum(static_cast<unsigned char>(text_[at_])) ||
                                      std::string_view("_+-.").find(text_[at_]) != std::string_view::npos))
            ++at_;
        if (at_ == begin)
            fail();
        return std::string(text_.substr(begin, at_ - begin));
    }
    /// Two quotes within a text are one.
    std::string quoted() {
        std::string value;
        while (at_ < text_.size()) {
            const char c = text_[at_++];
            if (c == '"' && (at_ >= text_.size() || text_[at_] != '"'))
                return value;
            if (c == '"')
                ++at_;
            value += c;
        }
        fail();
    }
    Node node(std::string keyword, int depth) {
        if (depth > deepest || !take("[("))
            fail();
        std::ranges::transform(keyword, keyword.begin(),
                               [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
        Node node{std::move(keyword), {}, {}};
        do {
            if (take("\"")) {
                node.values.push_back(quoted());
                continue;
            }
            std::string value = word();
            skip_blanks();
            if (at_ < text_.size() && (text_[at_] == '[' || text_[at_] == '('))
                node.children.push_back(this->node(std::move(value), depth + 1));
            else
                node.values.push_back(std::move(value));
        } while (take(","));
        if (!take("])"))
            fail();
        return node;
    }

    std::string_view text_;
    std::size_t at_ = 0;
};

template <class Keywords>
bool is_one_of(const Node& node, const Keywords& keywords) {
    return std::ranges::find(keywords, node.keyword) != keywords.end();
}

using Word = std::string_view;
constexpr auto projected = std::to_array<Word>({"PROJCS", "PROJCRS", "PROJECTEDCRS", "LOCAL_CS", "ENGCRS"});
constexpr auto geographic =
    std::to_array<Word>({"GEOGCS", "GEOGCRS", "GEOGRAPHICCRS", "GEODCRS", "GEODETICCRS", "GEOCCS"});
constexpr auto vertical = std::to_array<Word>({"VERT_CS", "VERTCRS", "VERTICALCRS"});
constexpr auto of_parts = std::to_array<Word>({"COMPD_CS", "COMPOUNDCRS", "BOUNDCRS", "SOURCECRS"});

} // namespace

const Node* Node::child(std::initializer_list<std::string_view> keywords) const {
    const auto found = std::ranges::find_if(children, [&](const Node& each) { return is_one_of(each, keywords); });
    return found == children.end() ? nullptr : &*found;
}

Node parsed(std::string_view text) { return Parser(text).whole(); }

const Node* horizontal_part(const Node& whole) {
    if (is_one_of(whole, projected) || is_one_of(whole, geographic))
        return &whole;
    if (!is_one_of(whole, of_parts))
        return nullptr;
    for (const Node& part : whole.children)
        if (const Node* found = horizontal_part(part))
            return found;
    return nullptr;
}

const Node* vertical_part(const Node& whole) {
    if (is_one_of(whole, vertical))
        return &whole;
    if (!is_one_of(whole, of_parts))
        return nullptr;
    for (const Node& part : whole.children)
        if (const Node* found = vertical_part(part))
            return found;
    return nullptr;
}

bool is_geographic(const Node& system) { return is_one_of(system, geographic); }

int epsg_of(const Node& system) {
    const Node* id = system.child({"AUTHORITY", "ID"});
    if (!id || id->values.size() < 2 || id->values[0] != "EPSG")
        return 0;
    const auto code = whole_number(id->values[1]);
    return code && *code <= 0x7fffffff ? static_cast<int>(*code) : 0;
}

std::optional<double> metres_in_unit(const Node& system) {
    const Node* unit = system.child({"UNIT", "LENGTHUNIT"});
    if (!unit)
        for (const Node& axis : system.children) // version 2 may give each axis its own
            if (axis.keyword == "AXIS" && !unit)
                unit = axis.child({"LENGTHUNIT", "UNIT"});
    return unit && unit->values.size() >= 2 ? number(unit->values[1]) : std::nullopt;
}

} // namespace scanshade::rasters::wkt
