#include "io/captures/listing/json_table.h"

#include "io/file_bytes.h"
#include "io/shallow_json.h"
#include "projection/base/error.h"

#include <algorithm>
#include <fmt/format.h>
#include <iterator>
#include <nlohmann/json.hpp>

namespace scanshade {

namespace fs = std::filesystem;
using Json = nlohmann::json;

namespace {

/// A file's bytes one by one, read in blocks.
struct Reading {
    explicit Reading(const fs::path& path) : file(path) { next_block(); }

    FileBytes file;
    std::string block;
    std::uint64_t begin = 0; ///< of the block in the file
    std::size_t at = 0;      ///< in the block
    std::uint64_t last_word = 0;

    void next_block() {
        constexpr std::uint64_t block_bytes = 1 << 20, longest_word = 1 << 20;
        begin += block.size();
        at = 0;
        block = file.bytes(begin, std::min(block_bytes, file.size() - begin));
        if (begin - std::min(begin, last_word) > longest_word + block_bytes)
            throw Error(fmt::format("{}: byte {}: a word of more than {} bytes", file.path().string(), last_word,
                                    longest_word));
    }
};

class ByteIterator {
  public:
    using iterator_category = std::input_iterator_tag;
    using value_type = char;
    using difference_type = std::ptrdiff_t;
    using pointer = const char*;
    using reference = char;

    ByteIterator() = default; ///< the end
    explicit ByteIterator(Reading& reading) : reading_(&reading) {}
    char operator*() const { return reading_->block[reading_->at]; }
    ByteIterator& operator++() {
        if (++reading_->at == reading_->block.size())
            reading_->next_block();
        return *this;
    }
    friend bool operator==(const ByteIterator& a, const ByteIterator& b) { return a.ended() == b.ended(); }
    friend bool operator!=(const ByteIterator& a, const ByteIterator& b) { return !(a == b); }

  private:
    [[nodiscard]] bool ended() const { return !reading_ || reading_->block.empty(); }
    Reading* reading_ = nullptr;
};

class Rows final : public nlohmann::json_sax<Json> {
  public:
    Rows(Reading& reading, const std::vector<std::string>& keys, const std::function<void(TableRow&)>& take)
        : reading_(reading), keys_(keys), take_(take), none_(keys.size()), wanted_(none_) {
        clear();
    }

    bool null() override { return word(); }
    bool boolean(bool /*value*/) override { return word(); }
    bool number_integer(std::int64_t value) override { return number(static_cast<double>(value)); }
    bool number_unsigned(std::uint64_t value) override { return number(static_cast<double>(value)); }
    bool number_float(double value, const std::string& /*text*/) override { return number(value); }
    bool string(std::string& value) override {
        if (depth_ == in_row && wanted_ != none_)
            row_.texts[wanted_] = std::move(value);
        return word();
    }
    bool binary(Json::binary_t& /*value*/) override { return word(); }
    bool key(std::string& name) override {
        if (depth_ == in_row)
            wanted_ = static_cast<std::size_t>(std::ranges::find(keys_, name) - keys_.begin());
        reading_.last_word = here();
        return true;
    }
    bool start_object(std::size_t /*count*/) override {
        if (depth_ == 0)
            refuse();
        return deeper();
    }
    bool start_array(std::size_t /*count*/) override {
        if (depth_ == 1)
            refuse();
        return deeper();
    }
    bool end_object() override {
        if (depth_-- == in_row) {
            take_(row_);
            clear();
        }
        return true;
    }
    bool end_array() override {
        --depth_;
        return true;
    }
    bool parse_error(std::size_t byte, const std::string& /*word*/, const Json::exception& /*failure*/) override {
        throw Error(fmt::format("{}: byte {}: not JSON, or NaN or infinity in it", reading_.file.path().string(),
                                byte > 0 ? byte - 1 : 0));
    }

  private:
    static constexpr int in_row = 2, in_list = 3; ///< depths

    [[nodiscard]] std::uint64_t here() const { return reading_.begin + reading_.at; }
    [[noreturn]] void refuse() const {
        throw Error(fmt::format("{}: byte {}: expected a list of objects", reading_.file.path().string(), here()));
    }
    bool word() {
        if (depth_ < in_row)
            refuse();
        reading_.last_word = here();
        return true;
    }
    bool number(double value) {
        constexpr std::size_t most = 64; // of a row's own: more are no pose
        if ((depth_ == in_row || depth_ == in_list) && wanted_ != none_ && row_.numbers[wanted_].size() < most)
            row_.numbers[wanted_].push_back(value);
        return word();
    }
    bool deeper() {
        reading_.last_word = here();
        if (++depth_ > deepest_json)
            throw Error(fmt::format("{}: byte {}: JSON nested deeper than {} levels", reading_.file.path().string(),
                                    here(), deepest_json));
        return true;
    }
    void clear() {
        row_.texts.assign(keys_.size(), {});
        row_.numbers.assign(keys_.size(), {});
        wanted_ = none_;
    }

    Reading& reading_;
    const std::vector<std::string>& keys_;
    const std::function<void(TableRow&)>& take_;
    TableRow row_;
    int depth_ = 0;
    std::size_t none_, wanted_; ///< the key that was read last, if it is one of those asked for
};

} // namespace

void for_each_row(const fs::path& file, const std::vector<std::string>& keys,
                  const std::function<void(TableRow&)>& take) {
    Reading reading(file);
    Rows rows(reading, keys, take);
    (void)Json::sax_parse(ByteIterator(reading), ByteIterator(), &rows);
}

} // namespace scanshade
