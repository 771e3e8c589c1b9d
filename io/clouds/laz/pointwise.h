// Chunks of point formats 0 .. 3: all items of a record one after another in a single stream (item version 2).
#pragma once

#include "io/clouds/laz/items.h"

namespace scanshade::laz {

/// Codes the records of a chunk behind its first one.
class PointwiseChunk {
  public:
    /// `extra`: bytes behind the format's own fields.
    PointwiseChunk(bool times, bool colours, std::size_t extra, const char* first)
        : has_times_(times), has_colours_(colours), times_(times ? load<std::uint64_t>(first + 20) : 0),
          extra_at_(20U + (times ? 8 : 0) + (colours ? 6 : 0)), extra_(extra, SymbolModel(256)) {}

    template <class Coder>
    void code(Coder& coder, const char* last, Record<Coder> now) {
        code_point(coder, last, now);
        if (has_times_)
            store(now + 20, times_.code(coder, load<std::uint64_t>(now + 20)));
        const std::size_t colour_at = has_times_ ? 28 : 20;
        if (has_colours_)
            store(now + colour_at, colours_.code(coder, load_colour(last + colour_at), load_colour(now + colour_at)));
        for (std::size_t i = 0; i < extra_.size(); ++i) {
            const std::size_t at = extra_at_ + i;
            store(now + at, code_byte(coder, extra_[i], load<std::uint8_t>(last + at), load<std::uint8_t>(now + at)));
        }
    }

  private:
    static unsigned map_of(std::uint8_t flags) {
        static constexpr std::array<std::uint64_t, 8> map{0xFEDCBA98, 0xE0136AA9, 0xD1247BBA, 0xC3458CCB,
                                                          0xB6789DDC, 0xAABCDEED, 0x9ABCDEFE, 0x89ABCDEF};
        return map[flags >> 3 & 7] >> (4 * (7 - (flags & 7))) & 15;
    }

    template <class Coder>
    void code_point(Coder& coder, const char* last, Record<Coder> now) {
        const auto old = [&](std::size_t at) { return load<std::uint8_t>(last + at); };
        const auto real = [&](std::size_t at) { return load<std::uint8_t>(now + at); };
        std::uint32_t changed = 0;
        if constexpr (Coder::encodes)
            changed = (real(14) != old(14) ? 32U : 0U) |
                      (load<std::uint16_t>(now + 12) != last_intensity_[map_of(real(14))] ? 16U : 0U) |
                      (real(15) != old(15) ? 8U : 0U) | (real(16) != old(16) ? 4U : 0U) |
                      (real(17) != old(17) ? 2U : 0U) |
                      (load<std::uint16_t>(now + 18) != load<std::uint16_t>(last + 18) ? 1U : 0U);
        changed = coder.symbol(changed_, changed);
        const auto one_of = [&](Models& models, std::size_t at, std::uint32_t bit) {
            return (changed & bit) == 0 ? old(at) : static_cast<std::uint8_t>(coder.symbol(models[old(at)], real(at)));
        };
        const std::uint8_t flags = one_of(flags_, 14, 32);
        const unsigned m = map_of(flags), returns = flags >> 3 & 7, number = flags & 7;
        const unsigned level = returns > number ? returns - number : number - returns;
        if (changed & 16)
            last_intensity_[m] = static_cast<std::uint16_t>(
                intensity_.code(coder, last_intensity_[m], load<std::uint16_t>(now + 12), std::min(m, 3U)));
        store(now + 14, flags);
        store(now + 12, last_intensity_[m]);
        store(now + 15, one_of(class_, 15, 8));
        store(now + 16, (changed & 4) ? code_byte(coder, angle_[flags >> 6 & 1], old(16), real(16)) : old(16));
        store(now + 17, one_of(user_, 17, 2));
        const auto source = load<std::uint16_t>(last + 18);
        store(now + 18, (changed & 1)
                            ? static_cast<std::uint16_t>(source_.code(coder, source, load<std::uint16_t>(now + 18)))
                            : source);

        const unsigned one = returns == 1 ? 1 : 0;
        const auto code_step = [&](IntegerCoder& steps, Median& median, std::size_t at, unsigned context) {
            const auto before = load<std::uint32_t>(last + at);
            const std::uint32_t step = steps.code(coder, static_cast<std::uint32_t>(median.get()),
                                                  load<std::uint32_t>(now + at) - before, context);
            median.add(static_cast<std::int32_t>(step));
            store(now + at, before + step);
        };
        code_step(x_, x_medians_[m], 0, one);
        const unsigned x_width = x_.width();
        code_step(y_, y_medians_[m], 4, one + (x_width < 20 ? x_width & ~1U : 20));
        const unsigned width = (x_width + y_.width()) / 2;
        last_z_[level] =
            z_.code(coder, last_z_[level], load<std::uint32_t>(now + 8), one + (width < 18 ? width & ~1U : 18));
        store(now + 8, last_z_[level]);
    }

    bool has_times_, has_colours_;
    SymbolModel changed_{64};
    Models flags_ = Models(256), class_ = Models(256), user_ = Models(256), angle_ = Models(2);
    IntegerCoder intensity_{16, 4}, source_{16, 1}, x_{32, 2}, y_{32, 22}, z_{32, 20};
    std::array<Median, 16> x_medians_, y_medians_;
    std::array<std::uint16_t, 16> last_intensity_{};
    std::array<std::uint32_t, 8> last_z_{};
    Times<false> times_;
    Colours colours_;
    std::size_t extra_at_;
    Models extra_;
};

} // namespace scanshade::laz
