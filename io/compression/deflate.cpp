// zlib streams by ISA-L.
#include "io/compression/deflate.h"

#include <fmt/format.h>
#include <isa-l/igzip_lib.h>
#include <stdexcept>

namespace scanshade {

/// Level 3. Level 0 has only fixed codes and makes maps larger. Levels 1 and 2 are not deterministic: the third byte's
/// slot in their table depends on the address of `stream`, because ISA-L 2.30's assembly hashes a register that is not
/// set yet. Sometimes the same pixels were therefore packed into other bytes.
/// Level 3 gives the same bytes whatever the scratch held before (9,000 streams tried).
struct Packer::State {
    std::unique_ptr<std::uint8_t[]> scratch = std::make_unique_for_overwrite<std::uint8_t[]>(ISAL_DEF_LVL3_DEFAULT);
    isal_zstream stream = {};
};

Packer::Packer() : state_(std::make_unique<State>()) {
    isal_deflate_init(&state_->stream);
    state_->stream.level = 3;
    state_->stream.level_buf = state_->scratch.get();
    state_->stream.level_buf_size = ISAL_DEF_LVL3_DEFAULT;
    state_->stream.gzip_flag = IGZIP_ZLIB;
}

Packer::~Packer() = default;

void Packer::append(std::string_view bytes, bool last, std::string& packed) {
    isal_zstream& stream = state_->stream;
    stream.next_in = reinterpret_cast<std::uint8_t*>(const_cast<char*>(bytes.data())); // only read
    stream.avail_in = static_cast<std::uint32_t>(bytes.size());
    stream.end_of_stream = last ? 1 : 0;
    const std::size_t piece_bytes = bytes.size() + bytes.size() / 8 + 1024; // incompressible data are stored
    const std::unique_ptr<std::uint8_t[]> piece(new std::uint8_t[piece_bytes]);
    do {
        stream.next_out = piece.get();
        stream.avail_out = static_cast<std::uint32_t>(piece_bytes);
        if (const int code = isal_deflate(&stream); code != COMP_OK)
            throw std::runtime_error(fmt::format("bytes could not be packed: ISA-L's code {}", code));
        packed.append(reinterpret_cast<const char*>(piece.get()), piece_bytes - stream.avail_out);
    } while (stream.avail_out == 0);
    if (last && stream.internal_state.state != ZSTATE_END)
        throw std::runtime_error("bytes could not be packed: ISA-L did not end its stream");
}

std::string deflated(std::string_view bytes) {
    std::string packed;
    Packer().append(bytes, true, packed);
    return packed;
}

} // namespace scanshade
