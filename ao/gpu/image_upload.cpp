#include "ao/gpu/image_upload.h"

#include "ao/gpu/transfer.h"

namespace scanshade::gpu {

std::shared_ptr<const DeviceBytes> ImageUpload::operator()(const cv::Mat1f& image) {
    const std::size_t bytes = image.total() * sizeof(float);
    if (!program_ || bytes != bytes_)
        program_ = std::make_unique<Program>(device_, std::vector<BufferRow>{{"image", bytes, BufferRow::Host::upload}},
                                             std::vector<PassRow>{}, 0);
    bytes_ = bytes;
    upload(image, program_->host(0));
    const std::shared_ptr<DeviceBytes> there = pool_.get(bytes);
    program_->give(0, there);
    program_->run({});
    return there;
}

std::vector<std::byte> read_back(Device& device, std::shared_ptr<const DeviceBytes> from) {
    Program program(device, {{"bytes", from->size(), BufferRow::Host::taken}}, {}, 0);
    program.take(0, 0, std::move(from));
    program.run({});
    return program.read_back(0);
}

} // namespace scanshade::gpu
