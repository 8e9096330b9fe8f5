#include "smartmill_core/signal/stream_sorter.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace smartmill {

namespace {

constexpr double NEVER = -std::numeric_limits<double>::infinity();

}  // namespace

StreamSorter::StreamSorter(double hold_back) : hold_back_(hold_back), delivered_(NEVER) {
  if (!std::isfinite(hold_back) || hold_back < 0.0) {
    throw Error("stream sorter: hold_back " + std::to_string(hold_back) +
                " s: expected a finite number >= 0");
  }
}

StreamSorter::Stream StreamSorter::add(std::string name, bool regular, bool optional, bool sampled,
                                       bool latched) {
  sources_.push_back({std::move(name), regular, optional, sampled, latched, NEVER, std::nullopt});
  return sources_.size() - 1;
}

StreamSorter::Stream StreamSorter::addRegular(std::string name, double patience) {
  const Stream stream = add(std::move(name), true, std::isfinite(patience), true, false);
  sources_[stream].patience = patience;
  return stream;
}

void StreamSorter::setRegular(Stream stream, bool regular) {
  Source& source = sources_.at(stream);
  if (source.regular == regular) return;
  source.regular = regular;
  if (!regular) release(passed());
}

void StreamSorter::push(Stream stream, double stamp, Deliver deliver) {
  Source& source = sources_.at(stream);
  if (!std::isfinite(stamp)) throw Error("stream " + source.name + ": stamp is not a finite number");
  if (source.sampled && stamp < source.newest - RESTART) restart(stamp);
  if (source.optional) source.regular = true;
  if (source.latched) source.held = Item{stamp, deliver};
  source.newest = std::max(source.newest, stamp);
  if (source.sampled) first_ = std::min(first_, stamp);
  if (stamp < delivered_) {
    ++late_;
    deliver();
    return;
  }
  waiting_.emplace(Key{{stamp, stream}, arrivals_++}, std::move(deliver));
  release(passed());
}

void StreamSorter::pushNow(Stream stream, Deliver deliver) {
  const double stamp = newest();
  if (std::isfinite(stamp)) {
    push(stream, stamp, std::move(deliver));
  } else {
    deliver();
  }
}

void StreamSorter::restart(double stamp) {
  reset();
  if (forget_) forget_();
  for (Stream stream = 0; stream < sources_.size(); ++stream) {
    const std::optional<Item> held = sources_[stream].held;
    if (held && held->stamp <= stamp + RESTART) push(stream, held->stamp, held->deliver);
  }
}

void StreamSorter::flush() {
  release(std::numeric_limits<double>::infinity());
}

void StreamSorter::reset() {
  waiting_.clear();
  for (Source& source : sources_) source.newest = NEVER;
  delivered_ = NEVER;
  first_ = -NEVER;
  late_ = 0;
}

double StreamSorter::newest() const {
  double newest = NEVER;
  for (const Source& source : sources_) {
    if (source.sampled) newest = std::max(newest, source.newest);
  }
  return newest;
}

std::string StreamSorter::waitingFor() const {
  if (waiting_.empty()) return {};
  const Source* slowest = nullptr;
  for (const Source& source : sources_) {
    if (isAwaited(source) && (!slowest || source.newest < slowest->newest)) slowest = &source;
  }
  return slowest ? slowest->name : std::string();
}

// The item is removed before it runs, since it may throw or push further items.
void StreamSorter::release(double up_to) {
  while (!waiting_.empty() && waiting_.begin()->first.first.first + hold_back_ < up_to) {
    auto item = waiting_.extract(waiting_.begin());
    delivered_ = item.key().first.first;
    try {
      item.mapped()();
    } catch (const StreamError&) {
      throw;
    } catch (const Error& error) {
      throw StreamError(sources_[item.key().first.second].name, error.what());
    }
  }
}

bool StreamSorter::isAwaited(const Source& source) const {
  if (!source.regular || std::isinf(source.patience)) return source.regular;
  return newest() - std::max(source.newest, first_) <= source.patience;
}

// Strictly past: an item of the same stamp may still arrive on the stream that has reached it. Without
// regular streams the newest event counts.
double StreamSorter::passed() const {
  double slowest = std::numeric_limits<double>::infinity();
  double newest = NEVER;
  bool any_regular = false;
  for (const Source& source : sources_) {
    newest = std::max(newest, source.newest);
    if (!isAwaited(source)) continue;
    any_regular = true;
    slowest = std::min(slowest, source.newest);
  }
  return any_regular ? slowest : newest;
}

}  // namespace smartmill
