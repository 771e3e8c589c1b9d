#include "ao/frame.h"

#include "ao/raycast/depth_surface.h"

#include <algorithm>
#include <cassert>

namespace scanshade {
namespace {

FitPlaneOptions prepared_for(const MethodRow& row, FitPlaneOptions preparation) {
    preparation.smoothing *= row.smoothing;
    preparation.fill_holes = preparation.fill_holes && row.fill_holes;
    return preparation;
}

ChosenSettings settings_of(MethodSetup& setup) {
    ChosenSettings settings;
    for (const Parameter& row : setup.parameters())
        settings.emplace_back(row.name, value_text(row));
    return settings;
}

} // namespace

FrameAo::FrameAo(gpu::Device& device, const MethodRow& row, MethodSetup& setup, FitPlaneOptions preparation,
                 std::shared_ptr<Finishers> finishers)
    : device_(&device), owned_(setup.make(device)), method_(*owned_), preparation_(prepared_for(row, preparation)),
      name_(row.name), settings_(settings_of(setup)),
      finishers_(finishers ? std::move(finishers) : std::make_shared<Finishers>(device)) {}

AoMap FrameAo::compute(const DepthImage& depth, const DepthNoise& noise) {
    timings_.clear();
    fitted_depth_.reset();
    fitted_normals_.reset();
    AoMap ao;
    if (noise.needs_preparation() && device_) {
        ao = compute_prepared(depth, noise);
        timings_ = fit_->timings();
    } else {
        ao = method_.compute({.surfaces = depth, .noise = noise});
    }
    timings_.insert(timings_.end(), method_.timings().begin(), method_.timings().end());
    return ao;
}

FitPlane& FrameAo::fit_for(const DepthNoise& noise) {
    if (fit_)
        fit_->set_noise(noise);
    else
        fit_.emplace(*device_, noise, preparation_);
    return *fit_;
}

NormalImage FrameAo::normals(const DepthImage& depth, const DepthNoise& noise) {
    NormalImage found = normals_of(depth);
    if (!noise.needs_preparation() || !device_ || !fit_for(noise).planes())
        return found;
    const cv::Mat3f fitted = fit_->compute(depth).normals.normals;
    std::transform(fitted.begin(), fitted.end(), found.normals.begin(), found.normals.begin(),
                   [](const cv::Vec3f& of_plane, const cv::Vec3f& of_pixels) {
                       return of_plane == cv::Vec3f() ? of_pixels : of_plane;
                   });
    return found;
}

AoMap FrameAo::compute_prepared(const DepthImage& depth, const DepthNoise& noise) {
    if (fit_for(noise).planes()) {
        const FittedOnDevice fitted = fit_->compute_on_device(depth);
        fitted_depth_ = fitted.z_m;
        fitted_normals_ = fitted.surfaces.normals_there;
        AoMap ao = method_.compute({.surfaces = fitted.surfaces, .noise = noise, .smoothed = true});
        take_out_filled(fitted, ao.visibility);
        return ao;
    }
    return method_.compute({.surfaces = fit_->compute(depth).depth, .noise = noise});
}

SequenceAo FrameAo::sequence(double radius_m, const DepthNoise& noise, const SequenceAoOptions& options) {
    assert(device_);
    return {*device_, method_, radius_m, noise, preparation_, options};
}

std::unique_ptr<PointMethod> point_method(const MethodSetup& setup, const CloudAoOptions& options, gpu::Device* device,
                                          const MergedImages& images) {
    if (std::unique_ptr<PointMethod> own = setup.make_for_points())
        return own;
    return std::make_unique<MergedCloudAo>(options, device, images);
}

} // namespace scanshade
