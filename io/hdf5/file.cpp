// An HDF5 file's top: superblock and root group, old (symbol table) and new (links), IV.A and III of the specification.
#include "io/hdf5/blocks.h"
#include "io/hdf5/hdf5.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <fmt/format.h>
#include <optional>

namespace scanshade {

using namespace hdf5;

namespace {

constexpr std::string_view signature = "\x89HDF\r\n\x1a\n";
constexpr std::uint64_t matlab_block = 512;
/// More names than this are no recording.
constexpr std::size_t most_names = 1 << 16;

struct Link {
    std::string name;
    std::uint64_t header = 0;
};

/// The group whose names lie in a heap and whose objects in nodes of a tree.
class SymbolTable {
  public:
    SymbolTable(const Source& source, std::uint64_t heap) : source_(source) {
        constexpr std::uint64_t heap_header = 32, most_heap_bytes = 1 << 24;
        Fields fields(source.bytes(heap, heap_header), source.at(heap) + ": a group's names");
        fields.expect("HEAP");
        fields.skip(4);
        const std::uint64_t bytes = fields.u64();
        fields.skip(8);
        const std::uint64_t address = fields.u64();
        if (bytes > most_heap_bytes)
            source.refuse(heap,
                          fmt::format("a group's names take {} bytes, expected at most {}", bytes, most_heap_bytes));
        names_ = source.bytes(address, bytes);
    }

    /// Of the node at this address and those below it.
    void read(std::uint64_t address, int level_above, std::vector<Link>& links) {
        constexpr std::uint64_t header = 24;
        Fields fields(source_.bytes(address, header), source_.at(address) + ": a group's tree");
        if (++nodes_ > most_names)
            source_.refuse(address, "a group's tree of more nodes than it can have names");
        fields.expect("TREE");
        const std::uint8_t type = fields.u8();
        const int level = fields.u8();
        if (type != 0 || level >= level_above)
            source_.refuse(address, fmt::format("a tree's node of kind {} and level {}, expected kind 0 below level {}",
                                                type, level, level_above));
        const std::uint16_t count = fields.u16();
        Fields entries(source_.bytes(address + header, count * 16U + 8), source_.at(address) + ": a group's tree");
        for (int i = 0; i < count; ++i) {
            entries.skip(8);
            const std::uint64_t child = entries.u64();
            level == 0 ? read_leaf(child, links) : read(child, level, links);
        }
    }

  private:
    void read_leaf(std::uint64_t address, std::vector<Link>& links) {
        Fields head(source_.bytes(address, 8), source_.at(address) + ": a group's node");
        head.expect("SNOD");
        head.skip(2);
        const std::uint16_t count = head.u16();
        constexpr std::uint64_t entry = 40;
        Fields entries(source_.bytes(address + 8, count * entry), source_.at(address) + ": a group's node");
        if (links.size() + count > most_names)
            source_.refuse(address, fmt::format("a group of more than {} names", most_names));
        for (int i = 0; i < count; ++i) {
            const std::uint64_t name = entries.u64(), header = entries.u64();
            entries.skip(entry - 16);
            if (name >= names_.size())
                source_.refuse(address, fmt::format("a name at {} of {} bytes of names", name, names_.size()));
            links.push_back({names_.substr(name, names_.find('\0', name) - name), header});
        }
    }

    const Source& source_;
    std::string names_;
    std::size_t nodes_ = 0;
};

/// A link that lies in the group's header; none for links to other files or by name.
std::optional<Link> link_in(const Message& message, const Source& source) {
    Fields fields(message.data, source.at(message.at) + ": a link");
    if (const std::uint8_t version = fields.u8(); version != 1)
        source.refuse(message.at, fmt::format("a link of version {}, expected 1", version));
    const std::uint8_t flags = fields.u8();
    const std::uint8_t type = (flags & 8) != 0 ? fields.u8() : std::uint8_t(0);
    fields.skip(((flags & 4) != 0 ? 8 : 0) + ((flags & 0x10) != 0 ? 1 : 0));
    const std::uint64_t length = fields.number(std::size_t(1) << (flags & 3));
    const std::string name(fields.take(length));
    if (type != 0)
        return std::nullopt;
    return Link{name, fields.u64()};
}

std::vector<Link> links_of(const Source& source, std::uint64_t group) {
    std::vector<Link> links;
    for (const Message& message : messages_of(source, group)) {
        if (message.type == MessageType::symbol_table) {
            Fields fields(message.data, source.at(message.at) + ": a group");
            const std::uint64_t tree = fields.u64();
            constexpr int above_all = 256;
            SymbolTable(source, fields.u64()).read(tree, above_all, links);
        } else if (message.type == MessageType::link) {
            if (auto link = link_in(message, source); link && links.size() < most_names)
                links.push_back(*std::move(link));
        } else if (message.type == MessageType::link_info) {
            Fields fields(message.data, source.at(message.at) + ": a group");
            fields.skip(1);
            const std::uint8_t flags = fields.u8();
            fields.skip((flags & 1) != 0 ? 8 : 0);
            if (fields.u64() != nowhere)
                source.refuse(message.at, "a group whose links lie in a heap (of many names, libver='latest')");
        }
    }
    return links;
}

/// Where the signature may be: at the start, or after a block of the user's.
std::uint64_t signature_at(const FileBytes& file) {
    for (std::uint64_t at = 0; at + signature.size() <= file.size(); at = at == 0 ? matlab_block : at * 2)
        if (file.bytes(at, signature.size()) == signature)
            return at;
    throw Error(file.path().string() + ": not an HDF5 file: its signature is missing");
}

} // namespace

bool is_hdf5(std::string_view start) {
    return start.starts_with(signature) ||
           (start.size() > matlab_block && start.substr(matlab_block).starts_with(signature));
}

Hdf5File::Hdf5File(const std::filesystem::path& path) : file_(std::make_shared<FileBytes>(path)) {
    const std::uint64_t at = signature_at(*file_);
    constexpr std::uint64_t longest = 104; // of versions 0 to 3
    const Source absolute{*file_, 0};
    Fields fields(file_->bytes(at, std::min(longest, file_->size() - at)), absolute.at(at) + ": the superblock");
    fields.skip(signature.size());
    const std::uint8_t version = fields.u8();
    if (version > 3)
        absolute.refuse(at, fmt::format("a superblock of version {}, expected 0 to 3", version));
    if (version < 2)
        fields.skip(4);
    const std::uint8_t offset_bytes = fields.u8(), length_bytes = fields.u8();
    if (offset_bytes != 8 || length_bytes != 8)
        absolute.refuse(at,
                        fmt::format("addresses of {} and lengths of {} bytes, expected 8", offset_bytes, length_bytes));
    fields.skip(version == 0 ? 9 : version == 1 ? 13 : 1);
    base_ = fields.u64();
    fields.skip(version < 2 ? 24 + 8 : 16); // others' addresses; of the root's entry, its name
    const std::uint64_t root = fields.u64();
    for (Link& link : links_of({*file_, base_}, root)) {
        names_.push_back(std::move(link.name));
        headers_.push_back(link.header);
    }
}

bool Hdf5File::has(const std::string& name) const { return std::ranges::find(names_, name) != names_.end(); }

} // namespace scanshade
