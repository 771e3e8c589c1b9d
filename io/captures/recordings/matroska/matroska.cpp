#include "io/captures/recordings/matroska/matroska.h"

#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <fmt/format.h>
#include <limits>
#include <optional>
#include <span>
#include <unordered_set>

namespace scanshade::matroska {
namespace {

using Id = std::uint32_t; // with its marker bit, as the tables of the RFCs write it

namespace id {
constexpr Id ebml = 0x1A45DFA3, read_version = 0x42F7, longest_id = 0x42F2, longest_size = 0x42F3, doc_type = 0x4282,
             doc_read_version = 0x4285, crc = 0xBF, padding = 0xEC;
constexpr Id segment = 0x18538067, seek_head = 0x114D9B74, info = 0x1549A966, tracks = 0x1654AE6B, cues = 0x1C53BB6B,
             chapters = 0x1043A770, attachments = 0x1941A469, tags = 0x1254C367, cluster = 0x1F43B675;
constexpr Id timestamp_scale = 0x2AD7B1;
constexpr Id track_entry = 0xAE, track_number = 0xD7, track_uid = 0x73C5, track_type = 0x83, track_name = 0x536E,
             codec_id = 0x86, codec_private = 0x63A2, default_duration = 0x23E383, encodings = 0x6D80, video = 0xE0,
             pixel_width = 0xB0, pixel_height = 0xBA;
constexpr Id tag = 0x7373, targets = 0x63C0, target_track = 0x63C5, target_attachment = 0x63C6, simple_tag = 0x67C8,
             tag_name = 0x45A3, tag_string = 0x4487;
constexpr Id attached_file = 0x61A7, file_name = 0x466E, file_uid = 0x46AE, file_data = 0x465C;
constexpr Id cluster_time = 0xE7, simple_block = 0xA3, block_group = 0xA0, block = 0xA1, previous_size = 0xAB,
             position = 0xA7, silent_tracks = 0x5854, encrypted_block = 0xAF;
} // namespace id

constexpr std::array top_level = {id::seek_head,   id::info, id::tracks, id::cues,    id::chapters,
                                  id::attachments, id::tags, id::crc,    id::padding, id::cluster};
constexpr std::array in_cluster = {id::cluster_time,    id::simple_block, id::block_group,
                                   id::previous_size,   id::position,     id::silent_tracks,
                                   id::encrypted_block, id::crc,          id::padding};
/// Those worth looking for after damage.
constexpr std::array recovered = {id::cluster, id::tracks, id::tags, id::attachments};

constexpr std::array described = {id::info, id::tracks, id::tags, id::attachments};

template <std::size_t count>
bool one_of(const std::array<Id, count>& all, Id element) {
    return std::ranges::find(all, element) != all.end();
}

constexpr std::uint64_t unknown = std::numeric_limits<std::uint64_t>::max();
constexpr std::size_t most_elements = 1 << 22, most_descriptions = 1 << 12, longest_text = 1 << 16;
/// An ID of at most 4 bytes, a size of at most 8.
constexpr std::uint64_t longest_head = 12;

struct Element {
    Id name = 0;
    std::uint64_t at = 0, content = 0, end = 0; ///< bytes of the file; `end` is `unknown` where only what follows tells
};

/// A number whose first byte tells its length by its leading zeros. Nothing where it is longer than the bytes, or than
/// `longest`.
struct Number {
    std::uint64_t value = 0; ///< with the marker bit
    std::size_t length = 0;

    [[nodiscard]] std::uint64_t data() const { return value & ((std::uint64_t{1} << (7 * length)) - 1); }
    [[nodiscard]] bool all_ones() const { return data() == (std::uint64_t{1} << (7 * length)) - 1; }
};
std::optional<Number> number_in(std::string_view bytes, std::size_t longest) {
    if (bytes.empty() || bytes[0] == 0)
        return std::nullopt;
    Number number;
    const auto first = static_cast<unsigned char>(bytes[0]);
    while ((first << number.length & 0x80) == 0)
        ++number.length;
    ++number.length;
    if (number.length > longest || number.length > bytes.size())
        return std::nullopt;
    for (const char byte : bytes.substr(0, number.length))
        number.value = number.value << 8 | static_cast<unsigned char>(byte);
    return number;
}

/// An element is not as it should be: what is around it may be sound.
class Damage : public Error {
  public:
    using Error::Error;
};

class Reader {
  public:
    Reader(const FileBytes& file, Contents& contents) : file_(file), contents_(contents) {}

    void read() {
        const Element head = whole_element(0, file_.size(), "the start of an EBML file");
        if (head.name != id::ebml)
            fail(0, "no EBML, which a Matroska file starts with");
        check_kind(head);
        const Element segment = segment_after(head.end);
        const bool cut = segment.end != unknown && segment.end > file_.size();
        const std::uint64_t end = std::min(segment.end, file_.size());
        if (cut) {
            warn(fmt::format("the file ends at byte {} of {}; what was whole before is used", file_.size(),
                             segment.end));
            told_end_ = true;
        }
        read_segment(segment.content, end);
        if (end < file_.size())
            warn(fmt::format("{} after the end of the recording are not read", counted(file_.size() - end, "byte")));
        settle();
    }

  private:
    [[noreturn]] void fail(std::uint64_t at, const std::string& what) const { throw Damage(place(at) + what); }
    [[nodiscard]] std::string place(std::uint64_t at) const {
        return fmt::format("{} byte {}: ", file_.path().string(), at);
    }
    void warn(const std::string& what) {
        contents_.warnings.push_back(fmt::format("{}: {}.", file_.path().string(), what));
    }

    // ------------------------------------------------------------------------------------------------ elements

    /// The element's head, if there is one with a possible length; its content may end beyond `end`.
    [[nodiscard]] std::optional<Element> element_at(std::uint64_t at, std::uint64_t end) const {
        if (at >= end)
            return std::nullopt;
        const std::string bytes = file_.bytes(at, std::min(longest_head, end - at));
        const auto name = number_in(bytes, 4);
        if (!name)
            return std::nullopt;
        const auto size = number_in(std::string_view(bytes).substr(name->length), 8);
        if (!size)
            return std::nullopt;
        Element element{static_cast<Id>(name->value), at, at + name->length + size->length, unknown};
        if (!size->all_ones()) { // sizes are below 2^56, and files below 2^63
            element.end = element.content + size->data();
        }
        return element;
    }

    /// An element that must be there as a whole.
    [[nodiscard]] Element whole_element(std::uint64_t at, std::uint64_t end, const char* what) const {
        const auto element = element_at(at, end);
        if (!element || element->end == unknown || element->end > end)
            fail(at, fmt::format("no whole element, expected {}", what));
        return *element;
    }

    /// Visits the children of an element of known size. False where something in it is no element, or ends outside.
    template <class Visit>
    bool each_child(const Element& parent, const Visit& visit) {
        for (std::uint64_t at = parent.content; at < parent.end;) {
            const auto child = element_at(at, parent.end);
            if (!child || child->end == unknown || child->end > parent.end)
                return false;
            count(*child);
            visit(*child);
            at = child->end;
        }
        return true;
    }

    /// Bounds the memory and time that a file can ask for.
    void count(const Element& element) {
        if (++elements_ > 4 * most_elements)
            throw Error(place(element.at) +
                        fmt::format("more than {} elements, expected those of a recording", 4 * most_elements));
    }
    template <class Things>
    void check_room_in(const Things& things, std::size_t most, const Element& element, const char* noun) const {
        if (things.size() >= most)
            throw Error(place(element.at) + fmt::format("more than {} {}, expected those of a recording", most, noun));
    }

    // -------------------------------------------------------------------------------------------------- values

    [[nodiscard]] std::uint64_t whole(const Element& element) const {
        if (element.end - element.content > 8)
            fail(element.at, fmt::format("a number of {} bytes, expected at most 8", element.end - element.content));
        std::uint64_t value = 0;
        for (const char byte : file_.bytes(element.content, element.end - element.content))
            value = value << 8 | static_cast<unsigned char>(byte);
        return value;
    }
    [[nodiscard]] std::string text(const Element& element) const {
        if (element.end - element.content > longest_text)
            fail(element.at,
                 fmt::format("a text of {} bytes, expected at most {}", element.end - element.content, longest_text));
        std::string all = file_.bytes(element.content, element.end - element.content);
        return all.substr(0, all.find('\0')); // may be padded with zeros
    }

    // ---------------------------------------------------------------------------------------------------- start

    void check_kind(const Element& head) {
        std::string kind = "matroska";
        std::uint64_t read_version = 1, doc_version = 1, id_bytes = 4, size_bytes = 8;
        const bool sound = each_child(head, [&](const Element& child) {
            switch (child.name) {
            case id::doc_type:
                kind = text(child);
                break;
            case id::read_version:
                read_version = whole(child);
                break;
            case id::doc_read_version:
                doc_version = whole(child);
                break;
            case id::longest_id:
                id_bytes = whole(child);
                break;
            case id::longest_size:
                size_bytes = whole(child);
                break;
            default:
                break;
            }
        });
        if (!sound)
            fail(head.at, "the EBML head is damaged");
        if (kind != "matroska" && kind != "webm")
            fail(head.at, fmt::format("EBML of the kind {}, expected matroska", in_quotes(kind)));
        if (read_version > 1 || doc_version > 4)
            fail(head.at, fmt::format("EBML version {} with Matroska version {}, expected at most 1 and 4",
                                      read_version, doc_version));
        if (id_bytes > 4 || size_bytes > 8)
            fail(head.at, fmt::format("EBML with names of up to {} and sizes of up to {} bytes, expected 4 and 8",
                                      id_bytes, size_bytes));
    }

    [[nodiscard]] Element segment_after(std::uint64_t at) {
        for (;;) {
            const auto element = element_at(at, file_.size());
            if (!element)
                fail(at, "no Segment, which holds a Matroska file's content");
            count(*element);
            if (element->name == id::segment)
                return *element;
            if (element->end == unknown || element->end >= file_.size())
                fail(at, "no Segment, which holds a Matroska file's content");
            at = element->end;
        }
    }

    // -------------------------------------------------------------------------------------------------- segment

    void read_segment(std::uint64_t at, std::uint64_t end) {
        while (at < end) {
            const auto element = element_at(at, end);
            if (!element || !one_of(top_level, element->name) ||
                (element->end == unknown && element->name != id::cluster)) {
                at = after_damage(at, at + 1, end);
                continue;
            }
            count(*element);
            if (element->name == id::cluster) {
                at = read_cluster(*element, end);
                continue;
            }
            if (element->end > end) {
                at = after_damage(at, element->content, end);
                continue;
            }
            read_description(*element);
            at = element->end;
        }
    }

    void warn_of_end() {
        if (!told_end_)
            warn("the recording ends in the middle of an element; what was whole before is used");
        told_end_ = true;
    }

    /// Says what is damaged, and finds where to read on: the next cluster, or descriptions that may stand at the end.
    /// Where nothing follows, the file was cut.
    [[nodiscard]] std::uint64_t after_damage(std::uint64_t at, std::uint64_t search, std::uint64_t end) {
        std::uint64_t next = end;
        constexpr std::uint64_t widest = 1 << 20, overlap = 3;
        std::uint64_t window = 1 << 12; // the next cluster may be near, and many clusters damaged
        for (std::uint64_t from = search; from < end && next == end;
             from += window, window = std::min(2 * window, widest)) {
            const std::string bytes = file_.bytes(from, std::min(window + overlap, end - from));
            for (std::size_t i = 0; i + 4 <= bytes.size() && i < window; ++i) {
                Id name = 0;
                for (std::size_t j = 0; j < 4; ++j)
                    name = name << 8 | static_cast<unsigned char>(bytes[i + j]);
                if (one_of(recovered, name) && plausible(from + i, end)) {
                    next = from + i;
                    break;
                }
            }
        }
        const auto broken = element_at(at, end);
        if (next == end && end == file_.size() && (end - at < longest_head || (broken && broken->end > end)))
            warn_of_end();
        else if (next == at)
            damage_.add(place(at) + "a cluster that does not end where it says.");
        else
            damage_.add(place(at) + fmt::format("damaged; {} are left out.", counted(next - at, "byte")));
        return next;
    }

    /// Whether these four bytes start an element, and do not just look like it in an image: its first child fits.
    [[nodiscard]] bool plausible(std::uint64_t at, std::uint64_t end) const {
        const auto element = element_at(at, end);
        if (!element || element->end == element->content)
            return false;
        const auto child = element_at(element->content, end);
        if (!child || child->end == unknown || child->end > element->end)
            return false;
        switch (element->name) {
        case id::cluster:
            return one_of(in_cluster, child->name);
        case id::tracks:
            return child->name == id::track_entry || child->name == id::crc || child->name == id::padding;
        case id::tags:
            return child->name == id::tag || child->name == id::crc || child->name == id::padding;
        default:
            return child->name == id::attached_file || child->name == id::crc || child->name == id::padding;
        }
    }

    // --------------------------------------------------------------------------------------------- descriptions

    void read_description(const Element& element) {
        if (!one_of(described, element.name))
            return;
        bool sound = false;
        try {
            sound = each_child(element, [&](const Element& child) {
                if (element.name == id::info && child.name == id::timestamp_scale)
                    scale_ns_ = whole(child);
                else if (element.name == id::tracks && child.name == id::track_entry)
                    read_track(child);
                else if (element.name == id::tags && child.name == id::tag)
                    read_tag(child);
                else if (element.name == id::attachments && child.name == id::attached_file)
                    read_attachment(child);
            });
        } catch (const Damage& damage) {
            damage_.add(fmt::format("{}; what else is described there may be missing.", damage.what()));
            return;
        }
        if (!sound)
            damage_.add(place(element.at) + "damaged; what it describes may be missing.");
    }

    void read_track(const Element& entry) {
        check_room_in(contents_.tracks, most_descriptions, entry, "tracks");
        Track track;
        (void)each_child(entry, [&](const Element& child) {
            switch (child.name) {
            case id::track_number:
                track.number = whole(child);
                break;
            case id::track_uid:
                track.uid = whole(child);
                break;
            case id::track_type:
                track.video = whole(child) == 1;
                break;
            case id::track_name:
                track.name = text(child);
                break;
            case id::codec_id:
                track.codec = text(child);
                break;
            case id::codec_private: // longer ones are those of codecs that nobody here decodes
                track.codec_private = file_.bytes(
                    child.content, std::min<std::uint64_t>(child.end - child.content, std::uint64_t{longest_text}));
                break;
            case id::default_duration:
                track.duration_ns = static_cast<std::int64_t>(std::min<std::uint64_t>(whole(child), 1'000'000'000'000));
                break;
            case id::encodings:
                track.packed = true;
                break;
            case id::video:
                (void)each_child(child, [&](const Element& detail) {
                    if (detail.name == id::pixel_width)
                        track.width = static_cast<double>(whole(detail));
                    else if (detail.name == id::pixel_height)
                        track.height = static_cast<double>(whole(detail));
                });
                break;
            default:
                break;
            }
        });
        contents_.tracks.push_back(std::move(track));
    }

    void read_tag(const Element& element) {
        Tag about;
        std::vector<Tag> tags;
        (void)each_child(element, [&](const Element& child) {
            if (child.name == id::targets)
                (void)each_child(child, [&](const Element& target) {
                    if (target.name == id::target_track)
                        about.track_uid = whole(target);
                    else if (target.name == id::target_attachment)
                        about.attachment_uid = whole(target);
                });
            if (child.name != id::simple_tag)
                return;
            check_room_in(tags, most_descriptions, child, "tags");
            Tag tag;
            (void)each_child(child, [&](const Element& part) {
                if (part.name == id::tag_name)
                    tag.name = text(part);
                else if (part.name == id::tag_string)
                    tag.value = text(part);
            });
            tags.push_back(std::move(tag));
        });
        for (Tag& tag : tags) {
            check_room_in(contents_.tags, most_descriptions, element, "tags");
            tag.track_uid = about.track_uid;
            tag.attachment_uid = about.attachment_uid;
            contents_.tags.push_back(std::move(tag));
        }
    }

    void read_attachment(const Element& element) {
        check_room_in(contents_.attachments, most_descriptions, element, "attached files");
        Attachment attachment;
        (void)each_child(element, [&](const Element& child) {
            if (child.name == id::file_name) {
                attachment.name = text(child);
            } else if (child.name == id::file_uid) {
                attachment.uid = whole(child);
            } else if (child.name == id::file_data) {
                attachment.at = child.content;
                attachment.bytes = child.end - child.content;
            }
        });
        contents_.attachments.push_back(std::move(attachment));
    }

    // ------------------------------------------------------------------------------------------------- clusters

    /// Reads the blocks, and returns where the next element starts.
    [[nodiscard]] std::uint64_t read_cluster(const Element& cluster, std::uint64_t end) {
        std::optional<std::uint64_t> time;
        const std::size_t first = contents_.blocks.size();
        const bool known = cluster.end != unknown;
        const std::uint64_t own_end = std::min(cluster.end, end);
        std::uint64_t at = cluster.content;
        bool damaged = false;
        while (at < own_end) {
            const auto child = element_at(at, own_end);
            if (!known && child && one_of(top_level, child->name) && !one_of(in_cluster, child->name))
                break;
            if (!child || !one_of(in_cluster, child->name) || child->end == unknown) {
                damaged = true;
                break;
            }
            if (child->end > own_end) {
                damaged = true; // or cut: then nothing follows
                break;
            }
            count(*child);
            try {
                if (child->name == id::cluster_time)
                    time = whole(*child);
                else if (child->name == id::simple_block)
                    read_block(*child);
                else if (child->name == id::block_group)
                    read_group(*child);
            } catch (const Damage&) {
                damaged = true;
                break;
            }
            at = child->end;
        }
        settle_times(cluster, time, first);
        return damaged ? after_damage(at, at, end) : at;
    }

    void read_group(const Element& group) {
        const bool sound = each_child(group, [&](const Element& part) {
            if (part.name == id::block)
                read_block(part);
        });
        if (!sound)
            fail(group.at, "a damaged group");
    }

    void read_block(const Element& element) {
        constexpr std::uint64_t longest_start = 8 + 2 + 1; // track, time, flags
        const std::string start = file_.bytes(element.content, std::min(longest_start, element.end - element.content));
        const auto track = number_in(start, 8);
        if (!track || track->length + 3 > start.size())
            fail(element.at, "a block without its track and time");
        check_room_in(contents_.blocks, most_elements, element, "blocks");
        const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(start[track->length + i]); };
        Block block;
        block.track = track->data();
        block.time_ns = static_cast<std::int16_t>(byte(0) << 8 | byte(1)); // to the cluster's, not yet scaled
        block.laced = (byte(2) & 0x06) != 0;
        block.at = element.content + track->length + 3;
        block.bytes = element.end - block.at;
        contents_.blocks.push_back(block);
    }

    /// The cluster's time may stand behind its blocks.
    void settle_times(const Element& cluster, std::optional<std::uint64_t> time, std::size_t first) {
        const auto blocks = std::span(contents_.blocks).subspan(first);
        constexpr std::uint64_t longest_ticks = std::uint64_t{1} << 62;
        if (!blocks.empty() && (!time || *time > longest_ticks)) {
            damage_.add(place(cluster.at) +
                        fmt::format("a cluster without a time; its {} are left out.", counted(blocks.size(), "block")));
            contents_.blocks.resize(first);
            return;
        }
        for (Block& block : blocks)
            block.time_ns += static_cast<std::int64_t>(*time);
    }

    /// Ticks become nanoseconds, and blocks of other tracks are forgotten: both need descriptions that may come late.
    void settle() {
        if (scale_ns_ == 0)
            scale_ns_ = default_scale_ns;
        const auto limit =
            static_cast<std::int64_t>(static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max()) / scale_ns_);
        std::unordered_set<std::uint64_t> videos;
        for (const Track& track : contents_.tracks)
            if (track.video)
                videos.insert(track.number);
        std::size_t late = 0;
        std::erase_if(contents_.blocks, [&](const Block& block) {
            const bool beyond = block.time_ns > limit || block.time_ns < -limit;
            late += beyond;
            return beyond || !videos.contains(block.track);
        });
        if (late > 0)
            warn(fmt::format("{} with impossible times are left out", counted(late, "block")));
        for (Block& block : contents_.blocks)
            block.time_ns *= static_cast<std::int64_t>(scale_ns_);
    }

    static constexpr std::uint64_t default_scale_ns = 1'000'000;

    const FileBytes& file_;
    Contents& contents_;
    std::uint64_t scale_ns_ = default_scale_ns;
    std::size_t elements_ = 0;
    bool told_end_ = false;
    RepeatedWarning damage_{contents_.warnings};
};

} // namespace

bool is_matroska(std::string_view start) { return start.starts_with("\x1A\x45\xDF\xA3"); }

Contents read(const FileBytes& file) {
    Contents contents;
    Reader(file, contents).read();
    return contents;
}

} // namespace scanshade::matroska
