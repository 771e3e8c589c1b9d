#include "ao/gpu/program.h"

#include "ao/gpu/bound_buffer.h"
#include "ao/gpu/commands.h"
#include "ao/gpu/part_stream.h"
#include "ao/gpu/vulkan.h"
#include "projection/base/error.h"

#include <algorithm>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <functional>
#include <optional>
#include <utility>

namespace scanshade::gpu {
namespace {

constexpr std::uint32_t first_write_binding = 16, constants_binding = 32;

using Memory = vk::MemoryPropertyFlagBits;

/// An image of float layers: a view of everything to sample from, and one of each mip to write to.
struct BoundImage {
    PooledMemory memory;
    vk::raii::Image image = nullptr;
    vk::raii::ImageView sampled = nullptr;
    std::vector<vk::raii::ImageView> mips;

    BoundImage() = default;
    BoundImage(const Device::State& gpu, const BufferRow::Image& row) {
        using Usage = vk::ImageUsageFlagBits;
        constexpr auto format = vk::Format::eR32Sfloat;
        image = gpu.device.createImage({{},
                                        vk::ImageType::e2D,
                                        format,
                                        {row.width, row.height, 1},
                                        row.mips,
                                        row.layers,
                                        vk::SampleCountFlagBits::e1,
                                        vk::ImageTiling::eOptimal,
                                        Usage::eSampled | Usage::eStorage | Usage::eTransferSrc | Usage::eTransferDst});
        const auto needs = image.getMemoryRequirements();
        const int type = gpu.memory_type(needs.memoryTypeBits, Memory::eDeviceLocal);
        if (type < 0)
            throw Error("the device has no suitable memory");
        memory = PooledMemory(gpu, needs, static_cast<std::uint32_t>(type));
        image.bindMemory(*memory, 0);
        const auto view = [&](std::uint32_t first, std::uint32_t count) {
            return gpu.device.createImageView({{},
                                               *image,
                                               vk::ImageViewType::e2DArray,
                                               format,
                                               {},
                                               {vk::ImageAspectFlagBits::eColor, first, count, 0, row.layers}});
        };
        sampled = view(0, row.mips);
        for (std::uint32_t m = 0; m < row.mips; ++m)
            mips.push_back(view(m, 1));
    }
};

/// Nearest texel of the nearest mip, 0 outside.
vk::raii::Sampler make_sampler(const Device::State& gpu) {
    constexpr auto nearest = vk::Filter::eNearest;
    constexpr auto border = vk::SamplerAddressMode::eClampToBorder;
    return gpu.device.createSampler({{},
                                     nearest,
                                     nearest,
                                     vk::SamplerMipmapMode::eNearest,
                                     border,
                                     border,
                                     border,
                                     0,
                                     VK_FALSE,
                                     0,
                                     VK_FALSE,
                                     vk::CompareOp::eNever,
                                     0,
                                     VK_LOD_CLAMP_NONE,
                                     vk::BorderColor::eFloatTransparentBlack});
}

vk::Format format_of(BufferRow::Texels texels) {
    switch (texels) {
    case BufferRow::Texels::r32f:
        return vk::Format::eR32Sfloat;
    case BufferRow::Texels::rg32f:
        return vk::Format::eR32G32Sfloat;
    case BufferRow::Texels::rg32ui:
        return vk::Format::eR32G32Uint;
    case BufferRow::Texels::rgba32f:
        return vk::Format::eR32G32B32A32Sfloat;
    default:
        return vk::Format::eR32Uint;
    }
}

/// Which buffers were touched since the last barrier, to place barriers only where one is needed.
struct Hazards {
    std::vector<char> read, written;

    explicit Hazards(std::size_t buffers) : read(buffers), written(buffers) {}
    [[nodiscard]] bool conflict(const std::vector<int>& reads, const std::vector<int>& writes) const {
        return std::any_of(reads.begin(), reads.end(), [&](int i) { return written[i]; }) ||
               std::any_of(writes.begin(), writes.end(), [&](int i) { return written[i] || read[i]; });
    }
    void clear() {
        std::fill(read.begin(), read.end(), char(0));
        std::fill(written.begin(), written.end(), char(0));
    }
    void note(const std::vector<int>& reads, const std::vector<int>& writes) {
        for (int i : reads)
            read[i] = 1;
        for (int i : writes)
            written[i] = 1;
    }
};

} // namespace

std::size_t image_bytes(const BufferRow::Image& image) {
    std::size_t texels = 0;
    for (std::uint32_t m = 0; m < image.mips; ++m)
        texels += std::size_t(std::max(1U, image.width >> m)) * std::max(1U, image.height >> m);
    return texels * image.layers * 4;
}

std::vector<std::string> problems(std::span<const BufferRow> buffers, std::span<const PassRow> passes) {
    std::vector<std::string> found;
    std::vector<char> written(buffers.size());
    for (std::size_t i = 0; i < buffers.size(); ++i) {
        written[i] = buffers[i].host == BufferRow::Host::upload || buffers[i].host == BufferRow::Host::taken ||
                     buffers[i].host == BufferRow::Host::streamed || !buffers[i].initial.empty();
        if (buffers[i].bytes == 0)
            found.push_back(fmt::format("buffer {} is empty", buffers[i].name));
        if (buffers[i].image.width > 0 && buffers[i].bytes != image_bytes(buffers[i].image))
            found.push_back(fmt::format("image {} has {} bytes, not {}", buffers[i].name, image_bytes(buffers[i].image),
                                        buffers[i].bytes));
    }
    for (const PassRow& pass : passes) {
        if (std::find(pass.groups.begin(), pass.groups.end(), 0u) != pass.groups.end())
            found.push_back(fmt::format("pass {} dispatches no work group", pass.name));
        for (const auto* side : {&pass.reads, &pass.writes})
            for (int i : *side)
                if (i < 0 || i >= static_cast<int>(buffers.size()))
                    found.push_back(fmt::format("pass {} names buffer {} of {}", pass.name, i, buffers.size()));
        if (!found.empty())
            return found;
        for (int i : pass.reads)
            if (!written[i])
                found.push_back(fmt::format("pass {} reads {} before anything wrote it", pass.name, buffers[i].name));
        for (int i : pass.writes)
            written[i] = 1;
    }
    for (std::size_t i = 0; i < buffers.size(); ++i)
        if (buffers[i].host == BufferRow::Host::download && !written[i])
            found.push_back(fmt::format("output {} is never written", buffers[i].name));
    return found;
}

struct Program::State {
    Device::State& gpu;
    vk::raii::CommandPool pool; // of its own: pools, like programs, are one thread's at a time
    std::vector<BufferRow> rows;
    std::vector<PassRow> passes;
    std::vector<BoundBuffer> buffers;
    std::vector<BoundImage> images; // per row; empty where it is a buffer
    vk::raii::Sampler sampler = nullptr;
    std::vector<BoundBuffer> staging; // per row; empty where the host reaches the buffer itself
    BoundBuffer constants;
    std::vector<const Pipeline*> pipelines; // per pass; null where it fills buffers
    Stamps stamps = Stamps::passes;
    std::vector<std::string> intervals; // names of the intervals between time stamps
    vk::raii::QueryPool queries = nullptr;
    vk::raii::Fence fence = nullptr;
    // A run submits them in this order: begin, taken, uploads, commands, download, given, end.
    vk::raii::CommandBuffer begin = nullptr, taking = nullptr, commands = nullptr, download = nullptr,
                            download_always = nullptr, giving = nullptr, end = nullptr;
    std::vector<vk::raii::CommandBuffer> uploads; // per row; null where there is nothing to upload
    struct Copy {
        int buffer;
        std::size_t offset;
        std::shared_ptr<const DeviceBytes> bytes; // held until they are copied
    };
    std::vector<Copy> taken, given;

    std::optional<PartStream> parts; // of streamed buffers

    State(Device::State& gpu_, std::vector<BufferRow> rows_, std::vector<PassRow> passes_)
        : gpu(gpu_),
          pool(gpu.device.createCommandPool({vk::CommandPoolCreateFlagBits::eResetCommandBuffer, gpu.queue_family})),
          rows(std::move(rows_)), passes(std::move(passes_)) {}

    void make_buffers(std::size_t constants_bytes) {
        using Usage = vk::BufferUsageFlagBits;
        staging.resize(rows.size());
        images.resize(rows.size());
        sampler = make_sampler(gpu);
        for (std::size_t i = 0; i < rows.size(); ++i) {
            const BufferRow& row = rows[i];
            if (row.image.width > 0) {
                images[i] = asking_vulkan(fmt::format("image {} of {} bytes", row.name, row.bytes),
                                          [&] { return BoundImage(gpu, row.image); });
                buffers.emplace_back();
                continue;
            }
            auto usage = Usage::eStorageBuffer | Usage::eTransferSrc | Usage::eTransferDst;
            if (row.texels != BufferRow::Texels::none)
                usage |= Usage::eStorageTexelBuffer;
            buffers.push_back(asking_vulkan(fmt::format("buffer {} of {} bytes", row.name, row.bytes), [&] {
                return BoundBuffer(gpu, row.bytes, usage, {shared_memory, Memory::eDeviceLocal});
            }));
            if (row.texels != BufferRow::Texels::none) {
                buffers.back().view =
                    gpu.device.createBufferView({{}, *buffers.back().buffer, format_of(row.texels), 0, VK_WHOLE_SIZE});
            }
            if ((row.host != BufferRow::Host::upload && row.host != BufferRow::Host::download) || buffers.back().mapped)
                continue;
            const vk::MemoryPropertyFlags visible = Memory::eHostVisible | Memory::eHostCoherent;
            const bool upload = row.host == BufferRow::Host::upload;
            staging[i] =
                upload ? BoundBuffer(gpu, row.bytes, Usage::eTransferSrc, {visible})
                       : BoundBuffer(gpu, row.bytes, Usage::eTransferDst, {visible | Memory::eHostCached, visible});
        }
        constants = BoundBuffer(gpu, std::max<std::size_t>(constants_bytes, 4), Usage::eUniformBuffer,
                                {Memory::eHostVisible | Memory::eHostCoherent});
    }

    [[nodiscard]] bool is_image(int row) const { return rows[row].image.width > 0; }

    [[nodiscard]] vk::DescriptorType type_of(int buffer, bool written) const {
        if (is_image(buffer))
            return written ? vk::DescriptorType::eStorageImage : vk::DescriptorType::eCombinedImageSampler;
        const bool plain = rows[buffer].texels == BufferRow::Texels::none || (written && rows[buffer].plain_writes);
        return plain ? vk::DescriptorType::eStorageBuffer : vk::DescriptorType::eStorageTexelBuffer;
    }

    /// Null where the pass fills buffers.
    const Pipeline* pipeline_of(const PassRow& pass) {
        if (pass.shader.empty())
            return nullptr;
        Pipelines::Key key{std::string(pass.shader), {}, pass.constants};
        for (std::size_t i = 0; i < pass.reads.size(); ++i)
            key.bindings.push_back({static_cast<std::uint32_t>(i), type_of(pass.reads[i], false)});
        for (std::size_t i = 0; i < pass.writes.size(); ++i)
            key.bindings.push_back({first_write_binding + static_cast<std::uint32_t>(i), type_of(pass.writes[i], true),
                                    is_image(pass.writes[i]) ? rows[pass.writes[i]].image.mips : 1});
        key.bindings.push_back({constants_binding, vk::DescriptorType::eUniformBuffer});
        return &gpu.pipelines.of(gpu.device, key);
    }

    void push_descriptors(const PassRow& pass, const Pipeline& pipeline) {
        std::vector<vk::DescriptorBufferInfo> infos;
        infos.reserve(pass.reads.size() + pass.writes.size() + 1);
        std::vector<std::vector<vk::DescriptorImageInfo>> image_infos;
        image_infos.reserve(pass.reads.size() + pass.writes.size());
        std::vector<vk::WriteDescriptorSet> writes;
        const auto add_buffer = [&](std::uint32_t binding, const BoundBuffer& buffer, vk::DescriptorType type) {
            infos.emplace_back(*buffer.buffer, 0, VK_WHOLE_SIZE);
            writes.emplace_back(nullptr, binding, 0, 1, type, nullptr, &infos.back(), &*buffer.view);
        };
        const auto add = [&](std::uint32_t binding, int row, bool written) {
            const vk::DescriptorType type = type_of(row, written);
            if (!is_image(row))
                return add_buffer(binding, buffers[row], type);
            auto& views = image_infos.emplace_back();
            if (!written)
                views.emplace_back(*sampler, *images[row].sampled, vk::ImageLayout::eGeneral);
            else
                for (const auto& mip : images[row].mips)
                    views.emplace_back(nullptr, *mip, vk::ImageLayout::eGeneral);
            writes.emplace_back(vk::WriteDescriptorSet(nullptr, binding, 0, type, views));
        };
        std::uint32_t binding = 0;
        for (int i : pass.reads)
            add(binding++, i, false);
        binding = first_write_binding;
        for (int i : pass.writes)
            add(binding++, i, true);
        add_buffer(constants_binding, constants, vk::DescriptorType::eUniformBuffer);
        commands.pushDescriptorSetKHR(vk::PipelineBindPoint::eCompute, *pipeline.layout, 0, writes);
    }

    void stamp(const vk::raii::CommandBuffer& into, std::uint32_t query) {
        if (gpu.has_timestamps)
            into.writeTimestamp2(Stage::eAllCommands, *queries, query);
    }

    vk::raii::CommandBuffer new_commands() {
        return std::move(gpu.device.allocateCommandBuffers({*pool, vk::CommandBufferLevel::ePrimary, 1}).front());
    }

    void record_upload(std::size_t row) {
        uploads[row] = new_commands();
        uploads[row].begin(vk::CommandBufferBeginInfo{});
        uploads[row].copyBuffer(*staging[row].buffer, *buffers[row].buffer, vk::BufferCopy(0, 0, rows[row].bytes));
        uploads[row].end();
    }

    /// All that is downloaded, or only what always is.
    vk::raii::CommandBuffer recorded_download(bool all) {
        vk::raii::CommandBuffer recorded = new_commands();
        recorded.begin(vk::CommandBufferBeginInfo{});
        compute_barrier(recorded);
        for (std::size_t i = 0; i < rows.size(); ++i)
            if (rows[i].host == BufferRow::Host::download && staging[i].bytes > 0 && (all || rows[i].always_downloaded))
                recorded.copyBuffer(*buffers[i].buffer, *staging[i].buffer, vk::BufferCopy(0, 0, rows[i].bytes));
        recorded.end();
        return recorded;
    }

    /// The command buffers are the same every frame, so they are recorded once.
    void record() {
        intervals = {"upload"};
        if (stamps == Stamps::total)
            intervals.emplace_back("passes");
        else
            for (const PassRow& pass : passes)
                intervals.push_back(pass.name);
        intervals.emplace_back("download");
        const auto count = static_cast<std::uint32_t>(intervals.size() + 1);
        queries = gpu.device.createQueryPool({{}, vk::QueryType::eTimestamp, count});
        fence = gpu.device.createFence({});
        uploads.reserve(rows.size());
        for (std::size_t i = 0; i < rows.size(); ++i) {
            uploads.emplace_back(nullptr);
            if (rows[i].host == BufferRow::Host::upload && staging[i].bytes > 0)
                record_upload(i);
        }
        download = recorded_download(true);
        download_always = recorded_download(false);
        std::uint32_t query = 0;
        begin = new_commands();
        begin.begin(vk::CommandBufferBeginInfo{});
        if (gpu.has_timestamps)
            begin.resetQueryPool(*queries, 0, count);
        stamp(begin, query++);
        begin.end();
        commands = new_commands();
        commands.begin(vk::CommandBufferBeginInfo{});
        compute_barrier(commands);
        stamp(commands, query++);
        Hazards hazards(rows.size());
        for (std::size_t i = 0; i < passes.size(); ++i) {
            const PassRow& pass = passes[i];
            if (hazards.conflict(pass.reads, pass.writes)) {
                compute_barrier(commands);
                hazards.clear();
            }
            hazards.note(pass.reads, pass.writes);
            if (pass.shader.empty()) {
                for (int w : pass.writes)
                    commands.fillBuffer(*buffers[w].buffer, 0, VK_WHOLE_SIZE, 0);
            } else {
                commands.bindPipeline(vk::PipelineBindPoint::eCompute, *pipelines[i]->pipeline);
                push_descriptors(pass, *pipelines[i]);
                commands.dispatch(pass.groups[0], pass.groups[1], pass.groups[2]);
            }
            if (stamps == Stamps::passes)
                stamp(commands, query++);
        }
        if (stamps == Stamps::total)
            stamp(commands, query++);
        commands.end();
        end = new_commands();
        end.begin(vk::CommandBufferBeginInfo{});
        host_barrier(end);
        stamp(end, query++);
        end.end();
    }

    /// Images stay in the general layout from here on.
    static void clear(const vk::raii::CommandBuffer& once, vk::Image image) {
        const vk::ImageSubresourceRange whole(vk::ImageAspectFlagBits::eColor, 0, VK_REMAINING_MIP_LEVELS, 0,
                                              VK_REMAINING_ARRAY_LAYERS);
        const vk::ImageMemoryBarrier2 general({}, {}, Stage::eTransfer, Access::eTransferWrite,
                                              vk::ImageLayout::eUndefined, vk::ImageLayout::eGeneral,
                                              VK_QUEUE_FAMILY_IGNORED, VK_QUEUE_FAMILY_IGNORED, image, whole);
        once.pipelineBarrier2(vk::DependencyInfo({}, {}, {}, general));
        once.clearColorImage(image, vk::ImageLayout::eGeneral, vk::ClearColorValue(0.0F, 0.0F, 0.0F, 0.0F), whole);
    }

    void copy_out(const vk::raii::CommandBuffer& commands_, int row, vk::Buffer to) {
        if (!is_image(row))
            return commands_.copyBuffer(*buffers[row].buffer, to, vk::BufferCopy(0, 0, rows[row].bytes));
        const BufferRow::Image& image = rows[row].image;
        std::vector<vk::BufferImageCopy> copies;
        std::size_t offset = 0;
        for (std::uint32_t m = 0; m < image.mips; ++m) {
            const std::uint32_t width = std::max(1U, image.width >> m), height = std::max(1U, image.height >> m);
            copies.emplace_back(offset, 0, 0,
                                vk::ImageSubresourceLayers(vk::ImageAspectFlagBits::eColor, m, 0, image.layers),
                                vk::Offset3D(), vk::Extent3D(width, height, 1));
            offset += std::size_t(width) * height * image.layers * 4;
        }
        commands_.copyImageToBuffer(*images[row].image, vk::ImageLayout::eGeneral, to, copies);
    }

    void fill_buffers() {
        const auto once = new_commands();
        once.begin({vk::CommandBufferUsageFlagBits::eOneTimeSubmit});
        for (std::size_t i = 0; i < rows.size(); ++i) {
            if (is_image(static_cast<int>(i)))
                clear(once, *images[i].image);
            else if (rows[i].initial.empty())
                once.fillBuffer(*buffers[i].buffer, 0, VK_WHOLE_SIZE, 0);
            else
                once.updateBuffer<float>(*buffers[i].buffer, 0, rows[i].initial);
        }
        compute_barrier(once);
        once.end();
        submit({*once});
    }

    /// Copies taken before a run or given after it; null for none.
    vk::CommandBuffer record_copies(vk::raii::CommandBuffer& into, std::vector<Copy>& copies, bool in) {
        if (copies.empty())
            return nullptr;
        if (!*into)
            into = new_commands();
        into.begin({vk::CommandBufferUsageFlagBits::eOneTimeSubmit});
        compute_barrier(into);
        for (const auto& [buffer, offset, bytes] : copies) {
            const vk::Buffer own = *buffers[buffer].buffer, other = *bytes->state().buffer.buffer;
            into.copyBuffer(in ? other : own, in ? own : other,
                            vk::BufferCopy(in ? 0 : offset, in ? offset : 0, bytes->size()));
        }
        compute_barrier(into);
        into.end();
        return *into;
    }

    /// Everything of one run.
    std::vector<vk::CommandBuffer> all_commands(Results results) {
        std::vector<vk::CommandBuffer> all{*begin, record_copies(taking, taken, true)};
        for (std::size_t i = 0; i < rows.size(); ++i)
            if (std::ranges::none_of(taken, [&](const Copy& copy) { return copy.buffer == static_cast<int>(i); }))
                all.push_back(*uploads[i]);
        all.push_back(*commands);
        all.push_back(results == Results::on_host ? *download : *download_always);
        all.insert(all.end(), {record_copies(giving, given, false), *end});
        return all;
    }

    void submit(const std::vector<vk::CommandBuffer>& recorded) {
        begin_submit(gpu, recorded, fence);
        wait_for(gpu, fence);
    }

    void stream(int buffer, std::size_t item_bytes, PartStream::Way way, const PartStream::Visit& visit) {
        if (!parts)
            parts.emplace(gpu, pool);
        asking_vulkan(gpu.info.name, [&] { parts->run(buffers.at(buffer), item_bytes, way, visit); });
    }
};

Program::Program(Device& device, std::vector<BufferRow> buffers, std::vector<PassRow> passes,
                 std::size_t constants_bytes, Stamps stamps) {
    const auto wrong = problems(buffers, passes);
    if (!wrong.empty())
        throw Error(fmt::format("pass table: {}", fmt::join(wrong, "; ")));
    asking_vulkan([&] {
        state_ = std::make_unique<State>(device.state(), std::move(buffers), std::move(passes));
        state_->stamps = stamps;
        state_->make_buffers(constants_bytes);
        for (const PassRow& pass : state_->passes)
            state_->pipelines.push_back(asking_vulkan("pass " + pass.name, [&] { return state_->pipeline_of(pass); }));
        state_->record();
        state_->fill_buffers();
    });
}

Program::~Program() = default;

std::span<std::byte> Program::host(int buffer) {
    const BoundBuffer& own = state_->buffers.at(buffer);
    const BoundBuffer& reached = own.mapped ? own : state_->staging.at(buffer);
    if (!reached.mapped)
        throw Error(fmt::format("buffer {} is not the host's", state_->rows.at(buffer).name));
    return {reached.mapped, own.bytes};
}

void Program::take(int buffer, std::size_t offset, std::shared_ptr<const DeviceBytes> from) {
    const BufferRow& row = state_->rows.at(buffer);
    const bool fits = row.host == BufferRow::Host::taken
                          ? offset + from->size() <= row.bytes
                          : row.host == BufferRow::Host::upload && offset == 0 && from->size() == row.bytes;
    if (!fits)
        throw Error(fmt::format("{} bytes at {} do not fit into buffer {}", from->size(), offset, row.name));
    state_->taken.push_back({buffer, offset, std::move(from)});
}

void Program::give(int buffer, std::shared_ptr<DeviceBytes> to) {
    const BufferRow& row = state_->rows.at(buffer);
    if (to->size() > row.bytes)
        throw Error(fmt::format("buffer {} has {} bytes, not {}", row.name, row.bytes, to->size()));
    state_->given.push_back({buffer, 0, std::move(to)});
}

void Program::stream_in(int buffer, std::size_t item_bytes,
                        const std::function<void(std::size_t first, std::span<std::byte> to)>& fill) {
    state_->stream(buffer, item_bytes, PartStream::Way::in, fill);
}

void Program::stream_out(int buffer, std::size_t item_bytes,
                         const std::function<void(std::size_t first, std::span<const std::byte> from)>& visit) {
    state_->stream(buffer, item_bytes, PartStream::Way::out, visit);
}

void Program::run(std::span<const std::byte> constants, Results results) {
    State& s = *state_;
    std::copy_n(constants.data(), std::min(constants.size(), s.constants.bytes), s.constants.mapped);
    asking_vulkan(s.gpu.info.name, [&] { s.submit(s.all_commands(results)); });
    s.taken.clear();
    s.given.clear();
    timings_.clear();
    if (!s.gpu.has_timestamps)
        return;
    const auto count = s.intervals.size() + 1;
    const auto [result, ticks] = s.queries.getResults<std::uint64_t>(0, static_cast<std::uint32_t>(count), count * 8, 8,
                                                                     vk::QueryResultFlagBits::e64);
    if (result != vk::Result::eSuccess)
        return;
    const auto ms = [&s, &ticks = ticks](std::size_t i) { // named anew: clang 14 captures no structured bindings
        return static_cast<double>(ticks[i + 1] - ticks[i]) * s.gpu.nanoseconds_per_tick * 1e-6;
    };
    for (std::size_t i = 0; i < s.intervals.size(); ++i)
        timings_.emplace_back(s.intervals[i], ms(i));
}

std::vector<std::byte> Program::read_back(int buffer) {
    State& s = *state_;
    const std::size_t bytes = s.rows.at(static_cast<std::size_t>(buffer)).bytes;
    BoundBuffer copy(s.gpu, bytes, vk::BufferUsageFlagBits::eTransferDst,
                     {Memory::eHostVisible | Memory::eHostCoherent});
    const auto commands = s.new_commands();
    commands.begin({vk::CommandBufferUsageFlagBits::eOneTimeSubmit});
    compute_barrier(commands);
    s.copy_out(commands, buffer, *copy.buffer);
    host_barrier(commands);
    commands.end();
    s.submit({*commands});
    return {copy.mapped, copy.mapped + bytes};
}

} // namespace scanshade::gpu
