#include "tests/reference/npz.h"

#include "projection/base/error.h"

#include <cstring>
#include <fmt/format.h>
#include <memory>
#include <opencv2/core.hpp>
#include <regex>
#include <zip.h>

namespace scanshade::reference {
namespace {

Array parse_npy(const std::vector<char>& bytes) {
    if (bytes.size() < 10 || std::memcmp(bytes.data(), "\x93NUMPY", 6) != 0)
        throw Error("not a .npy array");
    const bool wide = bytes[6] > 1;
    std::uint32_t header = 0;
    std::memcpy(&header, bytes.data() + 8, wide ? 4 : 2);
    const std::size_t start = (wide ? 12 : 10) + header;
    if (start > bytes.size())
        throw Error("header runs past the end");
    const std::string text(bytes.data() + (wide ? 12 : 10), header);
    std::smatch found;
    Array array;
    if (!std::regex_search(text, found, std::regex("'descr': '[<|]([a-z][0-9])'")))
        throw Error("unexpected type in " + text);
    array.type = found[1];
    if (text.find("'fortran_order': False") == std::string::npos)
        throw Error("C order expected in " + text);
    if (!std::regex_search(text, found, std::regex("'shape': \\(([0-9, ]*)\\)")))
        throw Error("no shape in " + text);
    const std::string dims = found[1];
    const std::regex number("[0-9]+");
    for (std::sregex_iterator i(dims.begin(), dims.end(), number), end; i != end; ++i)
        array.shape.push_back(std::stoull(i->str()));
    const std::size_t wanted = array.count() * static_cast<std::size_t>(array.type[1] - '0');
    if (bytes.size() - start != wanted)
        throw Error(fmt::format("{} bytes expected, {} found", wanted, bytes.size() - start));
    array.data.resize(wanted);
    std::memcpy(array.data.data(), bytes.data() + start, wanted);
    return array;
}

template <class T>
T element(const std::vector<std::byte>& data, std::size_t i) {
    T value;
    std::memcpy(&value, data.data() + i * sizeof(T), sizeof(T));
    return value;
}

} // namespace

std::size_t Array::count() const {
    std::size_t n = 1;
    for (std::size_t s : shape)
        n *= s;
    return n;
}

double Array::at(std::size_t i) const {
    if (type == "f4")
        return element<float>(data, i);
    if (type == "f2")
        return static_cast<float>(element<cv::float16_t>(data, i));
    if (type == "u1")
        return element<std::uint8_t>(data, i);
    if (type == "i1")
        return element<std::int8_t>(data, i);
    if (type == "u4")
        return element<std::uint32_t>(data, i);
    throw Error("arrays of type " + type + " are not read");
}

std::map<std::string, Array> read_npz(const std::filesystem::path& file) {
    return during(file.string(), [&] {
        int code = 0;
        const std::unique_ptr<zip_t, void (*)(zip_t*)> archive(zip_open(file.c_str(), ZIP_RDONLY, &code), zip_discard);
        if (!archive)
            throw Error(fmt::format("no zip archive (code {})", code));
        std::map<std::string, Array> arrays;
        for (zip_int64_t i = 0; i < zip_get_num_entries(archive.get(), 0); ++i) {
            zip_stat_t stat;
            zip_stat_index(archive.get(), static_cast<zip_uint64_t>(i), 0, &stat);
            const std::unique_ptr<zip_file_t, int (*)(zip_file_t*)> entry(zip_fopen_index(archive.get(), stat.index, 0),
                                                                          zip_fclose);
            std::vector<char> bytes(stat.size);
            if (!entry || zip_fread(entry.get(), bytes.data(), stat.size) != static_cast<zip_int64_t>(stat.size))
                throw Error(fmt::format("{} cannot be read", stat.name));
            const std::string name = stat.name;
            arrays[name.substr(0, name.rfind(".npy"))] = during(name, [&] { return parse_npy(bytes); });
        }
        return arrays;
    });
}

} // namespace scanshade::reference
