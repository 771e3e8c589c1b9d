#include "apps/library/session.h"

#include "apps/frame/frame_images.h"
#include "apps/frame/frame_steps.h"
#include "apps/frame/sequence_steps.h"
#include "projection/base/error.h"
#include "projection/base/memory.h"
#include "projection/base/stopwatch.h"

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
        json frame{
            {"name", row.name}, {"notes", row.notes}, {"warnings", row.warnings}, {"doubts", doubts_in(row.findings)}};
        frame["coverage"] = row.coverage;
        frame["mean_visibility"] = std::isfinite(row.mean_visibility) ? json(row.mean_visibility) : json();
        frame["expected_error"] = std::isfinite(row.expected_error) ? json(row.expected_error) : json();
        frame["ms"] = {
            {"load", row.ms.load}, {"project", row.ms.project}, {"compute", row.ms.compute}, {"attach", row.ms.attach}};
        all["frames"].push_back(std::move(frame));
    }
    return json_line(all);
}

const Beforehand& OpenedCapture::beforehand(const RunSettings& asked, const std::string& key) const {
    const std::lock_guard alone(looking_);
    if (const auto known = found_.find(key); known != found_.end())
        return known->second;
    std::vector<std::size_t> frames(capture.entries.size());
    std::iota(frames.begin(), frames.end(), std::size_t{0});
    Beforehand found;
    LoadedFrames loaded;
    found.look = look_at(capture, frames, asked, loaded);
    found.findings = findings_about(capture, frames, asked);
    found.by_points = computes_points(capture, loaded, cloud_walk_for(asked, found.look));
    return found_.emplace(key, std::move(found)).first->second;
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
    Sequence(Session& session, const Source& source, const FrameOptions& options)
        : session_(session), source_(source), methods_(session.methods(options.radius_m)), lease_(*methods_),
          sequence_(lease_->sequence(options.radius_m, options.noise,
                                     sequence_options(session.asked_.sequences, source.listing, options.radius_m))) {}

    [[nodiscard]] bool is_of(const Source& source) const { return source.owner && source_.owner == source.owner; }

    /// Loads the frames within reach that are not there yet.
    void compute(Computed& computed, std::size_t index, const FrameOptions& options, Wanted wanted) {
        const std::size_t reach = sequence_.reach(), first = index - std::min(index, reach);
        for (std::size_t i = std::max(first, next_); i <= std::min(index + reach, source_.listing.entries.size() - 1);
             ++i)
            add(i, i == index, options);
        const auto ready = frames_.find(index);
        if (ready == frames_.end())
            throw Error("the frame is missing");
        computed.work.frame = ready->second.frame;
        computed.work.depth = ready->second.depth;
        computed.row.camera = computed.work.frame.camera;
        describe_frame(computed.work);
        sequence_.forget_before(first);
        frames_.erase(frames_.begin(), frames_.lower_bound(first));
        lowest_ = first;
        computed.row.index = index;
        compute_view(computed.work, *lease_, options.noise, source_.listing, &sequence_);
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
    void add(std::size_t index, bool wanted, const FrameOptions& options) {
        try {
            Computed loaded(source_.listing.entries[index]);
            session_.load(loaded, source_, index, options);
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
    std::shared_ptr<MethodPool> methods_;
    MethodPool::Lease lease_;
    SequenceAo sequence_;
    std::map<std::size_t, Ready> frames_;
    std::size_t next_ = 0, lowest_ = 0;
};

// ---------------------------------------------------------------------------------------------------- sessions

Session::Session(const Settings& given) {
    fill(asked_, Purpose::session, given);
    settings_text_ = json_line(values_in_use(asked_));
}

Session::~Session() = default;

Workers& Session::workers() {
    const std::lock_guard alone(opening_);
    if (!workers_)
        workers_ = std::make_unique<Workers>(shared_devices(asked_.device), asked_.in_flight);
    return *workers_;
}

std::shared_ptr<MethodPool> Session::methods(double radius_m) {
    Workers& open = workers();
    const std::lock_guard alone(opening_);
    return open.pool_of(asked_.method, *asked_.setup_with(radius_m), asked_.preparation());
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
        points_ = point_method(asked_.chosen_setup(), asked_.cloud_ao(), gpu,
                               {[this]() -> gpu::Device& { return workers().device(); }, asked_.preparation()});
    return *points_;
}

FrameOptions Session::options(Wanted wanted) const {
    FrameOptions options;
    options.outputs.confidence = wanted.confidence;
    options.outputs.shaded = options.outputs.cloud = false;
    options.outputs.format = AoFormat::tiff; // floats
    options.range = asked_.range();
    options.radius_m = asked_.radius_m();
    return options;
}

FrameOptions Session::options(const Beforehand& known, Wanted wanted) const {
    FrameOptions options = this->options(wanted);
    options.noise = known.look.noise;
    options.findings = known.findings.findings;
    options.cloud_walk = cloud_walk_for(asked_, known.look);
    if (!known.by_points)
        options.radius_m = radius_for(asked_, known.look);
    return options;
}

void Session::load(Computed& computed, const Source& source, std::size_t index, const FrameOptions& options) const {
    Stopwatch stopwatch;
    Work& work = computed.work;
    work.frame = source.load(index);
    computed.row.index = index;
    computed.row.ms.load = stopwatch.ms();
    describe_frame(work);
    choose_points_or_view(work, options.cloud_walk);
    if (work.by_points)
        return;
    const Stopwatch projecting;
    prepare_view(work, options.range);
    computed.row.ms.project = projecting.ms();
}

void Session::compute_of_points(Computed& computed) {
    PointMethod& method = points();
    const std::lock_guard alone(one_cloud_);
    const Stopwatch stopwatch;
    compute_points(computed.work, method);
    computed.row.ms.compute = stopwatch.ms();
}

void Session::compute_one(Computed& computed, const Source& source, std::size_t index, const FrameOptions& options,
                          Wanted wanted) {
    load(computed, source, index, options);
    if (computed.work.by_points) {
        compute_of_points(computed);
    } else {
        const std::shared_ptr<MethodPool> pool = methods(options.radius_m);
        const MethodPool::Lease method = pool->lease();
        const Stopwatch stopwatch;
        compute_view(computed.work, *method, options.noise, source.listing);
        computed.row.ms.compute = stopwatch.ms();
        if (wanted.normals)
            computed.normals = method->normals(computed.work.depth, options.noise).normals;
    }
    finish_one(computed, options, wanted);
}

void Session::finish_one(Computed& computed, const FrameOptions& options, Wanted wanted) const {
    const Stopwatch stopwatch;
    Work& work = computed.work;
    const Frame& frame = work.frame;
    (void)attach_values(work, options, options.outputs);
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
                               std::span<const std::size_t> frames, const FrameOptions& options, Wanted wanted) {
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
    const Beforehand known = source.look(asked_, settings_text_);
    const FrameOptions how = options(known, wanted);
    std::deque<Computed> computed;
    for (const std::size_t index : frames)
        computed.emplace_back(source.listing.entries.at(index));
    if (asked_.in_sequence(source.listing)) {
        compute_together(computed, source, frames, how, wanted);
        return about_capture(joined(computed), source.listing, known, how);
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
        const std::size_t at_once = frames.size() > 1 && !known.by_points ? methods(how.radius_m)->size() + 1 : 1;
        for (std::size_t i = 1; i < std::min(at_once, frames.size()); ++i)
            others.emplace_back(work);
        work();
    }
    for (const std::exception_ptr& failure : failures)
        if (failure)
            std::rethrow_exception(failure);
    return about_capture(joined(computed), source.listing, known, how);
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
    finish_one(one, options(wanted), wanted);
    Result result = joined(computed);
    result.about["radius"] = work.of_points.radius;
    return result;
}

Result Session::joined(std::deque<Computed>& computed) const {
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
    return result;
}

Result Session::about_capture(Result result, const Capture& capture, const Beforehand& known,
                              const FrameOptions& options) const {
    result.about["radius"] = options.radius_m;
    result.about["depth_noise"] = noise_sentence(options.noise, asked_, capture.unit);
    std::vector<std::string> warnings = known.findings.warnings;
    std::ranges::copy(warnings_about(asked_, known.look, options.radius_m), std::back_inserter(warnings));
    result.about["warnings"] = std::move(warnings);
    return result;
}

} // namespace scanshade::library
