// Streams by ISA-L.
//
// Its levels 1 and 2 are not deterministic: the third byte's slot in their table depends on the address of the stream,
// because ISA-L 2.30's assembly hashes a register that is not set yet. Sometimes the same bytes were therefore packed
// into other ones. Levels 0 and 3 give the same bytes wherever memory lies and whatever it held before.
#include "io/compression/deflate.h"

#include <array>
#include <fmt/format.h>
#include <isa-l/igzip_lib.h>
#include <stdexcept>

namespace scanshade {

namespace {

std::uint8_t* for_reading(std::string_view bytes) { // ISA-L's pointers to input are not const
    return reinterpret_cast<std::uint8_t*>(const_cast<char*>(bytes.data()));
}

/// Level 0, with codes of its own: those of its fixed table make maps a third larger.
struct SampledCodes {
    isal_huff_histogram histogram = {};
    isal_hufftables codes = {};
};

} // namespace

struct Packer::State {
    std::unique_ptr<SampledCodes> sampled;
    std::unique_ptr<std::uint8_t[]> scratch; ///< of level 3
    isal_zstream stream = {};
    bool begun = false;

    void begin() {
        begun = true;
        if (sampled) {
            isal_create_hufftables(&sampled->codes, &sampled->histogram); // every byte, length and distance gets a code
            isal_deflate_set_hufftables(&stream, &sampled->codes, IGZIP_HUFFTABLE_CUSTOM);
            return;
        }
        scratch = std::make_unique_for_overwrite<std::uint8_t[]>(ISAL_DEF_LVL3_DEFAULT);
        stream.level = 3;
        stream.level_buf = scratch.get();
        stream.level_buf_size = ISAL_DEF_LVL3_DEFAULT;
    }
};

Packer::Packer(Deflate form) : state_(std::make_unique<State>()) {
    isal_deflate_init(&state_->stream);
    state_->stream.gzip_flag = form == Deflate::gzip ? IGZIP_GZIP : IGZIP_ZLIB;
}

Packer::~Packer() = default;

void Packer::sample(std::string_view bytes) {
    if (!state_->sampled)
        state_->sampled = std::make_unique<SampledCodes>();
    isal_update_histogram(for_reading(bytes), static_cast<int>(bytes.size()), &state_->sampled->histogram);
}

void Packer::append(std::string_view bytes, bool last, std::string& packed) {
    if (!state_->begun)
        state_->begin();
    isal_zstream& stream = state_->stream;
    stream.next_in = for_reading(bytes);
    stream.avail_in = static_cast<std::uint32_t>(bytes.size());
    stream.end_of_stream = last ? 1 : 0;
    std::array<std::uint8_t, 1 << 15> piece;
    do {
        stream.next_out = piece.data();
        stream.avail_out = piece.size();
        if (const int code = isal_deflate(&stream); code != COMP_OK)
            throw std::runtime_error(fmt::format("bytes could not be packed: ISA-L's code {}", code));
        packed.append(reinterpret_cast<const char*>(piece.data()), piece.size() - stream.avail_out);
    } while (stream.avail_out == 0);
    if (last && stream.internal_state.state != ZSTATE_END)
        throw std::runtime_error("bytes could not be packed: ISA-L did not end its stream");
}

std::string deflated(std::string_view bytes, Deflate form) {
    constexpr std::size_t at_once = 1 << 30; // ISA-L counts with 32 bits
    std::string packed;
    Packer packer(form);
    for (; bytes.size() > at_once; bytes.remove_prefix(at_once))
        packer.append(bytes.substr(0, at_once), false, packed);
    packer.append(bytes, true, packed);
    return packed;
}

} // namespace scanshade
