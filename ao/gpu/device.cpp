#include "ao/gpu/device.h"

#include "ao/gpu/vulkan.h"
#include "projection/base/error.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fmt/format.h>

namespace scanshade::gpu {
namespace {

constexpr const char* validation_layer = "VK_LAYER_KHRONOS_validation";
constexpr const char* push_descriptors = VK_KHR_PUSH_DESCRIPTOR_EXTENSION_NAME;
constexpr const char* no_driver = "no Vulkan driver is installed (Debian: mesa-vulkan-drivers brings a software one)";

bool wants_validation() {
    const char* value = std::getenv("SCANSHADE_VALIDATE");
    return value && std::strcmp(value, "0") != 0 && *value != 0;
}

VKAPI_ATTR VkBool32 VKAPI_CALL keep_message(VkDebugUtilsMessageSeverityFlagBitsEXT, VkDebugUtilsMessageTypeFlagsEXT,
                                            const VkDebugUtilsMessengerCallbackDataEXT* data, void* user) {
    auto* messages = static_cast<Messages*>(user);
    const std::lock_guard lock(messages->mutex);
    messages->texts.emplace_back(data->pMessage);
    return VK_FALSE;
}

vk::DebugUtilsMessengerCreateInfoEXT messenger_info(Messages* messages) {
    VkDebugUtilsMessengerCreateInfoEXT info{}; // its C++ counterpart takes callbacks of another type since Vulkan 1.4
    info.sType = VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CREATE_INFO_EXT;
    info.messageSeverity =
        VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT | VK_DEBUG_UTILS_MESSAGE_SEVERITY_WARNING_BIT_EXT;
    info.messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT | VK_DEBUG_UTILS_MESSAGE_TYPE_PERFORMANCE_BIT_EXT;
    info.pfnUserCallback = keep_message;
    info.pUserData = messages;
    return info;
}

/// The instance, with validation and synchronization validation where SCANSHADE_VALIDATE asks and the layer is
/// installed.
void make_instance(Device::State& state) {
    const vk::ApplicationInfo application("scanshade", 1, "scanshade", 1, VK_API_VERSION_1_3);
    vk::InstanceCreateInfo info({}, &application);
    const auto layers = state.context.enumerateInstanceLayerProperties();
    const bool installed = std::any_of(layers.begin(), layers.end(), [](const vk::LayerProperties& layer) {
        return std::strcmp(layer.layerName, validation_layer) == 0;
    });
    const vk::ValidationFeatureEnableEXT wanted = vk::ValidationFeatureEnableEXT::eSynchronizationValidation;
    vk::ValidationFeaturesEXT features(wanted);
    const char* extension = VK_EXT_DEBUG_UTILS_EXTENSION_NAME;
    state.validating = installed && wants_validation();
    if (state.validating) {
        info.setPEnabledLayerNames(validation_layer).setPEnabledExtensionNames(extension).setPNext(&features);
    }
    try {
        state.instance = vk::raii::Instance(state.context, info);
    } catch (const vk::IncompatibleDriverError&) { // what the loader says when it finds none
        throw Error(no_driver);
    }
    if (state.validating)
        state.messenger = vk::raii::DebugUtilsMessengerEXT(state.instance, messenger_info(state.messages.get()));
}

std::string kind_name(vk::PhysicalDeviceType type) {
    switch (type) {
    case vk::PhysicalDeviceType::eDiscreteGpu:
        return "discrete GPU";
    case vk::PhysicalDeviceType::eIntegratedGpu:
        return "integrated GPU";
    case vk::PhysicalDeviceType::eVirtualGpu:
        return "virtual GPU";
    case vk::PhysicalDeviceType::eCpu:
        return "CPU";
    default:
        return "other";
    }
}

int compute_family(const vk::raii::PhysicalDevice& physical) {
    const auto families = physical.getQueueFamilyProperties();
    for (std::size_t i = 0; i < families.size(); ++i)
        if (families[i].queueFlags & vk::QueueFlagBits::eCompute)
            return static_cast<int>(i);
    return -1;
}

/// The features that shaders and the pass runner require.
std::string what_is_missing(const vk::raii::PhysicalDevice& physical) {
    if (physical.getProperties().apiVersion < VK_API_VERSION_1_3)
        return "Vulkan 1.3";
    if (compute_family(physical) < 0)
        return "a compute queue";
    const auto extensions = physical.enumerateDeviceExtensionProperties();
    if (std::none_of(extensions.begin(), extensions.end(),
                     [](const auto& e) { return std::strcmp(e.extensionName, push_descriptors) == 0; }))
        return push_descriptors;
    const auto features = physical.getFeatures2<vk::PhysicalDeviceFeatures2, vk::PhysicalDeviceVulkan12Features,
                                                vk::PhysicalDeviceVulkan13Features>();
    if (!features.get<vk::PhysicalDeviceVulkan12Features>().scalarBlockLayout)
        return "scalarBlockLayout";
    if (!features.get<vk::PhysicalDeviceVulkan13Features>().synchronization2)
        return "synchronization2";
    if (!features.get<vk::PhysicalDeviceVulkan13Features>().maintenance4)
        return "maintenance4";
    return {};
}

DeviceInfo info_of(const vk::raii::PhysicalDevice& physical, int index) {
    const auto chain = physical.getProperties2<vk::PhysicalDeviceProperties2, vk::PhysicalDeviceDriverProperties>();
    const auto& properties = chain.get<vk::PhysicalDeviceProperties2>().properties;
    const auto& driver = chain.get<vk::PhysicalDeviceDriverProperties>();
    const std::uint32_t api = properties.apiVersion;
    DeviceInfo info;
    info.index = index;
    info.name = properties.deviceName.data();
    info.kind = kind_name(properties.deviceType);
    info.most_threads = static_cast<int>(properties.limits.maxComputeWorkGroupInvocations);
    info.most_buffer_bytes = properties.limits.maxStorageBufferRange;
    for (const vk::MemoryHeap& heap : physical.getMemoryProperties().memoryHeaps)
        if (heap.flags & vk::MemoryHeapFlagBits::eDeviceLocal)
            info.memory_bytes = std::max(info.memory_bytes, std::uint64_t(heap.size));
    info.driver = fmt::format("{} {}", driver.driverName.data(), driver.driverInfo.data());
    info.api = fmt::format("{}.{}.{}", VK_API_VERSION_MAJOR(api), VK_API_VERSION_MINOR(api), VK_API_VERSION_PATCH(api));
    info.unusable = what_is_missing(physical);
    return info;
}

std::string lower(std::string text) {
    std::transform(text.begin(), text.end(), text.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return text;
}

int rank(const DeviceInfo& info) {
    if (info.kind == "discrete GPU")
        return 0;
    if (info.kind == "integrated GPU")
        return 1;
    return info.kind == "virtual GPU" ? 2 : 3;
}

const DeviceInfo* chosen(const std::vector<DeviceInfo>& all, const std::string& choice) {
    const DeviceInfo* best = nullptr;
    int index = -1;
    const auto [end, code] = std::from_chars(choice.data(), choice.data() + choice.size(), index);
    const bool by_index = code == std::errc() && end == choice.data() + choice.size();
    for (const DeviceInfo& info : all) {
        if (by_index ? info.index != index : lower(info.name).find(lower(choice)) == std::string::npos)
            continue;
        if (!info.unusable.empty())
            continue;
        if (!best || rank(info) < rank(*best))
            best = &info;
    }
    return best;
}

std::string listing(const std::vector<DeviceInfo>& all) {
    if (all.empty())
        return no_driver;
    std::string text = "there are:";
    for (const DeviceInfo& info : all)
        text += fmt::format(" {} {} ({}){};", info.index, info.name, info.kind,
                            info.unusable.empty() ? "" : ", unusable, lacks " + info.unusable);
    text.pop_back();
    return text;
}

void open_device(Device::State& state) {
    state.queue_family = static_cast<std::uint32_t>(compute_family(state.physical));
    const auto family = state.physical.getQueueFamilyProperties()[state.queue_family];
    constexpr float priority = 1;
    const vk::DeviceQueueCreateInfo queue({}, state.queue_family, 1, &priority);
    vk::PhysicalDeviceVulkan13Features features13;
    features13.synchronization2 = features13.maintenance4 = VK_TRUE;
    vk::PhysicalDeviceVulkan12Features features12;
    features12.scalarBlockLayout = VK_TRUE;
    features12.pNext = &features13;
    const vk::DeviceCreateInfo info({}, queue, {}, push_descriptors, nullptr, &features12);
    state.device = vk::raii::Device(state.physical, info);
    state.queue = state.device.getQueue(state.queue_family, 0);
    state.memory = state.physical.getMemoryProperties();
    state.nanoseconds_per_tick = state.physical.getProperties().limits.timestampPeriod;
    state.has_timestamps = family.timestampValidBits > 0;
}

} // namespace

vk::raii::Context loader() {
    try {
        return {};
    } catch (const std::runtime_error&) {
        throw Error("Vulkan: its loader is not installed (Debian: libvulkan1, and mesa-vulkan-drivers for a software "
                    "driver)");
    }
}

int Device::State::memory_type(std::uint32_t allowed, vk::MemoryPropertyFlags wanted) const {
    for (std::uint32_t i = 0; i < memory.memoryTypeCount; ++i)
        if ((allowed >> i & 1u) && (memory.memoryTypes[i].propertyFlags & wanted) == wanted)
            return static_cast<int>(i);
    return -1;
}

bool may_have_gpu() {
    namespace fs = std::filesystem;
    for (const char* chosen : {"VK_DRIVER_FILES", "VK_ICD_FILENAMES", "VK_ADD_DRIVER_FILES", "SCANSHADE_VALIDATE"})
        if (std::getenv(chosen))
            return true;
    std::error_code unreadable;
    for (const fs::path folder : {"/dev", "/dev/dri"})
        for (auto each = fs::directory_iterator(folder, unreadable); !unreadable && each != fs::directory_iterator();
             each.increment(unreadable))
            for (const char* driver : {"renderD", "nvidia", "dxg", "kgsl", "mali", "kfd", "pvr"})
                if (each->path().filename().string().starts_with(driver))
                    return true;
    return false;
}

std::vector<DeviceInfo> list_devices() {
    return asking_vulkan("Vulkan", [] {
        Device::State state;
        make_instance(state);
        std::vector<DeviceInfo> all;
        for (const auto& physical : state.instance.enumeratePhysicalDevices())
            all.push_back(info_of(physical, static_cast<int>(all.size())));
        return all;
    });
}

Device::Device(const std::string& choice) : state_(std::make_unique<State>()) {
    asking_vulkan("Vulkan", [&] {
        make_instance(*state_);
        const auto physicals = state_->instance.enumeratePhysicalDevices();
        std::vector<DeviceInfo> all;
        for (const auto& physical : physicals)
            all.push_back(info_of(physical, static_cast<int>(all.size())));
        const DeviceInfo* best = chosen(all, choice);
        if (!best)
            throw Error(choice.empty() ? "no usable device; " + listing(all)
                                       : fmt::format("no usable device matches '{}'; {}", choice, listing(all)));
        state_->info = *best;
        state_->physical = physicals[static_cast<std::size_t>(best->index)];
        open_device(*state_);
        if (!is_cpu(*best))
            keep_memory(std::min<std::size_t>(std::size_t(1) << 29, best->memory_bytes / 16));
    });
}

Device::~Device() = default;

std::vector<std::unique_ptr<Device>> open_devices(const std::string& choice) {
    std::vector<std::unique_ptr<Device>> opened;
    opened.push_back(std::make_unique<Device>(choice == "all" ? std::string() : choice));
    const DeviceInfo first = opened.front()->info();
    if (choice != "all" || is_cpu(first))
        return opened;
    for (const DeviceInfo& info : list_devices())
        if (info.unusable.empty() && info.index != first.index && info.name == first.name &&
            info.driver == first.driver)
            opened.push_back(std::make_unique<Device>(std::to_string(info.index)));
    return opened;
}

const DeviceInfo& Device::info() const { return state_->info; }
void Device::keep_memory(std::size_t bytes) { state_->memory_pool->keep(bytes); }
std::size_t Device::kept_memory() const { return state_->memory_pool->kept(); }
bool Device::validating() const { return state_->validating; }

std::vector<std::string> Device::validation_messages() const {
    const std::lock_guard lock(state_->messages->mutex);
    return state_->messages->texts;
}

} // namespace scanshade::gpu
