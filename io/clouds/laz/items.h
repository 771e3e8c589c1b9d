// How LAZ codes what both families of records share: times and colours. Each is written once for both directions; see
// arithmetic.h.
#pragma once

#include "io/clouds/laz/arithmetic.h"

#include <cmath>
#include <cstring>

namespace scanshade::laz {

template <class Number>
Number load(const char* from) {
    Number value;
    std::memcpy(&value, from, sizeof value);
    return value;
}
template <class Number>
void store(char* to, Number value) {
    std::memcpy(to, &value, sizeof value);
}
/// The encoder's records stay as they are.
template <class Number>
void store(const char*, Number) {}

/// A record that a coder makes or takes.
template <class Coder>
using Record = std::conditional_t<Coder::encodes, const char*, char*>;

using Models = std::vector<SymbolModel>;

template <class Coder>
std::uint8_t code_byte(Coder& coder, SymbolModel& model, std::uint8_t prediction, std::uint8_t value) {
    return static_cast<std::uint8_t>(prediction + coder.symbol(model, static_cast<std::uint8_t>(value - prediction)));
}

inline bool fits_32_bits(std::uint64_t difference) {
    const auto d = static_cast<std::int64_t>(difference);
    return d == static_cast<std::int32_t>(d);
}

/// GPS times as 64-bit integers: four interleaved sequences, each with a usual step. `layered` records code a time only
/// if it changes, hence have no symbol for "unchanged".
template <bool layered>
class Times {
  public:
    explicit Times(std::uint64_t first) { times_[0] = first; }

    template <class Coder>
    std::uint64_t code(Coder& coder, std::uint64_t value) {
        for (int switches = 0;; ++switches) {
            std::uint64_t difference = value - times_[current_];
            std::uint32_t symbol = 0;
            std::uint32_t& step = steps_[current_];
            SymbolModel& model = step == 0 ? without_step_ : with_step_;
            const std::uint32_t full = step == 0 ? full_without : full_with;
            if constexpr (Coder::encodes)
                symbol = choose(value, difference, full, switches > 0);
            symbol = coder.symbol(model, symbol);
            if (symbol > full) {
                if (switches > 0)
                    throw Error("a time switches its sequence twice");
                current_ = (current_ + symbol - full) & 3;
                continue;
            }
            if (symbol == full)
                return code_full(coder, value);
            if (!layered && symbol == (step == 0 ? 0 : full - 1))
                return times_[current_];
            const auto code_difference = [&](std::uint32_t prediction, unsigned context) {
                const std::uint32_t d =
                    difference_.code(coder, prediction, static_cast<std::uint32_t>(difference), context);
                times_[current_] += static_cast<std::uint64_t>(std::int64_t(static_cast<std::int32_t>(d)));
                return d;
            };
            if (step == 0) {
                step = code_difference(0, 0);
                seldom_[current_] = 0;
            } else if (symbol == 1) {
                code_difference(step, 1);
                seldom_[current_] = 0;
            } else if (symbol == 0) {
                count_seldom(code_difference(0, 7));
            } else if (symbol < 10) {
                code_difference(symbol * step, 2);
            } else if (symbol < most) {
                code_difference(symbol * step, 3);
            } else if (symbol == most) {
                count_seldom(code_difference(most * step, 4));
            } else if (symbol < least) {
                code_difference((most - symbol) * step, 5); // a negative factor, modulo 2^32
            } else {
                count_seldom(code_difference((most - least) * step, 6));
            }
            return times_[current_];
        }
    }

  private:
    static constexpr std::uint32_t most = 500, least = 510; ///< symbols of the factors 500 and -10
    static constexpr std::uint32_t full_without = layered ? 1 : 2, full_with = layered ? 511 : 512;

    std::uint32_t choose(std::uint64_t value, std::uint64_t difference, std::uint32_t full, bool switched) const {
        const std::uint32_t step = steps_[current_];
        if (!layered && difference == 0)
            return step == 0 ? 0 : full - 1;
        if (fits_32_bits(difference)) {
            if (step == 0)
                return layered ? 0 : 1;
            const float factor = std::round(static_cast<float>(static_cast<std::int64_t>(difference)) /
                                            static_cast<float>(static_cast<std::int32_t>(step)));
            return factor >= most ? most
                   : factor >= 0  ? static_cast<std::uint32_t>(factor)
                   : factor > -10 ? most + static_cast<std::uint32_t>(-factor)
                                  : least;
        }
        for (std::uint32_t k = 1; k < 4 && !switched; ++k)
            if (fits_32_bits(value - times_[(current_ + k) & 3]))
                return full + k;
        return full;
    }
    template <class Coder>
    std::uint64_t code_full(Coder& coder, std::uint64_t value) {
        newest_ = (newest_ + 1) & 3;
        const std::uint32_t high = difference_.code(coder, static_cast<std::uint32_t>(times_[current_] >> 32),
                                                    static_cast<std::uint32_t>(value >> 32), 8);
        const std::uint32_t low = coder.bits(32, static_cast<std::uint32_t>(value));
        current_ = newest_;
        steps_[current_] = seldom_[current_] = 0;
        return times_[current_] = std::uint64_t(high) << 32 | low;
    }
    /// A step that keeps missing gives way.
    void count_seldom(std::uint32_t difference) {
        if (++seldom_[current_] > 3) {
            steps_[current_] = difference;
            seldom_[current_] = 0;
        }
    }

    std::array<std::uint64_t, 4> times_{};
    std::array<std::uint32_t, 4> steps_{}, seldom_{};
    std::uint32_t current_ = 0, newest_ = 0;
    SymbolModel without_step_{layered ? 5U : 6U}, with_step_{layered ? 515U : 516U};
    IntegerCoder difference_{32, 9};
};

/// Red, green, blue of 16 bits: low and high bytes apart, green and blue predicted from the change of red.
class Colours {
  public:
    using Colour = std::array<std::uint16_t, 3>;

    template <class Coder>
    Colour code(Coder& coder, const Colour& last, const Colour& value) {
        std::uint32_t used = 0;
        if constexpr (Coder::encodes) {
            for (unsigned k = 0; k < 3; ++k) {
                used |= (low(last[k]) != low(value[k]) ? 1U : 0U) << (2 * k);
                used |= (high(last[k]) != high(value[k]) ? 2U : 0U) << (2 * k);
            }
            used |= value[1] != value[0] || value[2] != value[0] ? 64U : 0U;
        }
        used = coder.symbol(used_, used);
        const auto byte = [&](std::size_t model, unsigned bit, int prediction, std::uint8_t before, std::uint8_t real) {
            if ((used >> bit & 1) == 0)
                return before;
            return code_byte(coder, bytes_[model], static_cast<std::uint8_t>(std::clamp(prediction, 0, 255)), real);
        };
        const std::uint8_t red = byte(0, 0, low(last[0]), low(last[0]), low(value[0]));
        const std::uint8_t red_high = byte(1, 1, high(last[0]), high(last[0]), high(value[0]));
        const auto joined = [](int l, int h) { return static_cast<std::uint16_t>(l | h << 8); };
        if ((used & 64) == 0)
            return {joined(red, red_high), joined(red, red_high), joined(red, red_high)};
        const auto green_and_blue = [&](std::size_t model, unsigned bit, int step,
                                        std::uint8_t (*part)(std::uint16_t)) {
            const int g = part(last[1]), b = part(last[2]);
            const std::uint8_t green = byte(model, bit + 2, g + step, part(last[1]), part(value[1]));
            const std::uint8_t blue =
                byte(model + 2, bit + 4, b + (step + green - g) / 2, part(last[2]), part(value[2]));
            return std::array{green, blue};
        };
        const auto lows = green_and_blue(2, 0, red - low(last[0]), &low);
        const auto highs = green_and_blue(3, 1, red_high - high(last[0]), &high);
        return {joined(red, red_high), joined(lows[0], highs[0]), joined(lows[1], highs[1])};
    }

  private:
    static std::uint8_t low(std::uint16_t value) { return static_cast<std::uint8_t>(value); }
    static std::uint8_t high(std::uint16_t value) { return static_cast<std::uint8_t>(value >> 8); }

    SymbolModel used_{128};
    Models bytes_ = Models(6, SymbolModel(256));
};

inline Colours::Colour load_colour(const char* from) { return load<Colours::Colour>(from); }

} // namespace scanshade::laz
