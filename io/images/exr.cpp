// EXR with OpenEXR, from memory and to memory. Read: one channel of any name, or that of depth among others, halves and
// integers as floats. Written: one channel, or three of colour.
#include "io/images/readers.h"

#include "projection/base/error.h"

#include <algorithm>
#include <cctype>
#include <cstring>
#include <exception>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <ImfIO.h>
#include <ImfOutputFile.h>
#include <ImfVersion.h>
#include <optional>
#include <stdexcept>
#include <vector>

namespace scanshade::images {

namespace {

using image_check::refuse;

class ExrBytes : public Imf::IStream {
  public:
    ExrBytes(std::string_view bytes, const Path& file) : Imf::IStream(file.c_str()), bytes_(bytes) {}
    bool read(char to[], int count) override {
        const auto length = static_cast<std::size_t>(std::max(count, 0));
        if (at_ > bytes_.size() || length > bytes_.size() - at_)
            throw std::runtime_error(
                fmt::format("ends early: {} bytes, its table points to byte {}", bytes_.size(), at_ + length));
        std::memcpy(to, bytes_.data() + at_, length);
        at_ += length;
        return at_ < bytes_.size();
    }
    std::uint64_t tellg() override { return at_; }
    void seekg(std::uint64_t at) override { at_ = at; }

  private:
    std::string_view bytes_;
    std::uint64_t at_ = 0;
};

class Sink : public Imf::OStream {
  public:
    Sink() : Imf::OStream("") {}
    void write(const char from[], int count) override {
        bytes.resize(std::max(bytes.size(), at_ + static_cast<std::size_t>(count)));
        std::memcpy(bytes.data() + at_, from, static_cast<std::size_t>(count));
        at_ += static_cast<std::size_t>(count);
    }
    std::uint64_t tellp() override { return at_; }
    void seekp(std::uint64_t at) override { at_ = at; }

    std::string bytes;

  private:
    std::uint64_t at_ = 0;
};

/// Calls `steps`, OpenEXR's errors becoming ours.
template <class Steps>
auto checked(const Path& file, const Steps& steps) {
    try {
        return steps();
    } catch (const std::bad_alloc&) {
        throw;
    } catch (const std::exception& failure) {
        refuse(file, fmt::format("EXR is damaged or cut short: {}", failure.what()));
    }
}

/// How many bytes of floats one coded byte can become: twice the code's own limit, since halves are read as floats.
/// None for unknown compressions.
std::optional<std::uint64_t> expansion(Imf::Compression compression) {
    switch (compression) {
    case Imf::NO_COMPRESSION:
        return 2;
    case Imf::RLE_COMPRESSION:
        return 2 * 64;
    case Imf::B44_COMPRESSION:
    case Imf::B44A_COMPRESSION:
        return 2 * 11;
    case Imf::ZIPS_COMPRESSION:
    case Imf::ZIP_COMPRESSION:
    case Imf::PXR24_COMPRESSION:
        return 2 * 1032;
    default:
        return std::nullopt;
    }
}

std::string lower(std::string_view text) {
    std::string result(text);
    std::ranges::transform(result, result.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return result;
}

/// The only channel; or else the one that is called Z or depth, alone or in a layer of depth: "Z", "Depth.Z" and
/// "ViewLayer.Depth.Z" of Blender, "FinalImageWorldDepth.R" of Unreal. Not "Normal.Z". Empty where there is none.
std::string depth_channel(const Imf::ChannelList& channels) {
    std::string found;
    std::size_t count = 0;
    for (auto channel = channels.begin(); channel != channels.end(); ++channel, ++count) {
        const std::string name = lower(channel.name());
        const std::size_t dot = name.rfind('.');
        const std::string layer = dot == std::string::npos ? "" : name.substr(0, dot), leaf = name.substr(dot + 1);
        const bool of_depth = layer.find("depth") != std::string::npos;
        const bool is_depth = leaf == "z" || leaf == "v" || leaf == "r" ? of_depth || (layer.empty() && leaf == "z")
                                                                        : leaf.find("depth") != std::string::npos;
        if (is_depth && found.empty())
            found = channel.name();
    }
    return count == 1 ? channels.begin().name() : found;
}

} // namespace

namespace {

/// By itself, because opening the file allocates the size that it states.
Imf::Header header_of(std::string_view bytes, const Path& file) {
    constexpr std::size_t magic_and_version = 8;
    if (bytes.size() < magic_and_version)
        refuse(file, fmt::format("EXR ends early: {} bytes", bytes.size()));
    Imf::Header header;
    checked(file, [&] {
        ExrBytes source(bytes, file);
        source.seekg(magic_and_version);
        int version = static_cast<int>(image_check::little_endian_32(bytes, 4));
        header.readFrom(source, version);
        header.sanityCheck(Imf::isTiled(version));
    });
    return header;
}

} // namespace

ImageFacts exr_header(std::string_view bytes, const Path& file) {
    const Imf::Header header = header_of(bytes, file);
    const Imath::Box2i& window = header.dataWindow();
    const auto side = [](int first, int last) {
        return static_cast<std::uint64_t>(std::max(std::int64_t(last) - first + 1, std::int64_t(0)));
    };
    ImageFacts facts;
    facts.size = image_check::checked_size(side(window.min.x, window.max.x), side(window.min.y, window.max.y), file);
    facts.bits = 32;
    for (auto channel = header.channels().begin(); channel != header.channels().end(); ++channel)
        ++facts.channels;
    facts.floats = true;
    if (const auto most = expansion(header.compression()))
        image_check::check_expansion(bytes.size(), *most, facts, facts.channels, file);
    if (!depth_channel(header.channels()).empty())
        facts.channels = 1;
    return facts;
}

std::string exr_channels(std::string_view bytes, const Path& file) {
    const Imf::Header header = header_of(bytes, file);
    std::vector<std::string> names;
    for (auto channel = header.channels().begin(); channel != header.channels().end(); ++channel)
        names.emplace_back(channel.name());
    return fmt::format("{}: none of them is called Z or depth", fmt::join(names, ", "));
}

cv::Mat stored_exr(std::string_view bytes, const ImageFacts& facts, const Path& file) {
    cv::Mat1f image(facts.size);
    checked(file, [&] {
        ExrBytes source(bytes, file);
        Imf::InputFile input(source);
        const Imath::Box2i& window = input.header().dataWindow();
        Imf::FrameBuffer buffer;
        buffer.insert(depth_channel(input.header().channels()),
                      Imf::Slice::Make(Imf::FLOAT, image.data, window, sizeof(float), image.step[0]));
        input.setFrameBuffer(buffer);
        input.readPixels(window.min.y, window.max.y);
    });
    return image;
}

std::string encoded_exr(const cv::Mat& image) {
    if (image.type() != CV_32FC1 && image.type() != CV_32FC3)
        throw Error(fmt::format("an EXR is made of floats of one or three channels here, not of OpenCV's type {}",
                                image.type()));
    // Y is luminance, which viewers show as grey. OpenCV has blue first.
    const std::vector<const char*> channels = image.channels() == 3 ? std::vector{"B", "G", "R"} : std::vector{"Y"};
    Imf::Header header(image.cols, image.rows);
    header.compression() = Imf::RLE_COMPRESSION; // ZIP takes ten times as long for a tenth of the size
    Imf::FrameBuffer buffer;
    for (std::size_t i = 0; i < channels.size(); ++i) {
        header.channels().insert(channels[i], Imf::Channel(Imf::FLOAT));
        buffer.insert(channels[i], Imf::Slice::Make(Imf::FLOAT, image.data + i * sizeof(float), header.dataWindow(),
                                                    image.elemSize(), image.step[0]));
    }
    Sink sink;
    {
        Imf::OutputFile output(sink, header);
        output.setFrameBuffer(buffer);
        output.writePixels(image.rows);
    } // writes the table of lines
    return std::move(sink.bytes);
}

} // namespace scanshade::images
