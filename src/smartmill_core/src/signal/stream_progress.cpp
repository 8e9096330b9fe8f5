#include "smartmill_core/signal/stream_progress.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "smartmill_core/formatted.h"
#include "smartmill_core/signal/stream_sorter.h"

namespace smartmill {
namespace {

constexpr std::size_t LEADING = 2;  // other streams that have to be ahead

}  // namespace

StreamProgress::Stream StreamProgress::add(double limit) {
  State state;
  state.limit = limit;
  streams_.push_back(state);
  return streams_.size() - 1;
}

void StreamProgress::heard(Stream stream, double stamp) {
  if (stamp < streams_.at(stream).newest - StreamSorter::RESTART) {
    for (State& state : streams_) {
      const double limit = state.limit;
      state = {};
      state.limit = limit;
    }
  }
  State& own = streams_[stream];
  own.newest = std::max(own.newest, stamp);
  own.silent = 0.0;
}

// [s] of the others over a stream
double StreamProgress::lead(Stream stream) const {
  std::vector<double> others;
  for (Stream other = 0; other < streams_.size(); ++other) {
    if (other != stream && streams_[other].newest != NEVER) others.push_back(streams_[other].newest);
  }
  if (others.empty() || streams_[stream].newest == NEVER) return 0.0;
  std::sort(others.begin(), others.end(), std::greater<>());
  return others[std::min(LEADING, others.size()) - 1] - streams_[stream].newest;
}

void StreamProgress::set(Stream stream, bool behind, bool silent, double lead) {
  State& own = streams_[stream];
  if (behind && own.behind == 0.0) {
    lines_.emplace_back(
        stream, silent ? formatted("no data for %.2f s of the other inputs, since %.3f s", lead, own.newest)
                       : formatted("%.2f s behind the other inputs at %.3f s", lead, own.newest + lead));
  }
  own.behind = behind ? lead : 0.0;
}

void StreamProgress::tick(double period, double now) {
  for (Stream stream = 0; stream < streams_.size(); ++stream) {
    State& own = streams_[stream];
    own.silent += period;
    const double lead = this->lead(stream);
    const bool is_late = lead > 0.5 * own.limit && now - own.newest - lead <= 0.5 * own.limit;
    own.late = is_late ? own.late + period : 0.0;
    const bool silent = lead > own.limit && own.silent >= own.limit;
    set(stream, silent || own.late >= 0.5 * own.limit, own.silent >= 0.5 * own.limit, lead);
  }
}

void StreamProgress::step() {
  for (Stream stream = 0; stream < streams_.size(); ++stream) {
    State& own = streams_[stream];
    const double lead = this->lead(stream);
    if (!(lead > 0.5 * own.limit)) {
      own.late_since = NEVER;
    } else if (own.late_since == NEVER) {
      own.late_since = own.newest + 0.5 * own.limit;
    }
    const bool behind = own.late_since != NEVER && own.newest + lead - own.late_since >= 0.5 * own.limit;
    set(stream, behind, own.late_since == own.newest + 0.5 * own.limit, lead);
  }
}

}  // namespace smartmill
