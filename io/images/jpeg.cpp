// JPEG with libjpeg-turbo. Its errors jump out of its functions (setjmp), so their callers hold no objects.
#include "io/images/jpeg_output.h"
#include "io/images/readers.h"

#include "projection/base/error.h"

#include <csetjmp>
#include <cstdio> // jpeglib.h lacks it
#include <cstdlib>
#include <fmt/format.h>
#include <memory>

#include <jpeglib.h>

#include <jerror.h>

namespace scanshade::images {

namespace {

using image_check::refuse;

/// What to do with libjpeg's errors and warnings, and the last message.
struct Messages {
    jpeg_error_mgr manager; // first: libjpeg hands out its address
    std::jmp_buf back;
    char text[JMSG_LENGTH_MAX];
    bool ends_early;
};

[[noreturn]] void leave(j_common_ptr info) {
    auto* messages = reinterpret_cast<Messages*>(info->err);
    messages->manager.format_message(info, messages->text);
    std::longjmp(messages->back, 1);
}

/// Lost pixels are an error. Common flaws of cameras' files, such as bytes between markers, are not.
void judge(j_common_ptr info, int level) {
    auto* messages = reinterpret_cast<Messages*>(info->err);
    const int code = messages->manager.msg_code;
    messages->ends_early = level < 0 && (code == JWRN_JPEG_EOF || code == JWRN_HIT_MARKER);
    if (messages->ends_early)
        leave(info);
}

/// Limits the number of scans: each may take few bytes, but costs a pass over the picture.
void limit_scans(j_common_ptr info) {
    constexpr int most_scans = 500;
    if (reinterpret_cast<j_decompress_ptr>(info)->input_scan_number > most_scans) {
        info->err->msg_code = JERR_BAD_PROGRESSION;
        leave(info);
    }
}

jpeg_error_mgr* set_up(Messages& messages) {
    messages.ends_early = false;
    jpeg_error_mgr* manager = jpeg_std_error(&messages.manager);
    manager->error_exit = &leave;
    manager->emit_message = &judge;
    return manager;
}

/// Calls `steps`; returns whether they finished.
template <class Steps>
bool done(Messages& messages, const Steps& steps) {
    if (setjmp(messages.back) != 0)
        return false;
    steps();
    return true;
}

class Decoder {
  public:
    Decoder(std::string_view bytes, const Path& file) : file_(file) {
        info().err = set_up(messages_);
        progress_.progress_monitor = &limit_scans;
        run([&] {
            jpeg_create_decompress(&info());
            info().progress = &progress_;
            jpeg_mem_src(&info(), reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size());
            jpeg_read_header(&info(), TRUE);
        });
    }

    template <class Steps>
    void run(const Steps& steps) {
        if (!done(messages_, steps))
            refuse(file_,
                   fmt::format("JPEG {}: {}", messages_.ends_early ? "ends early" : "is damaged", messages_.text));
    }
    jpeg_decompress_struct& info() { return owned_.info; }

  private:
    struct Owned {
        Owned() = default;
        ~Owned() { jpeg_destroy_decompress(&info); }
        Owned(const Owned&) = delete;
        Owned& operator=(const Owned&) = delete;
        jpeg_decompress_struct info{};
    };
    const Path& file_;
    Messages messages_{};
    jpeg_progress_mgr progress_{};
    Owned owned_;
};

ImageFacts facts_of(const jpeg_decompress_struct& info, const Path& file) {
    ImageFacts facts;
    facts.size = image_check::checked_size(info.image_width, info.image_height, file);
    facts.bits = info.data_precision;
    facts.channels = info.num_components;
    return facts;
}

/// Printing inks as libjpeg leaves them: 255 is no ink.
cv::Mat3b from_cmyk(const cv::Mat& cmyk) {
    cv::Mat3b bgr(cmyk.size());
    for (int v = 0; v < bgr.rows; ++v)
        for (int u = 0; u < bgr.cols; ++u) {
            const cv::Vec4b& inks = cmyk.at<cv::Vec4b>(v, u);
            for (int channel = 0; channel < 3; ++channel) {
                const int key = inks[3], paper = 255 - inks[2 - channel];
                bgr(v, u)[channel] = static_cast<uchar>(key - (paper * key >> 8));
            }
        }
    return bgr;
}

} // namespace

ImageFacts jpeg_header(std::string_view bytes, const Path& file) { return facts_of(Decoder(bytes, file).info(), file); }

cv::Mat3b colour_jpeg(std::string_view bytes, const ImageFacts& facts, const Path& file) {
    Decoder decoder(bytes, file);
    jpeg_decompress_struct& info = decoder.info();
    if (!info.arith_code) // with Huffman codes, every block of 8x8 pixels takes at least a bit
        image_check::check_expansion(bytes.size(), 512, facts, 1, file);
    const bool inks = info.num_components == 4;
    cv::Mat image(facts.size, inks ? CV_8UC4 : CV_8UC3);
    decoder.run([&] {
        info.out_color_space = inks ? JCS_CMYK : JCS_EXT_BGR;
        jpeg_start_decompress(&info);
        while (info.output_scanline < info.output_height) {
            JSAMPROW row = image.ptr(static_cast<int>(info.output_scanline));
            jpeg_read_scanlines(&info, &row, 1);
        }
        jpeg_finish_decompress(&info);
    });
    return inks ? from_cmyk(image) : cv::Mat3b(image);
}

namespace {

std::string encoded(const cv::Mat& image, int quality) {
    if (image.type() != CV_8UC3)
        throw Error(fmt::format("a JPEG is made of 8-bit BGR here, not of OpenCV's type {}", image.type()));
    Messages messages{};
    jpeg_compress_struct info{};
    info.err = set_up(messages);
    unsigned char* bytes = nullptr;
    unsigned long size = 0;
    const bool well = done(messages, [&] {
        jpeg_create_compress(&info);
        jpeg_mem_dest(&info, &bytes, &size);
        info.image_width = static_cast<JDIMENSION>(image.cols);
        info.image_height = static_cast<JDIMENSION>(image.rows);
        info.input_components = 3;
        info.in_color_space = JCS_EXT_BGR;
        jpeg_set_defaults(&info);
        jpeg_set_quality(&info, quality, TRUE);
        jpeg_start_compress(&info, TRUE);
        while (info.next_scanline < info.image_height) {
            JSAMPROW row = const_cast<uchar*>(image.ptr(static_cast<int>(info.next_scanline))); // is only read
            jpeg_write_scanlines(&info, &row, 1);
        }
        jpeg_finish_compress(&info);
    });
    jpeg_destroy_compress(&info);
    const std::unique_ptr<unsigned char, decltype(&std::free)> owner(bytes, &std::free);
    if (!well)
        throw Error(fmt::format("cannot be encoded as JPEG: {}", messages.text));
    return {reinterpret_cast<const char*>(bytes), size};
}

} // namespace

std::string encoded_jpeg(const cv::Mat& image) { return encoded(image, 95); }

} // namespace scanshade::images

namespace scanshade {

std::string encoded_jpeg(const cv::Mat3b& picture, int quality) { return images::encoded(picture, quality); }

} // namespace scanshade
