// A stream is a row of blocks: raw bytes ("bvx-"), LZVN ("bvxn": opcodes in whole bytes), or literals and matches as
// finite state entropy codes ("bvx2"; tANS, Duda 2013), and an end ("bvx$").
#include "io/compression/lzfse.h"

#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <fmt/format.h>
#include <vector>

namespace scanshade {

namespace {

/// Packed bytes, taken one after the other.
class Packed {
  public:
    explicit Packed(std::string_view bytes, std::size_t before = 0) : bytes_(bytes), before_(before) {}
    [[nodiscard]] std::size_t left() const { return bytes_.size() - at_; }
    [[noreturn]] void damaged(const std::string& what) const {
        throw Error(fmt::format("LZFSE data, byte {}: {}", before_ + at_, what));
    }
    std::string_view take(std::size_t count) {
        if (count > left())
            damaged(fmt::format("{} expected, {} are left", counted(count, "byte"), left()));
        at_ += count;
        return bytes_.substr(at_ - count, count);
    }
    template <class Number>
    Number number() {
        Number value{};
        std::memcpy(&value, take(sizeof value).data(), sizeof value);
        return value;
    }
    /// The next bytes as packed bytes of their own.
    Packed part(std::size_t count) {
        const std::size_t begin = before_ + at_;
        return Packed(take(count), begin);
    }

  private:
    std::string_view bytes_;
    std::size_t at_ = 0, before_;
};

/// Unpacked bytes of a block. `most` is where it ends.
class Unpacked {
  public:
    Unpacked(std::string& all, std::size_t most) : all_(all), most_(most) {}
    [[nodiscard]] std::size_t room() const { return most_ - all_.size(); }
    void literals(std::string_view bytes, const Packed& from) {
        if (bytes.size() > room())
            from.damaged("more bytes than the block says");
        all_.append(bytes);
    }
    void match(std::size_t length, std::size_t distance, const Packed& from) {
        if (length == 0)
            return;
        if (length > room())
            from.damaged("more bytes than the block says");
        if (distance == 0 || distance > all_.size())
            from.damaged(fmt::format("a match {} back, {} are there", counted(distance, "byte"), all_.size()));
        for (std::size_t i = 0; i < length; ++i) // what it copies may be its own bytes
            all_.push_back(all_[all_.size() - distance]);
    }

  private:
    std::string& all_;
    std::size_t most_;
};

// --- LZVN ---

void unpack_lzvn(Packed in, Unpacked out) {
    constexpr unsigned end = 0x06;
    std::size_t distance = 0;
    for (;;) {
        const unsigned op = in.number<std::uint8_t>(), low = op & 7;
        std::size_t literals = 0, length = 0;
        if (op == end) {
            if (out.room() > 0)
                in.damaged("the block ends early");
            return;
        }
        if (op == 0x0e || op == 0x16) // nothing
            continue;
        if (op >= 0xf0) {
            length = op == 0xf0 ? in.number<std::uint8_t>() + 16U : op & 15;
        } else if (op >= 0xe0) {
            literals = op == 0xe0 ? in.number<std::uint8_t>() + 16U : op & 15;
        } else if (op >= 0xa0 && op < 0xc0) {
            const unsigned more = in.number<std::uint16_t>();
            literals = op >> 3 & 3;
            length = (low << 2 | (more & 3)) + 3;
            distance = more >> 2;
        } else {
            const bool undefined = (op & 0xf0) == 0x70 || (op & 0xf0) == 0xd0 || (low == 6 && op < 0x40);
            if (undefined)
                in.damaged(fmt::format("opcode {:#04x}, which does not exist", op));
            literals = op >> 6;
            length = (op >> 3 & 7) + 3;
            if (low == 7)
                distance = in.number<std::uint16_t>();
            else if (low != 6)
                distance = low << 8 | in.number<std::uint8_t>();
        }
        out.literals(in.take(literals), in);
        out.match(length, distance, in);
    }
}

// --- finite state entropy ---

/// Bits, taken from the end backwards.
class BitsFromEnd {
  public:
    BitsFromEnd(std::string_view bytes, std::uint64_t unused, const Packed& from)
        : bytes_(bytes), left_(bytes.size() * 8 - unused), from_(from) {
        if (unused > bytes.size() * 8)
            from.damaged("no bits in a block that has symbols");
    }
    std::uint32_t take(unsigned count) {
        if (count > left_)
            from_.damaged("the block's bits end early");
        left_ -= count;
        std::uint64_t value = 0; // 7 bits of the first byte may be passed, and 25 are the most that are asked for
        const std::size_t first = left_ / 8;
        for (std::size_t i = 0; i < std::min<std::size_t>(5, bytes_.size() - std::min(first, bytes_.size())); ++i)
            value |= std::uint64_t(static_cast<unsigned char>(bytes_[first + i])) << (8 * i);
        return static_cast<std::uint32_t>(value >> (left_ % 8) & ((std::uint64_t(1) << count) - 1));
    }

  private:
    std::string_view bytes_;
    std::uint64_t left_;
    const Packed& from_;
};

/// What a symbol stands for: base plus as many bits more.
struct Meaning {
    std::uint32_t base = 0;
    unsigned more_bits = 0;
};

/// A table of states and the present one.
class Decoder {
  public:
    Decoder(const std::vector<std::uint32_t>& frequencies, std::size_t states, std::uint32_t state, const Packed& from)
        : state_(state) {
        std::uint64_t sum = 0;
        for (const std::uint32_t frequency : frequencies)
            sum += frequency;
        if (sum > states)
            from.damaged(fmt::format("frequencies of {} together, expected at most {}", sum, states));
        const auto log_states = static_cast<unsigned>(std::bit_width(states)) - 1;
        for (std::size_t symbol = 0; symbol < frequencies.size(); ++symbol) {
            const std::uint32_t frequency = frequencies[symbol];
            if (frequency == 0)
                continue;
            // The symbol's states, `frequency` of them, stand for intervals of two lengths that are powers of 2.
            const unsigned bits = log_states + 1 - static_cast<unsigned>(std::bit_width(frequency));
            const std::uint32_t longer = static_cast<std::uint32_t>((2 * states) >> bits) - frequency;
            for (std::uint32_t j = 0; j < frequency; ++j)
                if (j < longer)
                    states_.push_back({static_cast<std::uint16_t>(symbol), bits,
                                       ((frequency + j) << bits) - static_cast<std::uint32_t>(states)});
                else
                    states_.push_back({static_cast<std::uint16_t>(symbol), bits - 1, (j - longer) << (bits - 1)});
        }
        states_.resize(states, {invalid, 0, 0});
    }
    void set(std::uint32_t state) { state_ = state; }
    [[nodiscard]] std::uint32_t state() const { return state_; }

    std::uint32_t symbol(BitsFromEnd& bits, const Packed& from) { return symbol_of(state_, bits, from); }
    std::uint32_t symbol_of(std::uint32_t& state, BitsFromEnd& bits, const Packed& from) const {
        if (state >= states_.size() || states_[state].symbol == invalid)
            from.damaged(fmt::format("state {}, which does not exist", state));
        const State& now = states_[state];
        state = now.next + bits.take(now.bits);
        return now.symbol;
    }
    std::uint32_t value(const std::vector<Meaning>& meanings, BitsFromEnd& bits, const Packed& from) {
        const Meaning& meaning = meanings[symbol(bits, from)];
        return meaning.base + bits.take(meaning.more_bits);
    }

  private:
    static constexpr std::uint16_t invalid = 0xffff;
    struct State {
        std::uint16_t symbol = 0;
        unsigned bits = 0;
        std::uint32_t next = 0;
    };
    std::vector<State> states_;
    std::uint32_t state_;
};

/// Symbols whose numbers of more bits these are: each begins where the one before ends.
std::vector<Meaning> meanings(const std::vector<unsigned>& more_bits) {
    std::vector<Meaning> all;
    std::uint32_t base = 0;
    for (const unsigned bits : more_bits) {
        all.push_back({base, bits});
        base += 1U << bits;
    }
    return all;
}

std::vector<Meaning> short_ones_and(std::initializer_list<unsigned> more_bits) {
    std::vector<unsigned> all(16, 0);
    all.insert(all.end(), more_bits);
    return meanings(all);
}

std::vector<Meaning> distances() {
    std::vector<unsigned> more_bits;
    for (unsigned i = 0; i < 64; ++i)
        more_bits.push_back(i / 4);
    return meanings(more_bits);
}

/// Frequencies as a prefix code, from the low bits up: 00 is 0, 10 is 1, 001 and 101 are 2 and 3, xx011 are 4 to 7,
/// xxxx0111 are 8 to 23, and ten bits before 1111 are 24 and more.
std::vector<std::uint32_t> frequencies_in(Packed& header, std::size_t count) {
    std::vector<std::uint32_t> frequencies;
    std::uint64_t bits = 0;
    unsigned there = 0;
    for (std::size_t i = 0; i < count; ++i) {
        constexpr unsigned longest = 14;
        while (there < longest && header.left() > 0) {
            bits |= std::uint64_t(header.number<std::uint8_t>()) << there;
            there += 8;
        }
        unsigned length = 2;
        std::uint64_t value = bits >> 1 & 1;
        if ((bits & 1) == 0)
            ;
        else if ((bits & 2) == 0)
            length = 3, value = 2 + (bits >> 2 & 1);
        else if ((bits & 4) == 0)
            length = 5, value = 4 + (bits >> 3 & 3);
        else if ((bits & 8) == 0)
            length = 8, value = 8 + (bits >> 4 & 15);
        else
            length = 14, value = 24 + (bits >> 4 & 1023);
        if (length > there)
            header.damaged("the table of frequencies ends early");
        bits >>= length;
        there -= length;
        frequencies.push_back(static_cast<std::uint32_t>(value));
    }
    if (there >= 8 || header.left() > 0)
        header.damaged("bytes after the table of frequencies");
    return frequencies;
}

void unpack_entropy_coded(Packed& in, std::string& all, std::size_t most, std::size_t block_at) {
    const auto raw_bytes = in.number<std::uint32_t>();
    if (raw_bytes > most - all.size())
        in.damaged(fmt::format("a block of {}, expected at most {}", counted(raw_bytes, "byte"), most - all.size()));
    Unpacked out(all, all.size() + raw_bytes);
    std::array<std::uint64_t, 3> fields{};
    for (std::uint64_t& field : fields)
        field = in.number<std::uint64_t>();
    const auto bits_of = [&](std::size_t field, unsigned first, unsigned count) {
        return static_cast<std::uint32_t>(fields[field] >> first & ((std::uint64_t(1) << count) - 1));
    };
    const std::uint32_t literal_count = bits_of(0, 0, 20), literal_bytes = bits_of(0, 20, 20),
                        match_count = bits_of(0, 40, 20), match_bytes = bits_of(1, 40, 20),
                        header_bytes = bits_of(2, 0, 32);
    const std::uint32_t literal_unused = 7 - bits_of(0, 60, 3), match_unused = 7 - bits_of(1, 60, 3);
    constexpr std::uint32_t header_start = 32, most_literals = 40000, most_matches = 10000;
    if (header_bytes < header_start || literal_count > most_literals || literal_count % 4 != 0 ||
        match_count > most_matches)
        in.damaged(fmt::format("the block at byte {} has a header of {}, {} and {}", block_at,
                               counted(header_bytes, "byte"), counted(literal_count, "literal"),
                               counted(match_count, "match")));
    constexpr std::size_t lengths = 20, distance_symbols = 64, bytes = 256;
    Packed tables = in.part(header_bytes - header_start);
    const std::vector<std::uint32_t> frequencies = frequencies_in(tables, lengths + lengths + distance_symbols + bytes);
    const auto of = [&](std::size_t first, std::size_t count) {
        const auto begin = frequencies.begin() + static_cast<std::ptrdiff_t>(first);
        return std::vector<std::uint32_t>(begin, begin + static_cast<std::ptrdiff_t>(count));
    };
    Decoder of_literals(of(2 * lengths + distance_symbols, bytes), 1024, 0, in);
    Decoder of_runs(of(0, lengths), 64, bits_of(2, 32, 10), in);
    Decoder of_lengths(of(lengths, lengths), 64, bits_of(2, 42, 10), in);
    Decoder of_distances(of(2 * lengths, distance_symbols), 256, bits_of(2, 52, 10), in);

    std::string literals(literal_count, '\0');
    std::array<std::uint32_t, 4> states{};
    for (unsigned i = 0; i < states.size(); ++i)
        states[i] = bits_of(1, 10 * i, 10);
    const std::string_view literal_data = in.take(literal_bytes);
    if (literal_count > 0) {
        BitsFromEnd bits(literal_data, literal_unused, in);
        for (std::size_t i = 0; i < literals.size(); ++i)
            literals[i] = static_cast<char>(of_literals.symbol_of(states[i % 4], bits, in));
    }
    static const std::vector<Meaning> runs = short_ones_and({2, 3, 5, 8}),
                                      match_lengths = short_ones_and({3, 5, 8, 11}), far = distances();
    const std::string_view match_data = in.take(match_bytes);
    if (match_count > 0) {
        BitsFromEnd bits(match_data, match_unused, in);
        std::string_view rest = literals;
        std::size_t distance = 0;
        for (std::uint32_t i = 0; i < match_count; ++i) {
            const std::uint32_t run = of_runs.value(runs, bits, in), length = of_lengths.value(match_lengths, bits, in),
                                new_distance = of_distances.value(far, bits, in);
            if (new_distance != 0) // 0: as before
                distance = new_distance;
            if (run > rest.size())
                in.damaged(fmt::format("{} expected, {} are left", counted(run, "literal"), rest.size()));
            out.literals(rest.substr(0, run), in);
            rest.remove_prefix(run);
            out.match(length, distance, in);
        }
    }
    if (out.room() > 0)
        in.damaged(fmt::format("the block at byte {} ends {} early", block_at, counted(out.room(), "byte")));
}

} // namespace

std::string unpacked_lzfse(std::string_view packed, std::size_t most) {
    Packed in(packed);
    std::string all;
    for (;;) {
        const std::size_t block_at = packed.size() - in.left();
        const std::string_view kind = in.take(4);
        const auto size = [&] {
            const auto bytes = in.number<std::uint32_t>();
            if (bytes > most - all.size())
                in.damaged(
                    fmt::format("a block of {}, expected at most {}", counted(bytes, "byte"), most - all.size()));
            return bytes;
        };
        if (kind == "bvx$")
            break;
        if (kind == "bvx-") {
            all.append(in.take(size()));
        } else if (kind == "bvxn") {
            const std::uint32_t bytes = size(), packed_bytes = in.number<std::uint32_t>();
            unpack_lzvn(in.part(packed_bytes), {all, all.size() + bytes});
        } else if (kind == "bvx2") {
            unpack_entropy_coded(in, all, most, block_at);
        } else {
            throw Error(fmt::format("LZFSE data, byte {}: a block {}, expected bvx-, bvxn, bvx2 or bvx$", block_at,
                                    in_quotes(kind)));
        }
    }
    if (in.left() > 0)
        in.damaged(counted(in.left(), "byte") + " after the stream's end");
    return all;
}

} // namespace scanshade
