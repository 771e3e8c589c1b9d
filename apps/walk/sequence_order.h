// Which frames enter the walk, and in which order they are computed, where each needs those around it.
#pragma once

#include "apps/walk/work.h"

#include <cstddef>
#include <deque>
#include <utility>
#include <vector>

namespace scanshade {

/// Which frames enter the pipeline: those wanted, as they come; with a reach, in the recording's order, those wanted
/// and those within reach of one, then as many empty tokens as frames may still wait for what lies around them.
class Walk {
  public:
    /// `rows` are those of the frames wanted; they are filled in on the way and must stay where they are.
    Walk(const Capture& capture, std::vector<FrameRow>& rows, std::size_t reach);

    [[nodiscard]] bool goes_on() const { return next_ < steps_.size() || empty_ > 0; }
    [[nodiscard]] Token next();

  private:
    const Capture& capture_;
    std::vector<std::pair<std::size_t, FrameRow*>> steps_; ///< null: only beside others
    std::size_t next_ = 0;
    std::deque<FrameRow> beside_; ///< rows of those
    std::size_t empty_;
};

/// Frames of a sequence, held back until what lies around them has arrived. Without a sequence they pass as they come.
class Waiting {
  public:
    explicit Waiting(Neighbourhood* sequence) : sequence_(sequence) {}

    /// Takes a frame (or none, when all have come) and gives the next one that is complete, or none. Where an outage
    /// kept one of those around it away, it is complete only at another time, and its row says so.
    [[nodiscard]] Token pass(Token arrived);
    /// Those that an interrupted walk leaves behind.
    [[nodiscard]] const std::deque<Token>& rest() const { return queue_; }

  private:
    Neighbourhood* sequence_;
    void blame_if_alone(FrameRow& row) const;

    std::size_t newest_ = 0;
    std::deque<Token> queue_;
    std::vector<std::pair<std::size_t, std::string>> away_; ///< frames that an outage kept away, and why
};

/// What is asked, with the reach that the capture's poses ask for where none is given.
[[nodiscard]] NeighbourhoodOptions sequence_options(NeighbourhoodOptions asked, const Capture& capture,
                                                    double radius_m);

/// A frame's visibility together with the frames around it; its row's notes say which these were, and which were left
/// out and why.
void compute_in_sequence(Work& work, const Capture& capture, Neighbourhood& sequence);

} // namespace scanshade
