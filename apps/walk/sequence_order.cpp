// The order in which frames enter the walk. In a sequence, each frame is computed after its neighbours have arrived.
#include "apps/walk/sequence_order.h"

#include <algorithm>
#include <limits>
#include <map>

namespace scanshade {

FrameOrder::FrameOrder(const Capture& capture, std::vector<FrameRow>& rows, std::size_t reach)
    : capture_(capture), empty_(reach > 0 ? rows.size() : 0) {
    std::map<std::size_t, FrameRow*> entering;
    for (FrameRow& row : rows) {
        const std::size_t first = row.index - std::min(row.index, reach);
        for (std::size_t i = first; reach > 0 && i <= std::min(row.index + reach, capture.entries.size() - 1); ++i)
            entering.try_emplace(i, nullptr);
        if (reach > 0)
            entering[row.index] = &row;
        else
            steps_.emplace_back(row.index, &row);
    }
    steps_.insert(steps_.end(), entering.begin(), entering.end());
}

WorkPtr FrameOrder::next() {
    if (next_ == steps_.size()) {
        --empty_;
        return {};
    }
    const auto [index, row] = steps_[next_++];
    if (!row)
        neighbour_rows_.push_back(skipped_row(capture_, index));
    auto work = std::make_shared<Work>(Work{capture_.entries[index], row ? *row : neighbour_rows_.back()});
    work->row.why.clear();
    work->wanted = row != nullptr;
    return work;
}

WorkPtr SequenceBuffer::pass(WorkPtr arrived) {
    if (!sequence_)
        return arrived;
    if (arrived) {
        newest_ = arrived->row.index;
        if (arrived->row.why.empty() && !arrived->by_points)
            sequence_->add(newest_, arrived->depth, arrived->frame.world_from_camera);
        if (arrived->row.fault == Fault::outage)
            lost_.emplace_back(newest_, arrived->row.why);
        if (arrived->wanted)
            queue_.push_back(std::move(arrived));
    } else {
        newest_ = std::numeric_limits<std::size_t>::max();
    }
    if (queue_.empty() || newest_ - queue_.front()->row.index < sequence_->reach())
        return {};
    WorkPtr complete = std::move(queue_.front());
    queue_.pop_front();
    sequence_->forget_before(complete->row.index - std::min(complete->row.index, sequence_->reach()));
    fail_if_neighbour_lost(complete->row);
    return complete;
}

void SequenceBuffer::fail_if_neighbour_lost(FrameRow& row) const {
    const auto lost = std::ranges::find_if(lost_, [&](const auto& frame) {
        return frame.first + sequence_->reach() >= row.index && row.index + sequence_->reach() >= frame.first;
    });
    if (!row.why.empty() || lost == lost_.end())
        return;
    row.status = FrameStatus::failed;
    row.fault = Fault::outage;
    row.why = "a neighbouring frame is missing: " + lost->second;
}

} // namespace scanshade
