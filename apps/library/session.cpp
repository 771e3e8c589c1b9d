#include "apps/library/session.h"

#include "apps/doubts/doubts.h"
#include "apps/run/messages.h"
#include "apps/walk/frame_images.h"
#include "apps/walk/frame_steps.h"
#include "apps/walk/point_clouds.h"
#include "apps/walk/sequence_order.h"
#include "projection/base/error.h"
#include "projection/base/memory.h"
#include "projection/base/stopwatch.h"
#include "projection/expected_error.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <exception>
#include <fmt/format.h>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <numeric>
#include <thread>
#include <unistd.h>

namespace scanshade::library {
namespace {

/// Sessions of one choice of devices share them. By process, since a forked one cannot use its parent's devices.
Workers::Devices shared_devices(const std::string& choice) {
    static std::mutex access;
    static std::map<std::pair<pid_t, std::string>, std::weak_ptr<Workers::Devices::element_type>> open;
    const std::lock_guard alone(access);
    auto& known = open[{getpid(), choice}];
    Workers::Devices devices = known.lock();
    if (!devices) {
        devices = std::make_shared<Workers::Devices::element_type>(gpu::open_devices(choice));
        known = devices;
    }
    return devices;
}

constexpr float no_value = std::numeric_limits<float>::quiet_NaN();

/// Normals of the view on the recorded pixels or points; NaN where there is none.
cv::Mat3f attached_normals(const Frame& frame, const DepthImage& depth, const cv::Mat3f& normals) {
    std::array<cv::Mat, 3> axes;
    cv::split(normals, axes.data());
    const cv::Mat none = (axes[0] == 0) & (axes[1] == 0) & (axes[2] == 0);
    for (cv::Mat& axis : axes) {
        axis.setTo(no_value, none);
        const Attached on_record = attach(frame, depth, {axis});
        axis = frame.cloud ? on_grid(on_record.per_point, frame.cloud->grid).clone() : on_record.visibility;
    }
    cv::Mat3f merged;
    cv::merge(axes.data(), axes.size(), merged);
    return merged;
}

} // namespace

// ---------------------------------------------------------------------------------------------------- results

std::string Result::info() const {
    json all = about;
    all["settings"] = parsed_json(settings);
    all["device"] = device;
    all["frames"] = json::array();
    for (const FrameRow& row : rows) {
        json frame{{"name", row.name}, {"notes", row.notes}, {"warnings", row.warnings}, {"doubts", row.doubts}};
        frame["coverage"] = row.coverage;
        frame["ms"] = {
            {"load", row.ms.load}, {"project", row.ms.project}, {"compute", row.ms.compute}, {"attach", row.ms.attach}};
        all["frames"].push_back(std::move(frame));
    }
    return json_line(all);
}

DepthNoise OpenedCapture::noise() const {
    const std::lock_guard alone(measuring_);
    if (!noise_) {
        std::vector<std::size_t> frames(capture.entries.size());
        std::iota(frames.begin(), frames.end(), std::size_t{0});
        noise_ = measure_noise(first_look(capture, frames));
    }
    return *noise_;
}

/// A frame under work, and its values once it is done.
struct Session::Computed {
    explicit Computed(const CaptureEntry& entry) : work{entry, row} { row.name = entry.name; }
    Computed(const Computed&) = delete;
    Computed& operator=(const Computed&) = delete;
    Computed(Computed&&) = delete;

    FrameRow row;
    Work work;
    cv::Mat3f normals; ///< of the view
    cv::Mat1f visibility, confidence;
    cv::Mat3f attached_normals;
};

// ---------------------------------------------------------------------------------------------------- sequences

/// Frames of one recording, computed together: one method, leased for all of them.
class Session::Sequence {
  public:
    Sequence(Session& session, const Source& source, const BatchOptions& options)
        : session_(session), source_(source), lease_(session.methods()),
          sequence_(lease_->sequence(options.radius_m, options.noise,
                                     sequence_options(session.asked_.sequences, source.listing, options.radius_m))) {}

    [[nodiscard]] bool is_of(const Source& source) const { return source.owner && source_.owner == source.owner; }

    /// Loads the frames within reach that are not there yet.
    void compute(Computed& computed, std::size_t index, const BatchOptions& options, Wanted wanted) {
        const std::size_t reach = sequence_.reach(), first = index - std::min(index, reach);
        for (std::size_t i = std::max(first, next_); i <= std::min(index + reach, source_.listing.entries.size() - 1);
             ++i)
            add(i, i == index);
        const auto ready = frames_.find(index);
        if (ready == frames_.end())
            throw Error("the frame is missing");
        computed.work.frame = ready->second.frame;
        computed.work.depth = ready->second.depth;
        computed.row.camera = computed.work.frame.camera;
        describe_frame(computed.work);
        computed.work.finishers = lease_->finishers();
        sequence_.forget_before(first);
        frames_.erase(frames_.begin(), frames_.lower_bound(first));
        lowest_ = first;
        computed.row.index = index;
        const double together = compute_in_sequence(computed.work, source_.listing, sequence_);
        computed.work.errors = lease_->errors(options.noise, together);
        if (wanted.normals)
            computed.normals = lease_->normals(computed.work.depth, options.noise).normals;
    }
    /// Whether the frames before `index` are still known, or were never needed.
    [[nodiscard]] bool can_compute(std::size_t index) const {
        return frames_.empty() || index - std::min(index, sequence_.reach()) >= lowest_;
    }

  private:
    struct Ready {
        Frame frame;
        DepthImage depth;
    };
    /// A neighbour that cannot be read is left out, as the walk does; the frame itself must be there.
    void add(std::size_t index, bool wanted) {
        try {
            Computed loaded(source_.listing.entries[index]);
            session_.load(loaded, source_, index);
            if (loaded.work.by_points)
                throw Error("a cloud without a view cannot be part of a sequence");
            sequence_.add(index, loaded.work.depth, loaded.work.frame.world_from_camera);
            frames_.emplace(index, Ready{std::move(loaded.work.frame), std::move(loaded.work.depth)});
        } catch (const Outage&) {
            throw;
        } catch (const Error&) {
            if (wanted)
                throw;
        }
        next_ = index + 1;
    }

    Session& session_;
    Source source_;
    MethodPool::Lease lease_;
    SequenceAo sequence_;
    std::map<std::size_t, Ready> frames_;
    std::size_t next_ = 0, lowest_ = 0;
};

// ---------------------------------------------------------------------------------------------------- sessions

Session::Session(const Settings& given) {
    fill(asked_, Purpose::session, given);
    settings_text_ = json_line(values_in_use(asked_));
    by_rays_ = asked_.chosen_setup().make_for_points() != nullptr;
}

Session::~Session() = default;

Workers& Session::workers() {
    const std::lock_guard alone(opening_);
    if (!workers_)
        workers_ = std::make_unique<Workers>(shared_devices(asked_.device), asked_.in_flight);
    return *workers_;
}

MethodPool& Session::methods() {
    Workers& open = workers();
    const std::lock_guard alone(opening_);
    if (!methods_)
        methods_ = open.pool_of(asked_.method, asked_.chosen_setup(), asked_.preparation());
    return *methods_;
}

PointMethod& Session::points() {
    gpu::Device* gpu = nullptr;
    try {
        if (!gpu::is_cpu(workers().device().info()))
            gpu = &workers().device();
    } catch (const Outage&) {
        throw;
    } catch (const Error&) { // without a device, the processor casts the rays
    }
    const std::lock_guard alone(opening_);
    if (!points_)
        points_ = point_method(asked_.chosen_setup(), asked_.cloud_ao(), gpu);
    return *points_;
}

BatchOptions Session::options(const DepthNoise& noise, Wanted wanted) const {
    BatchOptions options;
    options.outputs.confidence = wanted.confidence;
    options.outputs.shaded = options.outputs.cloud = false;
    options.outputs.format = AoFormat::tiff; // floats
    options.range = asked_.range();
    options.radius_m = asked_.radius_m();
    options.noise = noise;
    options.cloud_walk = by_rays_ ? CloudWalk::points : asked_.clouds;
    return options;
}

DepthNoise Session::noise_of(const Source& source) const {
    return asked_.depth_noise == "auto" ? source.measure_noise() : noise_from_text(asked_.depth_noise);
}

void Session::load(Computed& computed, const Source& source, std::size_t index) const {
    Stopwatch stopwatch;
    Work& work = computed.work;
    work.frame = source.load(index);
    computed.row.index = index;
    computed.row.ms.load = stopwatch.ms();
    describe_frame(work);
    const CloudWalk walk = by_rays_ ? CloudWalk::points : asked_.clouds;
    if (work.frame.cloud && takes_points(work.frame, walk, computed.row.notes)) {
        work.by_points = true;
        return;
    }
    const Stopwatch projecting;
    prepare_view(work, asked_.range());
    computed.row.ms.project = projecting.ms();
}

void Session::compute_view(Computed& computed, FrameAo& method, const BatchOptions& options, Wanted wanted) const {
    const Stopwatch stopwatch;
    computed.work.finishers = method.finishers();
    computed.work.errors = method.errors(options.noise);
    compute_alone(computed.work, method, options.noise);
    computed.row.ms.compute = stopwatch.ms();
    if (wanted.normals)
        computed.normals = method.normals(computed.work.depth, options.noise).normals;
}

void Session::compute_of_points(Computed& computed) {
    PointMethod& method = points();
    const std::lock_guard alone(one_cloud_);
    const Stopwatch stopwatch;
    compute_points(computed.work, method);
    computed.row.ms.compute = stopwatch.ms();
}

void Session::compute_one(Computed& computed, const Source& source, std::size_t index, const BatchOptions& options,
                          Wanted wanted) {
    load(computed, source, index);
    if (computed.work.by_points)
        compute_of_points(computed);
    else
        compute_view(computed, *methods().lease(), options, wanted);
    finish_one(computed, options, wanted);
}

void Session::finish_one(Computed& computed, const BatchOptions& options, Wanted wanted) const {
    const Stopwatch stopwatch;
    Work& work = computed.work;
    const Frame& frame = work.frame;
    computed.row.expected_error = std::numeric_limits<double>::quiet_NaN();
    if (work.by_points)
        computed.row.expected_error = work.of_points.expected_error.value_or(computed.row.expected_error);
    else {
        (void)finish(work, options, options.outputs);
        computed.row.expected_error =
            expected_rms_of(work.depth, work.ao.visibility, options.radius_m, options.noise, work.errors);
    }
    computed.row.coverage = work.attached.coverage;
    computed.row.mean_visibility = work.attached.mean_visibility;
    std::ranges::move(doubts_about(computed_frame(work), options.radius_m, options.noise),
                      std::back_inserter(computed.row.doubts));
    const auto values = [&](const Attached& of) {
        return frame.cloud ? of.per_point.empty() ? cv::Mat1f() : on_grid(of.per_point, frame.cloud->grid).clone()
                           : of.visibility;
    };
    computed.visibility = values(work.attached);
    if (wanted.confidence)
        computed.confidence = values(work.confidence);
    if (wanted.normals && work.by_points && !work.of_points.normals.empty()) {
        const cv::Size grid = frame.cloud->grid;
        computed.attached_normals = cv::Mat3f(grid);
        std::ranges::transform(work.of_points.normals, computed.attached_normals.begin(), [](const Eigen::Vector3f& n) {
            return n.isZero() ? cv::Vec3f::all(no_value) : cv::Vec3f(n.x(), n.y(), n.z());
        });
    } else if (wanted.normals && !work.by_points) {
        computed.attached_normals = attached_normals(frame, work.depth, computed.normals);
    }
    computed.row.ms.attach = stopwatch.ms();
    work.frame = {};
    work.depth = work.looked_at = {};
    work.fitted.reset();
}

void Session::compute_together(std::deque<Computed>& computed, const Source& source,
                               std::span<const std::size_t> frames, const BatchOptions& options, Wanted wanted) {
    const std::lock_guard alone(one_sequence_);
    for (std::size_t i = 0; i < frames.size(); ++i)
        during(fmt::format("frame {}", source.listing.entries[frames[i]].name), [&] {
            if (!sequence_ || !sequence_->is_of(source) || !sequence_->can_compute(frames[i])) {
                sequence_.reset(); // gives its method back first
                sequence_ = std::make_unique<Sequence>(*this, source, options);
            }
            const Stopwatch stopwatch;
            sequence_->compute(computed[i], frames[i], options, wanted);
            computed[i].row.ms.compute = stopwatch.ms();
            finish_one(computed[i], options, wanted);
        });
}

Result Session::compute(const Source& source, std::span<const std::size_t> frames, Wanted wanted) {
    const DepthNoise noise = noise_of(source);
    const BatchOptions how = options(noise, wanted);
    std::deque<Computed> computed;
    for (const std::size_t index : frames)
        computed.emplace_back(source.listing.entries.at(index));
    if (asked_.in_sequence(source.listing)) {
        compute_together(computed, source, frames, how, wanted);
        return joined(computed, &noise);
    }
    std::vector<std::exception_ptr> failures(frames.size());
    std::atomic<std::size_t> next = 0;
    std::atomic<bool> failed = false;
    const auto work = [&] {
        for (std::size_t i = next++; i < frames.size() && !failed; i = next++)
            try {
                during(fmt::format("frame {}", source.listing.entries[frames[i]].name),
                       [&] { compute_one(computed[i], source, frames[i], how, wanted); });
            } catch (...) {
                failures[i] = std::current_exception();
                failed = true;
            }
    };
    { // as many at once as there are methods; a device waits for no preparation of the next frame
        std::vector<std::jthread> others;
        const std::size_t at_once = frames.size() > 1 ? methods().size() + 1 : 1;
        for (std::size_t i = 1; i < std::min(at_once, frames.size()); ++i)
            others.emplace_back(work);
        work();
    }
    for (const std::exception_ptr& failure : failures)
        if (failure)
            std::rethrow_exception(failure);
    return joined(computed, &noise);
}

Result Session::compute(PointArrays arrays, Wanted wanted) {
    PointMethod& method = points();
    CaptureEntry entry;
    entry.name = "points";
    std::deque<Computed> computed;
    Computed& one = computed.emplace_back(entry);
    Work& work = one.work;
    work.by_points = true;
    work.frame.cloud = Cloud{{static_cast<int>(arrays.points.size()), 1}, std::move(arrays.points), {}, nullptr};
    describe_frame(work);
    {
        const std::lock_guard alone(one_cloud_);
        const Stopwatch stopwatch;
        const std::vector<Eigen::Vector3d>& points = work.frame.cloud->points;
        compute_points(work, method, {points, arrays.normals, arrays.triangles, arrays.z_up}, arrays.scanner);
        one.row.ms.compute = stopwatch.ms();
    }
    finish_one(one, options({}, wanted), wanted);
    Result result = joined(computed, nullptr);
    result.about["radius"] = work.of_points.radius;
    return result;
}

Result Session::joined(std::deque<Computed>& computed, const DepthNoise* noise) const {
    Result result;
    const cv::Size size = computed.front().visibility.size();
    result.count = static_cast<std::int64_t>(computed.size());
    result.height = size.height;
    result.width = size.width;
    const auto join = [&](auto& whole, auto part) {
        if (computed.size() == 1) {
            whole = computed.front().*part;
            whole = whole.isContinuous() ? whole : whole.clone();
            return;
        }
        for (std::size_t i = 0; i < computed.size(); ++i) {
            const auto& image = computed[i].*part;
            if (image.empty())
                return;
            if (i == 0)
                whole.create(size.height * static_cast<int>(computed.size()), size.width);
            image.copyTo(whole.rowRange(size.height * static_cast<int>(i), size.height * static_cast<int>(i + 1)));
        }
    };
    join(result.visibility, &Computed::visibility);
    join(result.confidence, &Computed::confidence);
    join(result.normals, &Computed::attached_normals);
    for (Computed& one : computed)
        result.rows.push_back(std::move(one.row));
    result.settings = settings_text_;
    result.device = workers_ ? workers_->device().info().name : "the processor";
    if (noise) {
        result.about["radius"] = asked_.radius_m();
        result.about["depth_noise"] = noise_sentence(*noise, asked_);
    }
    return result;
}

} // namespace scanshade::library
