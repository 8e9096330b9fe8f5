#include "smartmill_discrepancy/data/stream_shift.h"

#include "smartmill_sim/twin/axis_motion.h"
#include "smartmill_sim/twin/twin.h"

namespace smartmill::discrepancy {
namespace {

constexpr char AXES[] = {'x', 'y', 'z'};

// A test in which axes move, and whose streams have no stated offset.
struct MovingTest {
  const RecordedTest* recorded = nullptr;
  sim::AxisMotion motion;
};

std::vector<MovingTest> movingTests(const std::vector<RecordedTest>& tests) {
  std::vector<MovingTest> moving;
  for (const RecordedTest& one : tests) {
    const auto& stated = one.test.stream_offset;
    if (!sim::AxisMotion::isRecorded(one.record) || stated.count("force") > 0 ||
        stated.count("controller") > 0)
      continue;
    // As the effect axis_inertia.
    moving.push_back({&one, {one.record, one.test.sample_rate, sim::SimulationOptions().axis_smoothing}});
  }
  return moving;
}

SignalPair pairOf(const MovingTest& test, std::size_t axis) {
  const std::string force = std::string("f") + AXES[axis];
  if (test.motion.samples(axis).empty() || !test.recorded->record.has(force)) return {};
  return {test.recorded->record.column(force), test.motion.samples(axis)};
}

std::optional<ForceShift> shiftAlong(std::size_t axis, const std::vector<MovingTest>& tests,
                                     const StreamShiftOptions& options) {
  std::vector<SignalPair> pairs;
  double rate = 0.0;
  for (const MovingTest& test : tests) {
    SignalPair pair = pairOf(test, axis);
    const double own_rate = test.recorded->test.sample_rate;
    if (pair.late.empty() || (rate > 0.0 && own_rate != rate)) continue;
    rate = own_rate;
    pairs.push_back(std::move(pair));
  }
  const std::optional<StreamShift> shift = shiftByCorrelation(pairs, rate, options);
  if (!shift) return {};
  return ForceShift{*shift, AXES[axis]};
}

}  // namespace

std::optional<ForceShift> shiftOfForces(const std::vector<RecordedTest>& tests,
                                        const StreamShiftOptions& options) {
  const std::vector<MovingTest> moving = movingTests(tests);
  std::optional<ForceShift> best;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::optional<ForceShift> shift = shiftAlong(axis, moving, options);
    if (shift && (!best || best->explained <= shift->explained)) best = shift;
  }
  return best;
}

}  // namespace smartmill::discrepancy
