// Rows of passes -> one command buffer; milliseconds per pass. Passes are plain data: they can be printed,
// timed by name and checked without a GPU.
#pragma once

#include "ao/gpu/device.h"
#include "ao/gpu/device_bytes.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace scanshade::gpu {

/// A buffer (or image) of the program, zero to begin with. Host buffers can be reached by Program::host() before
/// (upload) or after (download) a run. Others that are no pass's result are filled by Program::take() or, if they are
/// large, Program::stream_in(): memory that the host shares takes long to make.
struct BufferRow {
    enum class Host { none, upload, download, taken, streamed }; // what is uploaded may be taken, too
    std::string_view name;
    std::size_t bytes = 0;
    Host host = Host::none;
    /// Bound as a storage texel buffer (imageBuffer, uimageBuffer) instead of a storage buffer. On lavapipe a load is
    /// then one inlined gather, without a branch per lane (storage buffer) or a call (sampled texel buffer).
    enum class Texels { none, r32f, rg32f, rgba32f, r32ui, rg32ui };
    Texels texels = Texels::none;
    std::vector<float> initial = {}; ///< initial content instead of zeros; 64 KiB at most
    /// Instead of a buffer, an array of layers of 32-bit floats with mips; `bytes` is image_bytes(image). Passes that
    /// read it see a sampler2DArray (nearest texel, 0 outside), passes that write it an image2DArray[mips]. GPUs tile
    /// images and address texels in hardware; lavapipe does both in software.
    struct Image {
        std::uint32_t width = 0, height = 0, layers = 0, mips = 0;
    };
    Image image = {};
    /// Passes that write these texels see a storage buffer: lavapipe stores to one in a quarter of the time.
    bool plain_writes = false;
    /// Of a download buffer: a few bytes that the host wants even where the other results stay on the device.
    bool always_downloaded = false;
};

/// Bytes of all mips of all layers, mip by mip, layer by layer, row by row, as Program::read_back() returns them.
[[nodiscard]] std::size_t image_bytes(const BufferRow::Image& image);

/// One dispatch. `reads` bind from 0, `writes` (read-write included) from 16, the constants at 32.
struct PassRow {
    std::string name;               ///< for people, and for timings
    std::string_view shader;        ///< "cacao/blur"; empty = fill the written buffers with zero
    std::vector<int> reads, writes; ///< indices of BufferRow
    std::array<std::uint32_t, 3> groups{1, 1, 1};
    std::vector<std::pair<int, int>> constants; ///< specialization: id, value
};

/// Errors of the table, as sentences: unknown indices, reads before any write, empty dispatches, an output
/// never written. Empty = sound. Needs no GPU.
[[nodiscard]] std::vector<std::string> problems(std::span<const BufferRow> buffers, std::span<const PassRow> passes);

/// A table of passes, ready to run on one device. A memory barrier precedes each pass that depends on an earlier one
/// (reads or overwrites its output, or overwrites its input), and no other.
class Program {
  public:
    /// `constants_bytes` is the size of the uniform block every pass sees. Throws Error listing problems() or naming
    /// the shader whose pipeline could not be made. Stamps::total times all passes together, as "passes": stamping each
    /// costs a GPU some microseconds.
    enum class Stamps { passes, total };
    Program(Device& device, std::vector<BufferRow> buffers, std::vector<PassRow> passes, std::size_t constants_bytes,
            Stamps stamps = Stamps::passes);
    ~Program();
    Program(const Program&) = delete;
    Program& operator=(const Program&) = delete;

    /// The host's side of an upload or download buffer.
    [[nodiscard]] std::span<std::byte> host(int buffer);
    template <class T>
    [[nodiscard]] std::span<T> host_as(int buffer) {
        const auto bytes = host(buffer);
        return {reinterpret_cast<T*>(bytes.data()), bytes.size() / sizeof(T)};
    }

    /// Copies on the device, as part of the next run and of no other: `from` into a `taken` buffer from byte `offset`
    /// on, or into an upload buffer instead of what the host has written there, before the passes; a buffer's first
    /// bytes into `to`, after them.
    void take(int buffer, std::size_t offset, std::shared_ptr<const DeviceBytes> from);
    void give(int buffer, std::shared_ptr<DeviceBytes> to);

    /// Fills a `streamed` buffer before a run, part by part: `fill(first, to)` writes the items from number `first` on,
    /// while the part before is copied.
    void stream_in(int buffer, std::size_t item_bytes,
                   const std::function<void(std::size_t first, std::span<std::byte> to)>& fill);
    /// Reads a `streamed` buffer after a run, likewise.
    void stream_out(int buffer, std::size_t item_bytes,
                    const std::function<void(std::size_t first, std::span<const std::byte> from)>& visit);

    /// Uploads, runs all passes, downloads unless the results stay on the device; returns when all is done. Throws
    /// Error on device loss.
    enum class Results { on_host, on_device };
    void run(std::span<const std::byte> constants, Results results = Results::on_host);

    /// Device milliseconds of the last run: "upload", each pass by name, "download".
    [[nodiscard]] const std::vector<std::pair<std::string, double>>& timings() const { return timings_; }

    /// Copies any buffer or image to the host. Slow: for inspecting intermediates.
    [[nodiscard]] std::vector<std::byte> read_back(int buffer);

  private:
    struct State;
    std::unique_ptr<State> state_;
    std::vector<std::pair<std::string, double>> timings_;
};

} // namespace scanshade::gpu
