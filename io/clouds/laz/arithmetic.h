// The arithmetic coder of LAZ (Said, "Introduction to Arithmetic Coding", HPL-2004-76) with its adaptive models.
// Decoder and Encoder have the same three calls, so that every item is written once for both directions: a call takes
// the value to encode and returns the value that is coded; the decoder ignores what it is given.
#pragma once

#include "projection/base/error.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <fmt/format.h>
#include <string>
#include <string_view>
#include <vector>

namespace scanshade::laz {

/// Adaptive frequencies of `size` symbols (2 .. 2048). Memory is taken at the first use.
class SymbolModel {
  public:
    explicit SymbolModel(unsigned size = 256) : size_(size) {}

    void prepare() {
        if (memory_.empty())
            create();
    }
    /// Cumulative frequency below a symbol, in units of 2^-15; `symbol` may be the size.
    [[nodiscard]] std::uint32_t below(std::uint32_t symbol) const { return memory_[symbol]; }
    [[nodiscard]] bool is_last(std::uint32_t symbol) const { return symbol + 1 == size_; }
    /// The largest symbol with below(symbol) <= share.
    [[nodiscard]] std::uint32_t find(std::uint32_t share) const {
        const std::uint32_t within = std::min(share, whole - 1U);
        std::uint32_t symbol = memory_[table_at() + (within >> shift_)];
        while (memory_[symbol + 1] <= within)
            ++symbol;
        return symbol;
    }
    void count(std::uint32_t symbol) {
        ++memory_[size_ + 1 + symbol];
        if (--left_ == 0)
            rebuild();
    }

  private:
    static constexpr std::uint32_t whole = 1U << 15;

    [[nodiscard]] std::size_t table_at() const { return 2 * std::size_t(size_) + 1; }

    void create() {
        const std::uint32_t entries = std::bit_ceil(size_);
        shift_ = 15 - static_cast<unsigned>(std::countr_zero(entries));
        memory_.assign(table_at() + entries, 1);
        total_ = 0;
        cycle_ = size_;
        rebuild();
        cycle_ = left_ = (size_ + 6) / 2;
    }

    void rebuild() {
        std::uint16_t* const counts = memory_.data() + size_ + 1;
        total_ += cycle_;
        if (total_ > whole) {
            total_ = 0;
            for (std::uint32_t k = 0; k < size_; ++k)
                total_ += counts[k] = static_cast<std::uint16_t>((counts[k] + 1) / 2);
        }
        const std::uint32_t scale = (1U << 31) / total_;
        std::uint32_t sum = 0;
        for (std::uint32_t k = 0; k < size_; ++k) {
            memory_[k] = static_cast<std::uint16_t>(scale * sum >> 16);
            sum += counts[k];
        }
        memory_[size_] = whole; // ends the search
        std::uint16_t* const table = memory_.data() + table_at();
        const std::uint32_t entries = whole >> shift_;
        for (std::uint32_t k = 0, entry = 0; entry < entries; ++entry) {
            while (memory_[k + 1] <= entry << shift_)
                ++k;
            table[entry] = static_cast<std::uint16_t>(k);
        }
        cycle_ = left_ = std::min(cycle_ * 5 / 4, (size_ + 6) * 8);
    }

    std::uint32_t size_, total_ = 0, cycle_ = 0, left_ = 0;
    unsigned shift_ = 0;
    std::vector<std::uint16_t> memory_; ///< cumulative frequencies (size + 1), counts (size), where a search begins
};

/// Adaptive frequency of a zero bit.
struct BitModel {
    std::uint32_t zeros = 1, total = 2, share = 4096, cycle = 4, left = 4;

    void count(bool bit) {
        zeros += bit ? 0 : 1;
        if (--left > 0)
            return;
        total += cycle;
        if (total > 8192) {
            total = (total + 1) / 2;
            zeros = (zeros + 1) / 2;
            if (zeros == total)
                ++total;
        }
        share = zeros * ((1U << 31) / total) >> 18;
        cycle = left = std::min(cycle * 5 / 4, 64U);
    }
};

constexpr std::uint32_t shortest_interval = 1U << 24;

class Decoder {
  public:
    static constexpr bool encodes = false;

    /// `bytes` are a stream, which begins at byte `offset` of the file.
    Decoder(std::string_view bytes, std::uint64_t offset) : bytes_(bytes), offset_(offset) {
        for (int i = 0; i < 4; ++i)
            value_ = value_ << 8 | next();
        if (value_ == length_)
            throw Error(fmt::format("no arithmetic stream begins so (byte {})", offset_));
    }

    std::uint32_t symbol(SymbolModel& model, std::uint32_t = 0) {
        model.prepare();
        const std::uint32_t whole = length_;
        length_ >>= 15;
        const std::uint32_t s = model.find(value_ / length_);
        const std::uint32_t low = model.below(s) * length_;
        value_ -= low;
        length_ = (model.is_last(s) ? whole : model.below(s + 1) * length_) - low;
        renormalise();
        model.count(s);
        return s;
    }
    bool bit(BitModel& model, bool = false) {
        const std::uint32_t x = model.share * (length_ >> 13);
        const bool one = value_ >= x;
        value_ -= one ? x : 0;
        length_ = one ? length_ - x : x;
        renormalise();
        model.count(one);
        return one;
    }
    std::uint32_t bits(unsigned count, std::uint32_t = 0) {
        if (count > 19) {
            const std::uint32_t low = bits(16);
            return bits(count - 16) << 16 | low;
        }
        length_ >>= count;
        const std::uint32_t found = value_ / length_;
        if (found >> count != 0)
            throw Error(fmt::format("{} bits hold {} (byte {})", count, found, position()));
        value_ -= found * length_;
        renormalise();
        return found;
    }
    /// Byte of the file that is read next.
    [[nodiscard]] std::uint64_t position() const { return offset_ + at_; }

  private:
    std::uint32_t next() {
        if (at_ == bytes_.size())
            throw Error(fmt::format("the stream ends inside the points (byte {})", position()));
        return static_cast<unsigned char>(bytes_[at_++]);
    }
    /// Shifts whole bytes in until the interval is long enough: without a branch on how many, which cannot be foreseen.
    void renormalise() {
        if (bytes_.size() - at_ < sizeof(std::uint32_t)) {
            while (length_ < shortest_interval) {
                value_ = value_ << 8 | next();
                length_ <<= 8;
            }
            return;
        }
        const unsigned shift = static_cast<unsigned>(std::countl_zero(length_)) & ~7U;
        std::uint32_t coming;
        std::memcpy(&coming, bytes_.data() + at_, sizeof coming);
        value_ = static_cast<std::uint32_t>(((std::uint64_t(value_) << 32 | __builtin_bswap32(coming)) << shift) >> 32);
        length_ <<= shift;
        at_ += shift / 8;
    }

    std::string_view bytes_;
    std::size_t at_ = 0;
    std::uint64_t offset_ = 0;
    std::uint32_t value_ = 0, length_ = 0xffffffff;
};

class Encoder {
  public:
    static constexpr bool encodes = true;

    std::uint32_t symbol(SymbolModel& model, std::uint32_t s) {
        model.prepare();
        const std::uint32_t whole = length_, unit = length_ >> 15, low = model.below(s) * unit;
        add(low);
        length_ = (model.is_last(s) ? whole : model.below(s + 1) * unit) - low;
        renormalise();
        model.count(s);
        return s;
    }
    bool bit(BitModel& model, bool one) {
        const std::uint32_t x = model.share * (length_ >> 13);
        add(one ? x : 0);
        length_ = one ? length_ - x : x;
        renormalise();
        model.count(one);
        return one;
    }
    std::uint32_t bits(unsigned count, std::uint32_t value) {
        if (count > 19) {
            bits(16, value & 0xffff);
            bits(count - 16, value >> 16);
            return value;
        }
        length_ >>= count;
        add(value * length_);
        renormalise();
        return value;
    }
    /// The whole stream; nothing can be coded after it.
    [[nodiscard]] std::string finish() {
        const bool wide = length_ > 2 * shortest_interval;
        add(wide ? shortest_interval : shortest_interval / 2);
        length_ = wide ? shortest_interval / 2 : shortest_interval >> 9;
        renormalise();
        bytes_.append(wide ? 3 : 2, '\0');
        return std::move(bytes_);
    }

  private:
    void add(std::uint32_t x) {
        base_ += x;
        if (base_ >= x)
            return;
        std::size_t at = bytes_.size(); // the carry goes into the bytes written
        while (bytes_[--at] == '\xff')
            bytes_[at] = '\0';
        ++bytes_[at];
    }
    void renormalise() {
        while (length_ < shortest_interval) {
            bytes_ += static_cast<char>(base_ >> 24);
            base_ <<= 8;
            length_ <<= 8;
        }
    }

    std::string bytes_;
    std::uint32_t base_ = 0, length_ = 0xffffffff;
};

/// Codes integers of up to 32 bits by their difference from a prediction: the number of its bits, then the bits.
class IntegerCoder {
  public:
    IntegerCoder(unsigned bits, unsigned contexts) : bits_(bits), widths_(contexts, SymbolModel(bits + 1)) {
        for (unsigned k = 1; k <= bits; ++k)
            values_.emplace_back(1U << std::min(k, 8U));
    }

    /// Modulo 2^bits.
    template <class Coder>
    std::uint32_t code(Coder& coder, std::uint32_t prediction, std::uint32_t value, unsigned context = 0) {
        std::uint32_t coded = 0;
        if constexpr (Coder::encodes) {
            const auto step = static_cast<std::int32_t>((value - prediction) << (32 - bits_)) >> (32 - bits_);
            const std::uint32_t steps = static_cast<std::uint32_t>(step);
            width_ = static_cast<unsigned>(std::bit_width(step <= 0 ? 0U - steps : steps - 1));
            coded = width_ == 0 ? steps : step < 0 ? steps + mask(width_) : steps - 1;
        }
        width_ = coder.symbol(widths_[context], width_);
        if (width_ == 0)
            return wrapped(prediction + (coder.bit(zero_or_one_, coded != 0) ? 1 : 0));
        if (width_ == 32)
            return prediction + (1U << 31);
        SymbolModel& high = values_[width_ - 1];
        if (width_ <= 8) {
            coded = coder.symbol(high, coded);
        } else {
            const unsigned low_bits = width_ - 8;
            const std::uint32_t top = coder.symbol(high, coded >> low_bits);
            coded = top << low_bits | coder.bits(low_bits, coded & mask(low_bits));
        }
        return wrapped(prediction + (coded >= 1U << (width_ - 1) ? coded + 1 : coded - mask(width_)));
    }
    /// Bits of the last difference, 0 .. 32.
    [[nodiscard]] unsigned width() const { return width_; }

  private:
    /// Of up to 32 bits.
    static std::uint32_t mask(unsigned bits) { return static_cast<std::uint32_t>((std::uint64_t(1) << bits) - 1); }
    [[nodiscard]] std::uint32_t wrapped(std::uint32_t value) const { return bits_ == 32 ? value : value & mask(bits_); }

    unsigned bits_, width_ = 0;
    std::vector<SymbolModel> widths_, values_;
    BitModel zero_or_one_;
};

/// A running median of differences: five sorted values, of which the largest and the smallest take turns to leave.
class Median {
  public:
    [[nodiscard]] std::int32_t get() const { return sorted_[2]; }
    void add(std::int32_t value) {
        const std::int32_t middle = sorted_[2];
        if (largest_leaves_) {
            std::size_t at = 4;
            for (; at > 0 && sorted_[at - 1] > value; --at)
                sorted_[at] = sorted_[at - 1];
            sorted_[at] = value;
            largest_leaves_ = value < middle;
        } else {
            std::size_t at = 0;
            for (; at < 4 && sorted_[at + 1] < value; ++at)
                sorted_[at] = sorted_[at + 1];
            sorted_[at] = value;
            largest_leaves_ = value <= middle;
        }
    }

  private:
    std::array<std::int32_t, 5> sorted_{};
    bool largest_leaves_ = true;
};

} // namespace scanshade::laz
