#include "smartmill_loadmeter/identification/sorted_identification.h"

#include <algorithm>

namespace smartmill::loadmeter {

namespace {

constexpr double RESTART_JUMP = 1.0;  // [s] backwards: a bag was restarted
constexpr double NEVER = -std::numeric_limits<double>::infinity();

}  // namespace

SortedIdentification::SortedIdentification(const MachineModel& model,
                                           const IdentificationParameters& parameters, double hold_back)
    : identification_(model, parameters), sorter_(hold_back) {
  states_ = sorter_.addRegular("cnc/state");
  loads_ = sorter_.addRegular("cnc/load");
  motors_ = sorter_.addEvents("daq/motor_current");
  conditions_ = sorter_.addEvents("cut/condition");
  goals_ = sorter_.addEvents("loadmeter/identify_coefficients");
  last_.assign(5, NEVER);
}

template <typename Input>
void SortedIdentification::sort(StreamSorter::Stream stream, const Input& input) {
  // Only sensors tell of a restart: a latched condition is old by nature.
  const bool regular = stream == states_ || stream == loads_ || stream == motors_;
  if (regular && input.stamp < last_[stream] - RESTART_JUMP) {
    sorter_.reset();
    identification_.reset();
    last_.assign(5, NEVER);
    newest_ = 0.0;
  }
  last_[stream] = std::max(last_[stream], input.stamp);
  newest_ = std::max(newest_, input.stamp);
  sorter_.push(stream, input.stamp, [this, input] { identification_.handle(input); });
}

void SortedIdentification::push(const CncState& state) {
  sort(states_, state);
}
void SortedIdentification::push(const LoadSample& sample) {
  sort(loads_, sample);
}
void SortedIdentification::push(const SampleBlock& block) {
  sorter_.setRegular(motors_, true);
  sort(motors_, block);
}
void SortedIdentification::push(const CuttingCondition& condition) {
  sort(conditions_, condition);
}
void SortedIdentification::push(const IdentifyGoal& goal) {
  sort(goals_, goal);
}

}  // namespace smartmill::loadmeter
