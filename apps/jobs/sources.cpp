#include "apps/jobs/sources.h"

#include "io/output_file.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <fmt/format.h>
#include <fstream>
#include <iostream>
#include <unordered_set>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

void refuse_unusable(const std::string& source) {
    if (source.empty())
        throw Error("a source is expected, found an empty name");
    if (as_utf8(source) != source)
        throw Error(in_quotes(as_utf8(source)) + ": the name is not UTF-8, as a plan's must be");
    if (source.starts_with('-'))
        throw Error(in_quotes(source) + " would be taken for an option of the command: write ./NAME");
}

Source source_from(std::string line) {
    if (line.ends_with('\r'))
        line.pop_back();
    Source source;
    if (const auto tab = line.find('\t'); tab != std::string::npos) {
        const auto bytes = whole_number(trimmed(std::string_view(line).substr(tab + 1)));
        if (!bytes)
            throw Error(in_quotes(line.substr(tab + 1)) + " given, expected a size in bytes after the tab");
        source.bytes = *bytes;
        line.resize(tab);
    }
    source.name = std::move(line);
    return source;
}

/// As part of a path: without what would hide it, be an option, or not be seen in a terminal.
std::string part_from(std::string part) {
    for (char& c : part)
        if (static_cast<unsigned char>(c) < ' ' || c == '\x7f')
            c = '_';
    if (part[0] == '.' || part[0] == '-')
        part[0] = '_';
    constexpr std::size_t longest = 200; // of the 255 bytes that file systems have
    return shortened(part, longest);
}

} // namespace

std::vector<Source> sources_from(const std::vector<std::string>& given, const fs::path& list) {
    std::vector<Source> sources;
    std::unordered_set<std::string> seen;
    const auto add = [&](Source source) {
        refuse_unusable(source.name);
        if (!seen.insert(source.name).second)
            throw Error(in_quotes(source.name) + " is listed twice");
        sources.push_back(std::move(source));
    };
    for (const std::string& name : given)
        add({name});
    if (list.empty())
        return sources;
    std::ifstream file;
    if (list != "-") {
        file.open(list, std::ios::binary);
        if (!file)
            fail_to_read(list, std::error_code(errno, std::generic_category()));
    }
    std::istream& stream = list == "-" ? std::cin : file;
    int number = 0;
    for (std::string line; std::getline(stream, line);) {
        ++number;
        if (!line.empty() && line != "\r")
            during(at_line(list == "-" ? "standard input" : list, number), [&] { add(source_from(line)); });
    }
    if (stream.bad())
        fail_to_read(list, std::make_error_code(std::errc::io_error));
    return sources;
}

std::string SourceNames::name_of(const std::string& source) {
    std::vector<std::string> parts;
    std::string part;
    for (const char c : source + "/")
        if (c != '/' && c != ':') {
            part += c;
        } else if (!part.empty()) {
            if (part != "." && part != "..")
                parts.push_back(part_from(part));
            part.clear();
        }
    if (parts.empty())
        parts.emplace_back("source");
    std::string name;
    std::vector<std::string> above;
    for (const std::string& each : parts) {
        if (!name.empty())
            above.push_back(name);
        name += (name.empty() ? "" : "/") + each;
    }
    for (const std::string& folder : above)
        if (taken_.contains(folder))
            throw Error(fmt::format("source {} lies within another one: their results would mix", in_quotes(source)));
    if (folders_.contains(name))
        throw Error(fmt::format("source {} has another one within: their results would mix", in_quotes(source)));
    std::string free = name;
    for (int n = 2; folders_.contains(free) || !taken_.insert(free).second; ++n)
        free = fmt::format("{}-{}", name, n);
    folders_.insert(above.begin(), above.end());
    return free;
}

} // namespace scanshade
