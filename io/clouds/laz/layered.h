// Chunks of point formats 6 .. 8: every group of fields in a stream ("layer") of its own, with a state for each of four
// scanner channels (item versions 3 and 4).
#pragma once

#include "io/clouds/laz/items.h"

#include <optional>

namespace scanshade::laz {

/// What tells a format's layers.
struct LayerSet {
    bool colours = false, infrared = false;
    std::size_t extra = 0; ///< bytes behind the format's own fields
    int colour_version = 3, extra_version = 3;

    [[nodiscard]] std::size_t layers() const { return 9U + (colours ? 1 : 0) + (infrared ? 1 : 0) + extra; }
};

/// One layer: its coder, if it is there, and whether it says more than "as before".
template <class Coder>
struct Layer {
    std::optional<Coder> coder;
    bool needed = false;
};

/// The channel whose models a side item uses, and the one whose last value it predicts from. Version 3 forgets the
/// channel of records that keep it, and predicts from the old one in the record that switches back; files have this.
class SideChannels {
  public:
    SideChannels(int version, unsigned first) : version_(version), current_(first) { known_[first] = true; }

    struct Choice {
        unsigned channel = 0, source = 0;
        std::optional<unsigned> created_from;
    };
    Choice next(unsigned channel_of_record, bool switched) {
        Choice choice;
        choice.channel = version_ == 3 && !switched ? 0 : channel_of_record;
        choice.source = current_;
        if (choice.channel == current_)
            return choice;
        if (!known_[choice.channel]) {
            known_[choice.channel] = true;
            choice.created_from = current_;
            choice.source = choice.channel;
        } else if (version_ != 3) {
            choice.source = choice.channel;
        }
        current_ = choice.channel;
        return choice;
    }

  private:
    int version_;
    unsigned current_;
    std::array<bool, 4> known_{};
};

/// Codes the records of a chunk behind its first one.
template <class Coder>
class LayeredChunk {
  public:
    enum Name { xy, z, classes, flags, intensity, angle, user, source, time, side };

    /// `layers` in the order of the file; those without a coder keep their fields as they were.
    LayeredChunk(const LayerSet& set, std::vector<Layer<Coder>>& layers, const char* first)
        : set_(set), layers_(layers), current_(load<std::uint8_t>(first + 15) >> 4 & 3),
          colour_channels_(set.colour_version, current_), extra_channels_(set.extra_version, current_),
          extra_at_(30U + (set.colours ? 6 : 0) + (set.infrared ? 2 : 0)) {
        channels_[current_].emplace(Point(first));
        for (unsigned k = 0; k < 4; ++k)
            extra_[k].models.assign(set.extra, SymbolModel(256));
        if (set.colours)
            colours_[current_].last = load_colour(first + 30);
        if (set.infrared)
            colours_[current_].infrared = load<std::uint16_t>(first + 36);
        extra_[current_].last.assign(first + extra_at_, set.extra);
    }

    void code(Record<Coder> now) {
        const bool switched = code_point(now);
        if (set_.colours)
            code_colours(now + 30, colour_channels_.next(current_, switched));
        if (set_.extra > 0)
            code_extra(now + extra_at_, extra_channels_.next(current_, switched));
    }

  private:
    /// POINT14, unpacked.
    struct Point {
        std::uint32_t x, y, z;
        std::uint16_t intensity, source, angle;
        std::uint8_t number, returns, flags, channel, classification, user;
        std::uint64_t time;

        explicit Point(const char* from)
            : x(load<std::uint32_t>(from)), y(load<std::uint32_t>(from + 4)), z(load<std::uint32_t>(from + 8)),
              intensity(load<std::uint16_t>(from + 12)), source(load<std::uint16_t>(from + 20)),
              angle(load<std::uint16_t>(from + 18)), classification(load<std::uint8_t>(from + 16)),
              user(load<std::uint8_t>(from + 17)), time(load<std::uint64_t>(from + 22)) {
            const auto numbers = load<std::uint8_t>(from + 14), bits = load<std::uint8_t>(from + 15);
            number = numbers & 15;
            returns = numbers >> 4;
            flags = static_cast<std::uint8_t>((bits & 15) | (bits >> 2 & 0x30)); // scan direction and edge at bits 4, 5
            channel = bits >> 4 & 3;
        }
        void write(char* to) const {
            store(to, x), store(to + 4, y), store(to + 8, z), store(to + 12, intensity);
            store(to + 14, static_cast<std::uint8_t>(number | returns << 4));
            store(to + 15, static_cast<std::uint8_t>((flags & 15) | channel << 4 | (flags & 0x30) << 2));
            store(to + 16, classification), store(to + 17, user), store(to + 18, angle), store(to + 20, source);
            store(to + 22, time);
        }
        void write(const char*) const {}
    };

    struct Channel {
        explicit Channel(const Point& from) : last(from), times(from.time) {
            last_z.fill(from.z);
            last_intensity.fill(from.intensity);
        }
        Point last;
        bool time_changed = false;
        std::array<Median, 12> x_medians, y_medians;
        std::array<std::uint32_t, 8> last_z{};
        std::array<std::uint16_t, 8> last_intensity{};
        Models changed = Models(8, SymbolModel(128)), returns = Models(16, SymbolModel(16)),
               number = Models(16, SymbolModel(16)), classes = Models(64), flags = Models(64, SymbolModel(64)),
               user = Models(64);
        SymbolModel switches{3}, number_at_same_time{13};
        IntegerCoder x{32, 2}, y{32, 22}, z{32, 20}, intensity{16, 4}, angle{16, 2}, source{16, 1};
        Times<true> times;
    };

    /// The value of a layer: coded, or as before if the layer is absent.
    template <class Number, class Action>
    Number layer(std::size_t index, Number before, Action&& coded) {
        Layer<Coder>& layer = layers_[index];
        if (!layer.coder)
            return before;
        const Number value = static_cast<Number>(coded(*layer.coder));
        layer.needed |= value != before;
        return value;
    }

    /// What differs from the last point of the same channel: two bits for the number of the return, then one each for
    /// returns, angle, time, source and channel.
    std::uint32_t changes_of(const Point& real) const {
        const Point& last = channels_[channels_[real.channel] ? real.channel : current_]->last;
        const unsigned step = (real.number - last.number) & 15;
        return (step == 0    ? 0U
                : step == 1  ? 1U
                : step == 15 ? 2U
                             : 3U) |
               (real.returns != last.returns ? 4U : 0U) | (real.angle != last.angle ? 8U : 0U) |
               (real.time != last.time ? 16U : 0U) | (real.source != last.source ? 32U : 0U) |
               (real.channel != current_ ? 64U : 0U);
    }

    bool code_point(Record<Coder> now) {
        const Point real = Coder::encodes ? Point(now) : channels_[current_]->last;
        Coder& first_layer = *layers_[xy].coder;
        Channel& before = *channels_[current_];
        const unsigned e = (before.last.number == 1 ? 1U : 0U) + (before.last.number >= before.last.returns ? 2U : 0U) +
                           (before.time_changed ? 4U : 0U);
        const std::uint32_t c = first_layer.symbol(before.changed[e], Coder::encodes ? changes_of(real) : 0);
        if (c & 64) {
            const unsigned to =
                (current_ + 1 + first_layer.symbol(before.switches, (real.channel - current_ - 1U) & 3)) & 3;
            if (!channels_[to])
                channels_[to].emplace(before.last);
            current_ = to;
        }
        Channel& state = *channels_[current_];
        Point& point = state.last;
        point.channel = static_cast<std::uint8_t>(current_);
        const bool tc = c & 16;
        const unsigned n0 = point.returns, r0 = point.number;
        const unsigned n = (c & 4) ? first_layer.symbol(state.returns[n0], real.returns) : n0;
        unsigned r = r0;
        if ((c & 3) == 1)
            r = r0 + 1;
        else if ((c & 3) == 2)
            r = r0 + 15;
        else if ((c & 3) == 3)
            r = tc ? first_layer.symbol(state.number[r0], real.number)
                   : r0 + 2 + first_layer.symbol(state.number_at_same_time, (real.number - r0 - 2U) & 15);
        r &= 15;
        point.returns = static_cast<std::uint8_t>(n);
        point.number = static_cast<std::uint8_t>(r);

        const unsigned m = 2 * map_of(n, r) + (tc ? 1 : 0), level = std::min(7U, n > r ? n - r : r - n);
        const unsigned one = n == 1 ? 1 : 0, kind = (r == 1 ? 2U : 0U) + (r >= n ? 1U : 0U);
        const auto code_step = [&](IntegerCoder& steps, Median& median, std::uint32_t& at, std::uint32_t to,
                                   unsigned context) {
            const std::uint32_t step =
                steps.code(first_layer, static_cast<std::uint32_t>(median.get()), to - at, context);
            median.add(static_cast<std::int32_t>(step));
            at += step;
        };
        code_step(state.x, state.x_medians[m], point.x, real.x, one);
        const unsigned x_width = state.x.width();
        code_step(state.y, state.y_medians[m], point.y, real.y, one + (x_width < 20 ? x_width & ~1U : 20));
        const unsigned width = (x_width + state.y.width()) / 2;

        point.z = layer(z, point.z, [&](Coder& coder) {
            return state.last_z[level] =
                       state.z.code(coder, state.last_z[level], real.z, one + (width < 18 ? width & ~1U : 18));
        });
        point.classification = layer(classes, point.classification, [&](Coder& coder) {
            return coder.symbol(state.classes[2 * (point.classification & 31U) + (kind == 3 ? 1 : 0)],
                                real.classification);
        });
        point.flags =
            layer(flags, point.flags, [&](Coder& coder) { return coder.symbol(state.flags[point.flags], real.flags); });
        point.intensity = layer(intensity, point.intensity, [&](Coder& coder) {
            std::uint16_t& last = state.last_intensity[2 * kind + (tc ? 1 : 0)];
            return last = static_cast<std::uint16_t>(state.intensity.code(coder, last, real.intensity, kind));
        });
        if (c & 8)
            point.angle = layer(angle, point.angle, [&](Coder& coder) {
                return state.angle.code(coder, point.angle, real.angle, tc ? 1 : 0);
            });
        point.user =
            layer(user, point.user, [&](Coder& coder) { return coder.symbol(state.user[point.user / 4], real.user); });
        if (c & 32)
            point.source = layer(source, point.source,
                                 [&](Coder& coder) { return state.source.code(coder, point.source, real.source); });
        if (tc)
            point.time = layer(time, point.time, [&](Coder& coder) { return state.times.code(coder, real.time); });
        state.time_changed = tc;
        point.write(now);
        return c & 64;
    }

    void code_colours(Record<Coder> now, const SideChannels::Choice& choice) {
        ColourChannel& models = colours_[choice.channel];
        if (choice.created_from) {
            models.last = colours_[*choice.created_from].last;
            models.infrared = colours_[*choice.created_from].infrared;
        }
        ColourChannel& from = colours_[choice.source];
        const Colours::Colour old = from.last;
        from.last = layer(side, old, [&](Coder& coder) { return models.colours.code(coder, old, load_colour(now)); });
        store(now, from.last);
        if (!set_.infrared)
            return;
        from.infrared = layer(side + 1, from.infrared, [&](Coder& coder) {
            const auto real = load<std::uint16_t>(now + 6);
            const std::uint16_t differs = real ^ from.infrared;
            const std::uint32_t used =
                coder.symbol(models.infrared_used, (differs & 0xff ? 1U : 0U) | (differs >> 8 ? 2U : 0U));
            std::array<std::uint8_t, 2> bytes{};
            for (std::size_t k = 0; k < 2; ++k) {
                const auto before = static_cast<std::uint8_t>(from.infrared >> (8 * k));
                bytes[k] = (used >> k & 1) == 0 ? before
                                                : code_byte(coder, models.infrared_bytes[k], before,
                                                            static_cast<std::uint8_t>(real >> (8 * k)));
            }
            return bytes[0] | bytes[1] << 8;
        });
        store(now + 6, from.infrared);
    }

    void code_extra(Record<Coder> now, const SideChannels::Choice& choice) {
        ExtraChannel& models = extra_[choice.channel];
        if (choice.created_from)
            models.last = extra_[*choice.created_from].last;
        std::string& last = extra_[choice.source].last;
        const std::size_t first = side + (set_.colours ? 1 : 0) + (set_.infrared ? 1 : 0);
        for (std::size_t i = 0; i < set_.extra; ++i) {
            last[i] = layer(first + i, last[i], [&](Coder& coder) {
                return code_byte(coder, models.models[i], static_cast<std::uint8_t>(last[i]),
                                 load<std::uint8_t>(now + i));
            });
            store(now + i, last[i]);
        }
    }

    static unsigned map_of(unsigned returns, unsigned number) {
        static constexpr std::array<std::uint64_t, 16> map{
            0x0123453445555555, 0x1013333333333333, 0x2124444444433333, 0x3345444444444444,
            0x4344544444444444, 0x5344454444444444, 0x3344445444444444, 0x4344444544444444,
            0x4344444454444444, 0x5344444445444444, 0x5344444444544444, 0x5334444444455444,
            0x5334444444455544, 0x5334444444445554, 0x5334444444444555, 0x5334444444444455};
        return map[returns] >> (4 * (15 - number)) & 15;
    }

    struct ColourChannel {
        Colours::Colour last{};
        std::uint16_t infrared = 0;
        Colours colours;
        SymbolModel infrared_used{4};
        Models infrared_bytes = Models(2);
    };
    struct ExtraChannel {
        std::string last;
        Models models;
    };

    LayerSet set_;
    std::vector<Layer<Coder>>& layers_;
    unsigned current_;
    std::array<std::optional<Channel>, 4> channels_;
    SideChannels colour_channels_, extra_channels_;
    std::array<ColourChannel, 4> colours_;
    std::array<ExtraChannel, 4> extra_;
    std::size_t extra_at_;
};

} // namespace scanshade::laz
