#include "smartmill_cnc/motion/condition_schedule.h"

#include <algorithm>

namespace smartmill::cnc {
namespace {

constexpr double SHORTEST = 1e-3;  // [s] of a condition, whose end must not precede its begin

}  // namespace

void ConditionSchedule::announce(const std::optional<CuttingCondition>& condition, double now) {
  from_ = to_ = now;
  running_ = condition;
  if (running_) {
    from_ += lead_;
    running_->stamp = from_;
    announced_.push_back(*running_);
  }
}

void ConditionSchedule::announceEnd(double now) {
  if (running_) {
    to_ = now + lead_;
    end(to_);
  }
}

void ConditionSchedule::breakOff(double now) {
  if (running_) {
    end(std::max(now, from_ + SHORTEST));
  }
}

void ConditionSchedule::end(double stamp) {
  CuttingCondition none;
  none.stamp = stamp;
  announced_.push_back(none);
  running_.reset();
}

}  // namespace smartmill::cnc
