// Core types to messages and back, and what messages that contradict themselves give.
#include "smartmill_recording/conversions.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "smartmill_core/error.h"
#include "smartmill_recording/message_codec.h"

namespace smartmill {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

constexpr double STAMP = 1763700000.25;  // [s] exact in binary

/// Through the message's bytes, as a recording has them.
template <class Data>
Data recorded(const Data& data) {
  typename PlainOf<Data>::Type message;
  const std::string bytes = writeMessage(toPlain(data));
  readMessage(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size(), message);
  return fromMsg(message);
}

template <>
ForceBlock recorded(const ForceBlock& data) {
  return fromMsg(toPlain(data, "machine"));
}

TEST(Conversions, SampleBlock) {
  SampleBlock block;
  block.stamp = STAMP;
  block.sample_rate = 25600.0;
  block.first_index = 1ULL << 40U;
  block.channels = {"fx", "fy"};
  block.units = {"N", "V"};
  block.samples = {1.0, 0.1, -3.25, 1e-300};
  const SampleBlock again = recorded(block);
  EXPECT_EQ(again.stamp, block.stamp);
  EXPECT_EQ(again.sample_rate, block.sample_rate);
  EXPECT_EQ(again.first_index, block.first_index);
  EXPECT_EQ(again.channels, block.channels);
  EXPECT_EQ(again.units, block.units);
  EXPECT_EQ(again.samples, block.samples);
  EXPECT_EQ(toPlain(block, "dynamometer").header.frame_id, "dynamometer");
}

TEST(Conversions, SpindleAngleAndLoad) {
  const SpindleAngle angle = recorded(SpindleAngle{STAMP, 3.5, 1256.0});
  EXPECT_EQ(angle.stamp, STAMP);
  EXPECT_EQ(angle.angle, 3.5);
  EXPECT_EQ(angle.speed, 1256.0);
  const LoadSample load = recorded(LoadSample{STAMP, 0.25, 1256.0, {"X", "Z"}, {0.5, -0.125}});
  EXPECT_EQ(load.stamp, STAMP);
  EXPECT_EQ(load.spindle_load, 0.25);
  EXPECT_EQ(load.spindle_speed, 1256.0);
  EXPECT_EQ(load.axes, (std::vector<std::string>{"X", "Z"}));
  EXPECT_EQ(load.axis_load, (std::vector<double>{0.5, -0.125}));
}

// A pulse tachometer gives no angle at rest; a turning spindle without an angle is refused.
TEST(Conversions, SpindleAngleIsUnknownOnlyAtRest) {
  const double none = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(std::isnan(recorded(SpindleAngle{STAMP, none, 0.0}).angle));
  EXPECT_THAT(
      [&] {
        recorded(SpindleAngle{STAMP, none, 1.0});
      },
      ThrowsMessage<Error>(HasSubstr("spindle angle: not a finite number")));
  EXPECT_THAT(
      [&] {
        recorded(SpindleAngle{STAMP, 0.0, none});
      },
      ThrowsMessage<Error>(HasSubstr("spindle angle: not a finite number")));
}

TEST(Conversions, MachineTemperature) {
  const MachineTemperature warm =
      recorded(MachineTemperature{STAMP, {"X", "Z"}, {300.15, NOT_A_NUMBER}, {301.15, 302.15}, 318.15});
  EXPECT_EQ(warm.stamp, STAMP);
  EXPECT_EQ(warm.axes, (std::vector<std::string>{"X", "Z"}));
  EXPECT_EQ(warm.axis_motor[0], 300.15);
  EXPECT_TRUE(std::isnan(warm.axis_motor[1]));
  EXPECT_EQ(warm.axis_encoder, (std::vector<double>{301.15, 302.15}));
  EXPECT_EQ(warm.spindle_motor, 318.15);
  plain::MachineTemperature short_one = toPlain(warm);
  short_one.axis_motor.pop_back();
  EXPECT_THAT([&] { fromMsg(short_one); }, ThrowsMessage<Error>(HasSubstr("axis_motor")));
}

TEST(Conversions, InspectionFeature) {
  InspectionFeature slot;
  slot.stamp = STAMP;
  slot.condition = "slot_1";
  slot.kind = SLOT_WIDTH;
  slot.direction = "y";
  slot.nominal = 0.012;
  slot.measured = 0.011984;
  slot.std_dev = 1.5e-6;
  const InspectionFeature bare = recorded(slot);
  EXPECT_EQ(bare.stamp, STAMP);
  EXPECT_EQ(bare.condition, "slot_1");
  EXPECT_EQ(bare.kind, SLOT_WIDTH);
  EXPECT_EQ(bare.direction, "y");
  EXPECT_EQ(bare.nominal, 0.012);
  EXPECT_EQ(bare.measured, 0.011984);
  EXPECT_EQ(bare.std_dev, 1.5e-6);
  EXPECT_TRUE(std::isnan(bare.cut_time));
  EXPECT_TRUE(std::isnan(bare.part_temperature));
  slot.cut_time = STAMP - 60.0;
  slot.machine_temperature = 310.15;
  slot.part_temperature = 295.15;
  slot.part_expansion = 23.1e-6;
  const InspectionFeature full = recorded(slot);
  EXPECT_EQ(full.cut_time, STAMP - 60.0);
  EXPECT_EQ(full.machine_temperature, 310.15);
  EXPECT_EQ(full.part_temperature, 295.15);
  EXPECT_EQ(full.part_expansion, 23.1e-6);
  // rostopic pub leaves what is not stated at zero.
  plain::InspectionFeature typed = toPlain(bare);
  typed.machine_temperature = typed.part_temperature = typed.part_expansion = 0.0;
  EXPECT_TRUE(std::isnan(fromMsg(typed).machine_temperature));
  EXPECT_TRUE(std::isnan(fromMsg(typed).part_temperature));
  EXPECT_TRUE(std::isnan(fromMsg(typed).part_expansion));
}

TEST(Conversions, CncState) {
  CncState state;
  state.stamp = STAMP;
  state.connected = state.motion = state.alarm = true;
  state.mode = CncMode::mem;
  state.run = CncRun::start;
  state.alarm_text = "PS0010";
  state.program = 1234;
  state.sequence = -7;
  state.axes = {"X", "Y"};
  state.position = {0.1, -0.2};
  state.distance_to_go = {0.0, 0.5};
  state.spindle_speed = 1000.0;
  state.feed = 0.02;
  const CncState again = recorded(state);
  EXPECT_EQ(again.stamp, STAMP);
  EXPECT_TRUE(again.connected && again.motion && again.alarm);
  EXPECT_FALSE(again.armed || again.emergency);
  EXPECT_EQ(again.mode, state.mode);
  EXPECT_EQ(again.run, state.run);
  EXPECT_EQ(again.alarm_text, state.alarm_text);
  EXPECT_EQ(again.program, state.program);
  EXPECT_EQ(again.sequence, state.sequence);
  EXPECT_EQ(again.axes, state.axes);
  EXPECT_EQ(again.position, state.position);
  EXPECT_EQ(again.distance_to_go, state.distance_to_go);
  EXPECT_EQ(again.spindle_speed, state.spindle_speed);
  EXPECT_EQ(again.feed, state.feed);
}

TEST(Conversions, CuttingCondition) {
  CuttingCondition c;
  c.stamp = STAMP;
  c.kind = CuttingCondition::Kind::cut;
  c.name = "verify_1";
  c.material = "C45";
  c.tool_name = "D12";
  c.tool.teeth = 4;
  c.tool.diameter = 12e-3;
  c.tool.helix = 0.5;
  c.tool.edge.corner_radius = 1e-3;
  c.tool.pitch = {1.5, 1.6, 1.5, 1.6831853071795862};
  c.tool.edge.edge_angle = 1.2;
  c.cut_time_before = 240.0;
  c.engagement = {0.1, 3.0, 2e-3, 0.05e-3, {{0.1, 2.9, 0.0, 1e-3}, {0.2, 3.0, 1e-3, 2e-3}}};
  c.spindle_speed = 900.0;
  c.steady_from = {1.0, 2.0, 3.0};
  c.steady_to = {4.0, 5.0, 6.0};
  const CuttingCondition again = recorded(c);
  EXPECT_EQ(again.stamp, STAMP);
  EXPECT_EQ(again.kind, c.kind);
  EXPECT_EQ(again.name, c.name);
  EXPECT_EQ(again.material, c.material);
  EXPECT_EQ(again.tool_name, c.tool_name);
  EXPECT_EQ(again.tool.teeth, 4);
  EXPECT_EQ(again.tool.diameter, 12e-3);
  EXPECT_EQ(again.tool.helix, 0.5);
  EXPECT_EQ(again.tool.edge.corner_radius, 1e-3);
  EXPECT_EQ(again.tool.pitch, c.tool.pitch);
  ASSERT_EQ(again.engagement.bands.size(), 2u);
  EXPECT_EQ(again.engagement.bands[1].entry, 0.2);
  EXPECT_EQ(again.engagement.bands[1].top, 2e-3);
  EXPECT_EQ(again.tool.edge.edge_angle, 1.2);
  EXPECT_EQ(again.cut_time_before, 240.0);
  EXPECT_EQ(again.engagement.entry, 0.1);
  EXPECT_EQ(again.engagement.exit, 3.0);
  EXPECT_EQ(again.engagement.axial_depth, 2e-3);
  EXPECT_EQ(again.engagement.feed_per_tooth, 0.05e-3);
  EXPECT_EQ(again.spindle_speed, 900.0);
  EXPECT_EQ(again.steady_from, c.steady_from);
  EXPECT_EQ(again.steady_to, c.steady_to);
}

TEST(Conversions, ForceBlock) {
  ForceBlock block;
  block.stamp = STAMP;
  block.sample_rate = 10000.0;
  block.first_index = 77;
  block.force = {{{1.0, 2.0}, {3.0, 4.0}, {5.0, 6.0}}};
  block.status = ForceBlock::Status::settling;
  const ForceBlock again = recorded(block);
  EXPECT_EQ(again.stamp, STAMP);
  EXPECT_EQ(again.sample_rate, 10000.0);
  EXPECT_EQ(again.first_index, 77u);
  EXPECT_EQ(again.force, block.force);
  EXPECT_EQ(again.status, block.status);
}

TEST(Conversions, FrfAndModes) {
  MeasuredFrf measured;
  measured.stamp = STAMP;
  measured.tool = "D12";
  measured.point = POINT_TOOL_TIP;
  measured.direction = "x";
  measured.frf.unit = "m/N";
  measured.frf.averages = 10;
  measured.frf.frequency = {1.0, 2.0};
  measured.frf.value = {{1e-8, -2e-8}, {3e-8, 4e-8}};
  measured.frf.coherence = {0.99, 1.0};
  const MeasuredFrf again = recorded(measured);
  EXPECT_EQ(again.stamp, STAMP);
  EXPECT_EQ(again.tool, "D12");
  EXPECT_EQ(again.point, POINT_TOOL_TIP);
  EXPECT_EQ(again.direction, "x");
  EXPECT_EQ(again.frf.unit, "m/N");
  EXPECT_EQ(again.frf.averages, 10);
  EXPECT_EQ(again.frf.frequency, measured.frf.frequency);
  EXPECT_EQ(again.frf.value, measured.frf.value);
  EXPECT_EQ(again.frf.coherence, measured.frf.coherence);
  ASSERT_EQ(again.frf.std_dev.size(), 2u);  // unknown: NaN
  EXPECT_TRUE(std::isnan(again.frf.std_dev[0]));

  MeasuredModes modes;
  modes.stamp = STAMP;
  modes.tool = "D12";
  modes.point = POINT_FORCE_SENSOR;
  modes.direction = "y";
  modes.unit = "1";
  modes.model.modes = {{930.0, 0.03, 2e-8, 1.0, 2.0, 3.0}};
  modes.model.direct = 1e-9;
  modes.model.direct_std = 2e-10;
  modes.relative_error = 0.04;
  const MeasuredModes same = recorded(modes);
  EXPECT_EQ(same.tool, "D12");
  EXPECT_EQ(same.unit, "1");
  ASSERT_EQ(same.model.modes.size(), 1u);
  EXPECT_EQ(same.model.modes[0].frequency, 930.0);
  EXPECT_EQ(same.model.modes[0].damping_ratio, 0.03);
  EXPECT_EQ(same.model.modes[0].gain, 2e-8);
  EXPECT_EQ(same.model.modes[0].gain_std, 3.0);
  EXPECT_EQ(same.model.direct, 1e-9);
  EXPECT_EQ(same.model.direct_std, 2e-10);
  EXPECT_EQ(same.relative_error, 0.04);
}

TEST(Conversions, Coefficients) {
  CoefficientSet set;
  set.stamp = STAMP;
  set.tool = "D12";
  set.material = "C45";
  set.source = "force";
  set.value = {1.0, 2.0, 3.0, 4.0, 5.0, 6.0};
  set.std_dev = {7.0, 8.0, 9.0, 10.0, 11.0, 12.0};
  set.friction_viscous = 0.5;
  set.tests = 9;
  const CoefficientSet again = recorded(set);
  EXPECT_EQ(again.stamp, STAMP);
  EXPECT_EQ(again.source, "force");
  EXPECT_EQ(again.value.ktc, 1.0);
  EXPECT_EQ(again.value.kac, 3.0);
  EXPECT_EQ(again.value.kae, 6.0);
  EXPECT_EQ(again.std_dev.krc, 8.0);
  EXPECT_EQ(again.std_dev.kre, 11.0);
  EXPECT_EQ(again.friction_viscous, 0.5);
  EXPECT_TRUE(std::isnan(again.friction_coulomb));
  EXPECT_EQ(again.tests, 9);
}

TEST(Conversions, ChartAndForceCurve) {
  StabilityChart chart;
  chart.stamp = STAMP;
  chart.tool = "D12";
  chart.material = "C45";
  chart.method = "collocation";
  chart.entry = 0.5;
  chart.exit = 3.0;
  chart.feed_per_tooth = 1e-4;
  chart.limit = {{900.0, 950.0}, {1e-3, std::numeric_limits<double>::infinity()}, {700.0, NOT_A_NUMBER}};
  chart.torque_depth_limit = {5e-3, 6e-3};
  chart.power_depth_limit = {7e-3, 8e-3};
  chart.absolute_depth_limit = 5e-4;
  chart.recommended = {{900.0, 1e-3, 2e-3, 700.0, 1.0, 2.0, 3.0}, {910.0, 1e-3, 2e-3, 700.0, 1.0, 2.0, 4.0}};
  chart.unstable = {{950.0, 3e-3, 2e-3, 710.0, 5.0, 6.0, 7.0}};
  const StabilityChart again = recorded(chart);
  EXPECT_EQ(again.method, "collocation");
  EXPECT_EQ(again.entry, 0.5);
  EXPECT_EQ(again.exit, 3.0);
  EXPECT_EQ(again.limit.spindle_speed, chart.limit.spindle_speed);
  EXPECT_EQ(again.limit.depth, chart.limit.depth);
  EXPECT_TRUE(std::isnan(again.limit.chatter_frequency[1]));
  EXPECT_EQ(again.torque_depth_limit, chart.torque_depth_limit);
  EXPECT_EQ(again.power_depth_limit, chart.power_depth_limit);
  EXPECT_EQ(again.absolute_depth_limit, 5e-4);
  ASSERT_EQ(again.recommended.size(), 2u);
  EXPECT_EQ(again.recommended[1].material_removal_rate, 4.0);
  ASSERT_EQ(again.unstable.size(), 1u);
  EXPECT_EQ(again.unstable[0].chatter_frequency, 710.0);

  IdentifiedForceCurves found;
  found.stamp = STAMP;
  found.tool = "D12";
  found.teeth = 4;
  found.cuts = {"a", "b"};
  found.curves.tangential = {{0.0, 1e-4, 2e-4}, {0.0, 1.0, 2.0, 3.0, 4.0}, {0.1, 0.2, 0.3}};
  found.curves.radial = {{0.0, 1e-4, 2e-4}, {0.0, 0.5, 1.0, 1.5, 2.0}, {0.1, 0.1, 0.1}};
  found.curves.rms = 3.0;
  const IdentifiedForceCurves same = recorded(found);
  EXPECT_EQ(same.cuts, found.cuts);
  EXPECT_EQ(same.teeth, 4);
  EXPECT_EQ(same.curves.radial.knots, found.curves.radial.knots);
  EXPECT_EQ(same.curves.tangential.value, found.curves.tangential.value);
  EXPECT_EQ(same.curves.radial.std_dev, found.curves.radial.std_dev);
  EXPECT_EQ(same.curves.rms, 3.0);
}

TEST(Conversions, AMessageThatContradictsItselfIsRefusedByTheNameOfItsField) {
  plain::CncState state;
  state.axes = {"X"};
  EXPECT_THAT([&] { fromMsg(state); }, ThrowsMessage<Error>(HasSubstr("position: 0 values, expected 1")));
  plain::SampleBlock block;
  EXPECT_THAT([&] { fromMsg(block); }, ThrowsMessage<Error>(HasSubstr("sample_rate")));
  block.sample_rate = 1.0;
  block.channels = block.units = {"a", "b"};
  block.samples = {1.0, 2.0, 3.0};
  EXPECT_THAT([&] { fromMsg(block); }, ThrowsMessage<Error>(HasSubstr("3 values do not fill 2 channels")));
  SpindleAngle before_1970;
  before_1970.stamp = -1.0;
  EXPECT_THROW(toPlain(before_1970), Error);
}

TEST(Conversions, StampsAreStableFromTheFirstConversionOn) {
  for (const double stamp : {0.0, 1e-9, 1763700000.1234567, 1763700000.9999999}) {
    const double once = toSec(toPlain(SpindleAngle{stamp, 0.0, 0.0}).header.stamp);
    EXPECT_NEAR(once, stamp, 2.5e-7);  // [s] that a double resolves there
    EXPECT_EQ(toSec(toPlain(SpindleAngle{once, 0.0, 0.0}).header.stamp), once);
  }
  EXPECT_EQ(toPlain(SpindleAngle{0.9999999999, 0.0, 0.0}).header.stamp.sec, 1u);  // rounds up
}

TEST(Conversions, AGoalWithoutStampTakesTheTimeOfItsReception) {
  plain::MeasureFrfGoal goal;
  goal.hits = 4000000000U;
  EXPECT_EQ(goalFromMsg(goal, 12.5).stamp, 12.5);
  EXPECT_EQ(goalFromMsg(goal, 12.5).hits, 1000000);
  goal.header.stamp = {7, 0};
  EXPECT_EQ(goalFromMsg(goal, 12.5).stamp, 7.0);
}

}  // namespace
}  // namespace smartmill
