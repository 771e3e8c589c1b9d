#include "apps/run/tally.h"

#include "apps/command.h"
#include "apps/results/report.h"
#include "apps/run/interruption.h"

#include <fmt/format.h>

namespace scanshade {

void Tally::add(const std::vector<FrameRow>& rows) {
    all_ += rows.size();
    ok_ += count(rows, FrameStatus::ok);
    doubtful_ += count(rows, FrameStatus::doubtful);
    for (const FrameRow& row : rows)
        faults_.insert(row.fault);
}

std::string Tally::doubt_sentence() const {
    return doubtful_ == 0 ? "" : fmt::format("doubtful: {} of {} frames; their results may be wrong", doubtful_, all_);
}

int Tally::exit_code(int unopened) const {
    if (interrupted || faults_.contains(Fault::outage))
        return unfinished;
    if (faults_.contains(Fault::internal) || faults_.contains(Fault::crash))
        return internal_error;
    if (ok_ + (strict_ ? 0 : doubtful_) == all_ && unopened == 0)
        return all_well;
    return ok_ + doubtful_ == 0 ? nothing_done : some_failed;
}

} // namespace scanshade
