#include "smartmill_sim/faults/stream_fault.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <type_traits>
#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"

namespace smartmill::sim {
namespace {

constexpr double RESTART = 1.0;  // [s] as of StreamSorter
constexpr std::array<double, 3> GARBAGE{{NOT_A_NUMBER, std::numeric_limits<double>::infinity(), 1e30}};

struct Kind {
  const char* name;
  double value;  // default
};
constexpr std::array<Kind, 12> KINDS{{{"off", 0.0},
                                      {"stuck", 0.0},
                                      {"garbage", 0.0},
                                      {"scale", 1.5},
                                      {"sign", 0.0},
                                      {"swapped", 0.0},
                                      {"slow", 10.0},
                                      {"delayed", 0.3},
                                      {"intermittent", 0.1},
                                      {"duplicated", 0.0},
                                      {"wrong_rate", 0.9},
                                      {"clock_step", 0.2}}};

double wrapped(double angle) {
  const double rest = std::fmod(angle, units::TWO_PI);
  return rest < 0.0 ? rest + units::TWO_PI : rest;
}

}  // namespace

const std::vector<std::string>& faultNames() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> list;
    for (const Kind& kind : KINDS) list.emplace_back(kind.name);
    return list;
  }();
  return names;
}

StreamFault makeFault(const std::string& name, double begin, double duration, double value) {
  const std::vector<std::string>& names = faultNames();
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end()) throw Error("fault '" + name + "' is unknown, expected " + joined(names));
  if (!(begin >= 0.0) || !(duration >= 0.0) || !std::isfinite(value))
    throw Error("fault " + name + ": expected begin and duration >= 0 s and a finite value");
  const auto index = static_cast<std::size_t>(found - names.begin());
  StreamFault fault;
  fault.kind = static_cast<FaultKind>(index);
  fault.begin = begin;
  if (duration > 0.0) fault.duration = duration;
  fault.value = value != 0.0 ? value : KINDS[index].value;
  const bool positive = fault.kind == FaultKind::slow || fault.kind == FaultKind::delayed ||
                        fault.kind == FaultKind::intermittent || fault.kind == FaultKind::wrong_rate;
  if (positive && !(fault.value > 0.0)) throw Error("fault " + name + ": expected a value above 0");
  return fault;
}

std::vector<TopicFault> readFaults(const std::string& text) {
  std::vector<TopicFault> faults;
  std::stringstream entries(text);
  for (std::string entry; std::getline(entries, entry, ';');) {
    std::stringstream words(entry);
    std::string topic, name, rest;
    double begin = 0.0, duration = 0.0, value = 0.0;
    if (!(words >> topic)) continue;
    const bool complete = static_cast<bool>(words >> name >> begin >> duration);
    if (complete && !(words >> value)) {
      value = 0.0;
      words.clear(words.rdstate() & std::ios::eofbit);
    }
    if (!complete || words >> rest)
      throw Error("fault '" + entry + "': expected TOPIC FAULT BEGIN DURATION [VALUE]");
    faults.push_back({topic, makeFault(name, begin, duration, value)});
  }
  return faults;
}

template <class Data>
void FaultyStream<Data>::add(const StreamFault& fault) {
  const bool blocks_only = fault.kind == FaultKind::swapped || fault.kind == FaultKind::wrong_rate;
  if (blocks_only && !std::is_same_v<Data, SampleBlock>)
    throw Error("fault " + faultNames()[static_cast<std::size_t>(fault.kind)] +
                ": expected a topic of sample blocks");
  faults_.push_back(fault);
  last_fault_ = nullptr;  // the list has moved
}

template <class Data>
void FaultyStream<Data>::begin(StreamFault fault) {
  fault.begin = first_ && healthy_ ? std::nextafter(healthy_->stamp - *first_, 1e300) : 0.0;
  add(fault);
}

template <class Data>
const StreamFault* FaultyStream<Data>::active(double since) const {
  for (auto fault = faults_.rbegin(); fault != faults_.rend(); ++fault) {
    if (since >= fault->begin && since < fault->begin + fault->duration) return &*fault;
  }
  return nullptr;
}

template <class Data>
std::vector<Data> FaultyStream<Data>::flush() {
  std::vector<Data> out(held_.begin(), held_.end());
  held_.clear();
  return out;
}

template <class Data>
std::vector<Data> FaultyStream<Data>::push(const Data& data) {
  if (healthy_ && data.stamp < healthy_->stamp - RESTART) {
    first_.reset();
    healthy_.reset();
    held_.clear();
    last_fault_ = nullptr;
  }
  if (!first_) first_ = data.stamp;
  const StreamFault* fault = active(data.stamp - *first_);
  std::vector<Data> out;
  if (fault != last_fault_) {
    out = flush();
    out.insert(out.end(), merged_.begin(), merged_.end());
    merged_.clear();
    before_ = healthy_ ? healthy_ : data;
    if constexpr (std::is_same_v<Data, SpindleAngle>) turned_ = before_->angle;
    count_ = 0;
    last_fault_ = fault;
  }
  Data item = data;
  if (!fault) {
    out.push_back(item);
  } else {
    switch (fault->kind) {
      case FaultKind::off:
        break;
      case FaultKind::duplicated:
        out.insert(out.end(), 2, item);
        break;
      case FaultKind::intermittent:
        // Lost first.
        if (std::fmod(data.stamp - *first_ - fault->begin, fault->value) >= 0.5 * fault->value)
          out.push_back(item);
        break;
      case FaultKind::delayed:
        held_.push_back(item);
        for (; !held_.empty() && held_.front().stamp <= data.stamp - fault->value; held_.pop_front())
          out.push_back(held_.front());
        break;
      case FaultKind::slow:
        merged_.push_back(item);
        if (static_cast<double>(merged_.size()) < fault->value) break;
        if constexpr (std::is_same_v<Data, SampleBlock>) {
          Data whole = merged_.front();
          for (std::size_t i = 1; i < merged_.size(); ++i)
            whole.samples.insert(whole.samples.end(), merged_[i].samples.begin(), merged_[i].samples.end());
          out.push_back(whole);
        } else {
          out.push_back(item);
        }
        merged_.clear();
        break;
      default:
        distort(*fault, item);
        out.push_back(item);
    }
    ++count_;
  }
  healthy_ = data;
  return out;
}

template <>
void FaultyStream<SampleBlock>::distort(const StreamFault& fault, SampleBlock& block) {
  const std::size_t width = block.channels.size(), size = block.size();
  if (fault.kind == FaultKind::wrong_rate) block.sample_rate *= fault.value;
  if (fault.kind == FaultKind::clock_step) block.stamp += fault.value;
  for (std::size_t i = 0; i < size; ++i) {
    double* sample = &block.samples[i * width];
    if (fault.kind == FaultKind::swapped && width > 1) std::swap(sample[0], sample[1]);
    for (std::size_t c = 0; c < width; ++c) {
      if (fault.kind == FaultKind::stuck && before_->size() > 0)
        sample[c] = before_->at(before_->size() - 1, c);
      if (fault.kind == FaultKind::garbage) sample[c] = GARBAGE[(i * width + c) % GARBAGE.size()];
      if (fault.kind == FaultKind::scale) sample[c] *= fault.value;
      if (fault.kind == FaultKind::sign) sample[c] = -sample[c];
    }
  }
}

template <>
void FaultyStream<SpindleAngle>::distort(const StreamFault& fault, SpindleAngle& reading) {
  switch (fault.kind) {
    case FaultKind::stuck:
      reading.angle = before_->angle;
      reading.speed = before_->speed;
      break;
    case FaultKind::garbage:
      reading.angle = reading.speed = GARBAGE[count_ % GARBAGE.size()];
      break;
    case FaultKind::clock_step:
      reading.stamp += fault.value;
      break;
    case FaultKind::scale:
      turned_ += fault.value * wrapped(reading.angle - healthy_->angle);
      reading.angle = wrapped(turned_);
      reading.speed *= fault.value;
      break;
    case FaultKind::sign:
      reading.angle = wrapped(-reading.angle);
      break;
    default:
      break;
  }
}

template class FaultyStream<SampleBlock>;
template class FaultyStream<SpindleAngle>;

}  // namespace smartmill::sim
