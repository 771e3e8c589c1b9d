#include "io/hdf5/blocks.h"

#include "io/text.h"
#include "projection/base/error.h"

#include <deque>
#include <fmt/format.h>

namespace scanshade::hdf5 {

std::string Source::bytes(std::uint64_t address, std::uint64_t count) const {
    const std::uint64_t end = file.size() - std::min(base, file.size());
    if (address > end || count > end - address)
        refuse(address, fmt::format("{} expected, the file ends at byte {}", counted(count, "byte"), file.size()));
    return file.bytes(base + address, count);
}

std::string Source::at(std::uint64_t address) const {
    return address == nowhere ? file.path().string() + ": an address that is not defined"
                              : fmt::format("{}: byte {}", file.path().string(), base + address);
}

void Source::refuse(std::uint64_t address, const std::string& why) const {
    throw Error(fmt::format("{}: {}", at(address), why));
}

std::uint64_t Fields::number(std::size_t bytes) {
    std::uint64_t value = 0;
    const std::string_view taken = take(bytes);
    for (std::size_t i = bytes; i-- > 0;)
        value = value << 8 | static_cast<unsigned char>(taken[i]);
    return value;
}

std::string_view Fields::take(std::uint64_t count) {
    if (count > left())
        throw Error(fmt::format("{}: ends {} early", where_, counted(count - left(), "byte")));
    const std::string_view taken = std::string_view(bytes_).substr(at_, count);
    at_ += count;
    return taken;
}

void Fields::expect(std::string_view signature) {
    if (const std::string_view found = take(signature.size()); found != signature)
        throw Error(fmt::format("{}: {} expected, found {}", where_, signature, in_quotes(found)));
}

namespace {

struct Block {
    std::uint64_t address = 0, bytes = 0;
};

/// More is no description of numbers.
constexpr std::uint64_t most_header_bytes = 1 << 24;
constexpr std::size_t most_messages = 1 << 16;

/// The two versions of headers: what precedes the messages, and each of them.
struct HeaderForm {
    bool second = false, ordered = false;
    std::size_t most = most_messages; ///< messages

    [[nodiscard]] std::size_t prefix() const { return second ? (ordered ? 6 : 4) : 8; }
};

void read_block(const Source& source, const Block& block, const HeaderForm& form, std::deque<Block>& blocks,
                std::vector<Message>& messages) {
    Fields fields(source.bytes(block.address, block.bytes), source.at(block.address) + ": an object's header");
    while (fields.left() >= form.prefix() && messages.size() < form.most) {
        Message message;
        message.at = block.address + block.bytes - fields.left();
        message.type = static_cast<MessageType>(form.second ? fields.u8() : fields.u16());
        const std::uint16_t bytes = fields.u16();
        message.shared = (fields.u8() & 2) != 0;
        fields.skip(form.prefix() - (form.second ? 4 : 5));
        message.data = fields.take(bytes);
        if (message.type == MessageType::continuation) {
            Fields place(message.data, source.at(message.at) + ": a continuation");
            const std::uint64_t address = place.u64();
            blocks.push_back({address, place.u64()});
        }
        messages.push_back(std::move(message));
    }
}

} // namespace

std::vector<Message> messages_of(const Source& source, std::uint64_t address) {
    constexpr std::uint64_t longest_start = 64;
    const std::uint64_t rest = source.file.size() - std::min(source.file.size(), source.base);
    if (address >= rest)
        source.refuse(address,
                      fmt::format("an object's header expected, the file ends at byte {}", source.file.size()));
    Fields start(source.bytes(address, std::min(longest_start, rest - address)),
                 source.at(address) + ": an object's header");
    const std::size_t all = start.left();
    HeaderForm form;
    std::deque<Block> blocks;
    const std::uint8_t first = start.u8();
    if (first == 1) {
        start.skip(1);
        form.most = start.u16();
        start.skip(4);
        const std::uint32_t bytes = start.u32();
        blocks.push_back({address + 16, bytes});
    } else if (first == 'O') {
        start.expect("HDR");
        if (const std::uint8_t version = start.u8(); version != 2)
            source.refuse(address, fmt::format("an object's header of version {}, expected 1 or 2", version));
        form.second = true;
        const std::uint8_t flags = start.u8();
        form.ordered = (flags & 4) != 0;
        start.skip(((flags & 0x20) != 0 ? 16 : 0) + ((flags & 0x10) != 0 ? 4 : 0));
        const std::uint64_t bytes = start.number(std::size_t(1) << (flags & 3));
        blocks.push_back({address + (all - start.left()), bytes});
    } else {
        source.refuse(address, fmt::format("an object's header of version {}, expected 1 or 2", first));
    }
    std::vector<Message> messages;
    std::uint64_t total = 0;
    for (bool continued = false; !blocks.empty(); blocks.pop_front(), continued = true) {
        Block block = blocks.front();
        if (block.bytes > most_header_bytes - total)
            source.refuse(block.address, fmt::format("an object's header of more than {} bytes", most_header_bytes));
        total += block.bytes + form.prefix(); // so that empty blocks come to an end, too
        if (continued && form.second) {       // between a signature and a checksum
            if (source.bytes(block.address, 4) != "OCHK" || block.bytes < 8)
                source.refuse(block.address, "no continuation of an object's header");
            block = {block.address + 4, block.bytes - 8};
        }
        read_block(source, block, form, blocks, messages);
        if (messages.size() >= form.most)
            break;
    }
    return messages;
}

} // namespace scanshade::hdf5
