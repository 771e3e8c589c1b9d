// Our own PNGs: another library reads the same pixels, and we read its own. They are small, and the same bytes on every
// run.
#include "io/compression/deflate.h"
#include "io/images/format.h"
#include "io/images/png_input.h"
#include "io/images/png_output.h"
#include "projection/base/error.h"

#include <functional>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>
#include <zlib.h>

namespace scanshade {
namespace {

/// Decoded by a library that had no part in writing it.
TEST(images, our_pngs_come_back_bit_by_bit) {
    cv::theRNG().state = 9;
    for (const int type : {CV_8UC1, CV_16UC1, CV_8UC3, CV_16UC3})
        for (const cv::Size size : {cv::Size(1, 1), cv::Size(13, 7), cv::Size(641, 479)}) {
            cv::Mat image(size, type);
            cv::randu(image, cv::Scalar::all(0), cv::Scalar::all(image.depth() == CV_8U ? 256 : 65536));
            const std::string bytes = encoded_png(image);
            const cv::Mat view(1, static_cast<int>(bytes.size()), CV_8U, const_cast<char*>(bytes.data()));
            const cv::Mat back = cv::imdecode(view, cv::IMREAD_UNCHANGED);
            ASSERT_EQ(back.type(), type);
            ASSERT_EQ(back.size(), size);
            EXPECT_EQ(cv::norm(back, image, cv::NORM_INF), 0);
            if (type == CV_16UC3)
                EXPECT_TRUE(decoded_plain_png(bytes).empty());
            else
                EXPECT_EQ(cv::norm(decoded_plain_png(bytes), image, cv::NORM_INF), 0);
            const cv::Mat inner = image(cv::Rect(0, 0, (size.width + 1) / 2, size.height)); // rows lie apart in memory
            EXPECT_EQ(encoded_png(inner), encoded_png(inner.clone()));
        }
    EXPECT_THROW((void)encoded_png(cv::Mat1f(4, 4, 0.5F)), Error);
    EXPECT_THROW((void)encoded_png(cv::Mat()), Error);
}

/// Calls `work` from ever deeper in the stack.
void at_depths(int depths, const std::function<void()>& work) {
    if (depths == 0)
        return;
    [[maybe_unused]] volatile char further[1 << 16];
    further[0] = '\0';
    work();
    at_depths(depths - 1, work);
    further[1] = '\0'; // not a tail call: the frame stays
}

/// ISA-L's levels 1 and 2 hash an address: one packing in some thousands of the same pixels is another. Small images
/// are packed by level 3, the others by level 0.
TEST(images, the_same_pixels_are_the_same_bytes_wherever_the_stack_lies) {
    cv::theRNG().state = 4;
    std::vector<cv::Mat> images(530);
    for (std::size_t i = 0; i < images.size(); ++i) { // rows that begin alike, so that the first bytes are found again
        const int rows = i < 500 ? 12 : 4000;
        cv::Mat1b row(1, 24), noise(rows, 24);
        cv::randu(row, 0, 256);
        cv::randu(noise, 0, 256);
        cv::repeat(row, rows, 1, images[i]);
        noise.copyTo(images[i], noise > (i < 500 ? 230 : 150));
    }
    std::vector<std::string> first;
    std::size_t different = 0;
    at_depths(80, [&] {
        for (std::size_t i = 0; i < images.size(); ++i)
            if (std::string bytes = encoded_png(images[i]); i == first.size())
                first.push_back(std::move(bytes));
            else
                different += bytes != first[i];
    });
    EXPECT_EQ(different, 0U);
}

/// Codes are made from a few rows. They must fit the others as well: whether all rows are alike, one object stands
/// before nothing, or a strip lies between the rows that were looked at.
TEST(images, a_png_is_as_small_as_by_the_slower_packer) {
    cv::theRNG().state = 8;
    cv::Mat1b noise(480, 640);
    cv::randn(noise, 128, 6);
    for (const cv::Rect& seen : {cv::Rect(0, 0, 640, 480), cv::Rect(0, 0, 640, 240), cv::Rect(0, 100, 640, 9),
                                 cv::Rect(300, 200, 40, 90), cv::Rect(100, 50, 440, 380), cv::Rect()}) {
        cv::Mat1b image(noise.size(), 0);
        if (!seen.empty())
            noise(seen).copyTo(image(seen));
        std::string rows; // as the writer filters them
        for (int y = 0; y < image.rows; ++y) {
            rows += '\2';
            for (int x = 0; x < image.cols; ++x)
                rows += static_cast<char>(image(y, x) - (y > 0 ? image(y - 1, x) : 0));
        }
        EXPECT_LT(encoded_png(image).size(), deflated(rows).size() * 21 / 20 + 500) << seen;
    }
}

/// An image that is packed in bands: a row's differences are those to the last row of the band before.
TEST(images, bands_of_a_large_png_fit_together) {
    cv::Mat1w image(3000, 12000); // 72 MB
    for (int y = 0; y < image.rows; ++y)
        for (int x = 0; x < image.cols; ++x)
            image(y, x) = static_cast<ushort>(x * (y / 500 + 1) + y);
    EXPECT_EQ(cv::norm(decoded_plain_png(encoded_png(image)), image, cv::NORM_INF), 0);
}

TEST(depth_images, a_large_png_packed_and_unpacked_in_pieces_is_one_stream) {
    // 72 MB of pixels: two pieces in one direction, 69 in the other. A change in the last ones must not go unseen.
    cv::Mat1w image(6000, 6000);
    std::uint32_t random = 1;
    for (ushort& value : image) {
        random = random * 1664525 + 1013904223;
        value = static_cast<ushort>(2000 + (random >> 28));
    }
    std::string bytes = encoded_png(image);
    EXPECT_EQ(cv::norm(decoded_plain_png(bytes), image, cv::NORM_INF), 0);
    EXPECT_EQ(cv::norm(cv::imdecode(std::vector<char>(bytes.begin(), bytes.end()), cv::IMREAD_UNCHANGED), image,
                       cv::NORM_INF),
              0)
        << "libpng reads the same";
    constexpr std::size_t from_end_of_stream = 12 + 4 + 2; // IEND, a checksum, and into the stream's own
    bytes[bytes.size() - from_end_of_stream] ^= 1;
    EXPECT_TRUE(decoded_plain_png(bytes).empty()) << "the stream's checksum does not fit";
}

/// PNGs that another library wrote, with each of the five filters, in one chunk or many, as it reads them itself; what
/// is not plain grey or RGB is left to it, and so is what is damaged.
TEST(images, plain_pngs_are_read_as_libpng_reads_them) {
    cv::theRNG().state = 3;
    const auto chunk = [](const std::string& type, const std::string& content) {
        std::string bytes;
        const auto append = [&](unsigned long value) {
            for (const int shift : {24, 16, 8, 0})
                bytes += static_cast<char>(value >> shift & 0xff);
        };
        append(content.size());
        bytes += type + content;
        append(crc32(0, reinterpret_cast<const Bytef*>(bytes.data()) + 4, static_cast<uInt>(bytes.size() - 4)));
        return bytes;
    };
    const auto png = [&](cv::Size size, int bits, int channels, const std::string& filtered, std::size_t piece,
                         bool transparent) {
        std::string head(8, '\0');
        for (int i = 0; i < 4; ++i) {
            head[3 - i] = static_cast<char>(size.width >> (8 * i) & 0xff);
            head[7 - i] = static_cast<char>(size.height >> (8 * i) & 0xff);
        }
        uLongf length = compressBound(filtered.size());
        std::string packed(length, '\0');
        compress2(reinterpret_cast<Bytef*>(packed.data()), &length, reinterpret_cast<const Bytef*>(filtered.data()),
                  filtered.size(), 6);
        packed.resize(length);
        std::string file =
            "\x89PNG\r\n\x1a\n" +
            chunk("IHDR", head + static_cast<char>(bits) + (channels == 3 ? '\x02' : '\0') + std::string(3, '\0'));
        if (transparent)
            file += chunk("tRNS", std::string(2 * static_cast<std::size_t>(channels), '\0'));
        for (std::size_t at = 0; at < packed.size(); at += piece)
            file += chunk("IDAT", packed.substr(at, piece));
        return file + chunk("IEND", "");
    };
    const auto libpng = [](const std::string& bytes) {
        return cv::imdecode(cv::Mat(1, static_cast<int>(bytes.size()), CV_8U, const_cast<char*>(bytes.data())),
                            cv::IMREAD_UNCHANGED);
    };
    for (const auto& [bits, channels] : {std::pair(8, 1), std::pair(16, 1), std::pair(8, 3)})
        for (const cv::Size size : {cv::Size(1, 1), cv::Size(1, 9), cv::Size(37, 11), cv::Size(320, 241)}) {
            std::string filtered; // any bytes are some image, whatever the filter
            for (int y = 0; y < size.height; ++y) {
                filtered += static_cast<char>(y % 5);
                for (int i = 0; i < size.width * channels * bits / 8; ++i)
                    filtered += static_cast<char>(cv::theRNG().uniform(0, 256) & cv::theRNG().uniform(0, 256));
            }
            for (const std::size_t piece : {std::size_t(7), std::size_t(1) << 20}) {
                const std::string file = png(size, bits, channels, filtered, piece, false);
                const cv::Mat ours = decoded_plain_png(file), theirs = libpng(file);
                ASSERT_EQ(read_image_header(file, "image").bits, bits);
                ASSERT_EQ(ours.type(), theirs.type());
                ASSERT_EQ(ours.size(), size);
                EXPECT_EQ(cv::norm(ours, theirs, cv::NORM_INF), 0) << size << " of " << bits << " bits";
            }
            EXPECT_TRUE(decoded_plain_png(png(size, bits, channels, filtered, 1000, true)).empty()) << "transparency";
            EXPECT_TRUE(decoded_plain_png(png(size, bits, channels, filtered + "x", 1000, false)).empty())
                << "more than pixels";
            EXPECT_TRUE(decoded_plain_png(png(size, bits, channels, filtered.substr(1), 1000, false)).empty())
                << "fewer";
            filtered[0] = 5;
            EXPECT_TRUE(decoded_plain_png(png(size, bits, channels, filtered, 1000, false)).empty())
                << "no such filter";
        }
}

} // namespace
} // namespace scanshade
