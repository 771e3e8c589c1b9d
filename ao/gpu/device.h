// A Vulkan compute device: instance, device, queue, buffers, validation messages.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace scanshade::gpu {

/// One Vulkan device, as `scanshade devices` prints it.
struct DeviceInfo {
    int index = 0;                       ///< in the order the Vulkan loader lists them
    std::string name;                    ///< "llvmpipe (LLVM 15.0.6, 256 bits)"
    std::string kind;                    ///< "discrete GPU", "integrated GPU", "virtual GPU", "CPU", "other"
    std::string driver;                  ///< driver name and version text
    std::string api;                     ///< "1.3.230"
    int most_threads = 0;                ///< of a work group
    std::uint64_t most_buffer_bytes = 0; ///< that a shader may reach of a buffer
    std::uint64_t memory_bytes = 0;      ///< of its largest heap of its own
    std::string unusable;                ///< what is missing; empty = usable
};

/// Whether the device is software on the processor.
[[nodiscard]] inline bool is_cpu(const DeviceInfo& info) { return info.kind == "CPU"; }

/// Whether the machine may have a GPU: its kernel offers one, or the environment names Vulkan drivers. Asks no driver,
/// since loading a software one takes a tenth of a second and 50 MiB.
[[nodiscard]] bool may_have_gpu();

/// Every device the loader knows, usable or not. Empty without a driver; throws Error only when there is no Vulkan
/// loader.
[[nodiscard]] std::vector<DeviceInfo> list_devices();

/// One opened device. Owns the Vulkan objects; programs made from it must not outlive it. Several threads may make
/// and run their own programs on it.
class Device {
  public:
    /// `choice`: empty = discrete GPU, else integrated, else any usable (lavapipe); an index; or part of a name,
    /// case-insensitive. Throws Error that lists the devices when none matches.
    explicit Device(const std::string& choice = {});
    ~Device();
    Device(const Device&) = delete;
    Device& operator=(const Device&) = delete;

    [[nodiscard]] const DeviceInfo& info() const;
    /// Messages of the validation layer so far (it is on when SCANSHADE_VALIDATE=1 and installed): errors and warnings.
    [[nodiscard]] std::vector<std::string> validation_messages() const;
    /// Whether the validation layer (with synchronization validation) is really active.
    [[nodiscard]] bool validating() const;

    /// Keeps up to `bytes` of the memory that programs give back, for the next ones. To begin with that is a sixteenth
    /// of a GPU's, 512 MiB at most, and nothing on a processor, whose memory is quickly made.
    void keep_memory(std::size_t bytes);
    [[nodiscard]] std::size_t kept_memory() const; ///< bytes that lie idle now

    struct State;
    [[nodiscard]] State& state() const { return *state_; }

  private:
    std::unique_ptr<State> state_;
};

/// The device that `choice` names, as Device takes it. "all": the fastest GPU and every other of the same name and
/// driver, so that it makes no difference which of them computes a frame; a software device only where there is no GPU.
[[nodiscard]] std::vector<std::unique_ptr<Device>> open_devices(const std::string& choice);

} // namespace scanshade::gpu
