// E57 files made in code: pages, sections of uneven packets, XML.
#pragma once

#include "io/clouds/e57/e57.h"
#include "tests/support/raw.h"

#include <algorithm>
#include <fmt/format.h>
#include <string>
#include <vector>

namespace scanshade::tests {

/// Values of `bits` bits side by side, from the lowest bit of each byte on.
class Bits {
  public:
    void add(std::uint64_t value, unsigned bits) {
        for (unsigned k = 0; k < bits; ++k, ++count_) {
            if (count_ % 8 == 0)
                bytes_ += '\0';
            bytes_.back() = static_cast<char>(bytes_.back() | static_cast<char>((value >> k & 1) << (count_ % 8)));
        }
    }
    [[nodiscard]] const std::string& bytes() const { return bytes_; }

  private:
    std::string bytes_;
    std::size_t count_ = 0;
};

inline std::uint64_t in_file(std::uint64_t offset) { return offset / 1020 * 1024 + offset % 1020; }

/// A section with streams cut into uneven packets, an index packet and an empty one among them. `at`: in the contents.
inline std::string section(std::uint64_t at, const std::vector<std::string>& streams) {
    std::string packets;
    std::vector<std::size_t> done(streams.size(), 0);
    for (std::size_t round = 0;; ++round) {
        std::string lengths, data;
        for (std::size_t i = 0; i < streams.size(); ++i) {
            const std::size_t size = std::min(streams[i].size() - done[i], 7 + 3 * i + 100 * round);
            lengths += raw(static_cast<std::uint16_t>(size));
            data += streams[i].substr(done[i], size);
            done[i] += size;
        }
        if (data.empty())
            break;
        std::string packet("\1\0\0\0", 4);
        packet.append(raw(static_cast<std::uint16_t>(streams.size()))).append(lengths).append(data);
        packet.resize((packet.size() + 3) / 4 * 4);
        packet.replace(2, 2, raw(static_cast<std::uint16_t>(packet.size() - 1)));
        packets += packet;
        if (round == 0)
            packets += std::string("\0\0\x0f\0", 4) + std::string(12, '\0') + std::string("\2\0\3\0", 4);
    }
    std::string header(8, '\0');
    header[0] = 1;
    return header + raw(static_cast<std::uint64_t>(32 + packets.size())) + raw(in_file(at + 32)) +
           raw(std::uint64_t(0)) + packets;
}

struct TestScan {
    std::string before, prototype; ///< XML
    std::vector<std::string> streams;
    std::size_t count = 0;
};

inline std::string in_pages(std::string contents) {
    contents.resize((contents.size() + 1019) / 1020 * 1020, ' ');
    contents.replace(16, 8, raw(static_cast<std::uint64_t>(contents.size() / 1020 * 1024)));
    std::string file;
    for (std::size_t at = 0; at < contents.size(); at += 1020) {
        const std::string page = contents.substr(at, 1020);
        const std::string sum = raw(e57::checksum(page));
        file += page + std::string(sum.rbegin(), sum.rend());
    }
    return file;
}

inline std::string e57_file(const std::vector<TestScan>& scans, const std::string& xml_head = "",
                            const std::string& images = "") {
    std::string contents(48, '\0'), vector;
    contents.replace(0, 8, "ASTM-E57");
    contents[8] = 1;
    for (const TestScan& scan : scans) {
        const std::size_t at = contents.size();
        contents += section(at, scan.streams);
        vector += fmt::format("<vectorChild type=\"Structure\"><name type=\"String\"><![CDATA[a scan]]></name>{}"
                              "<points type=\"CompressedVector\" fileOffset=\"{}\" recordCount=\"{}\"><prototype "
                              "type=\"Structure\">{}</prototype><codecs type=\"Vector\"/></points></vectorChild>",
                              scan.before, in_file(at), scan.count, scan.prototype);
    }
    const std::string xml =
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>" + xml_head +
        "<e57Root type=\"Structure\" xmlns=\"http://www.astm.org/COMMIT/E57/2010-e57-v1.0\"><data3D "
        "type=\"Vector\">" +
        vector + "</data3D><images2D type=\"Vector\">" + images + "</images2D></e57Root>\n";
    contents.replace(24, 8, raw(in_file(contents.size())));
    contents.replace(32, 8, raw(static_cast<std::uint64_t>(xml.size())));
    contents.replace(40, 8, raw(std::uint64_t(1024)));
    return in_pages(contents + xml);
}

inline const std::string floats = "<cartesianX type=\"Float\" minimum=\"-1.5e+003\"/><cartesianY type=\"Float\"/>"
                                  "<cartesianZ type=\"Float\"/>";

inline TestScan float_scan(std::size_t count, double shift = 0) {
    TestScan scan{.before = "", .prototype = floats, .streams = std::vector<std::string>(3), .count = count};
    for (std::size_t i = 0; i < count; ++i)
        for (std::size_t axis = 0; axis < 3; ++axis)
            scan.streams[axis] += raw(shift + static_cast<double>(i) + 0.25 * static_cast<double>(axis));
    return scan;
}

} // namespace scanshade::tests
