#include "../../src/report/session_bag.h"

#include <cmath>
#include <fstream>

#include <gtest/gtest.h>

#include "smartmill_core/names.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"
#include "smartmill_recording/recording_writer.h"

namespace smartmill::report {
namespace {

constexpr double SPEED = 1000.0;  // [rad/s]
constexpr double RATE = 25600.0;  // [Hz]

CuttingCondition condition(double stamp, CuttingCondition::Kind kind, const std::string& name = "") {
  CuttingCondition out;
  out.stamp = stamp;
  out.kind = kind;
  out.name = name;
  out.spindle_speed = SPEED;
  out.tool.teeth = 4;
  out.tool.diameter = 0.02;
  out.engagement = {0.0, units::PI, 1e-3, 1e-4};
  out.steady_from = {0.0, 0.0, 0.0};
  out.steady_to = {0.1, 0.0, 0.0};
  return out;
}

CncState state(double stamp, double x, double speed) {
  CncState out;
  out.stamp = stamp;
  out.connected = true;
  out.axes = {"X", "Y", "Z"};
  out.position = {x, 0.0, 0.0};
  out.distance_to_go = {0.0, 0.0, 0.0};
  out.spindle_speed = speed;
  return out;
}

ForceBlock force(double stamp, std::uint64_t first, double value) {
  ForceBlock out;
  out.stamp = stamp;
  out.sample_rate = RATE;
  out.first_index = first;
  for (auto& axis : out.force) axis.assign(256, value);
  return out;
}

/// A bag with one cut from 10 s to 12 s.
class SessionBag : public ::testing::Test {
 protected:
  SessionBag() {
    const auto writer = createRecording(file_, RecordingCompression::lz4);
    const auto put = [&](const std::string& topic, double time, const auto& data) {
      writer->write(topic, static_cast<std::uint64_t>(std::llround(1e9 * time)), data);
    };
    using Kind = CuttingCondition::Kind;
    put(names::CUTTING_CONDITION, 10.0, condition(10.0, Kind::cut, "resonance"));
    put(names::CUTTING_CONDITION, 10.01, condition(10.0, Kind::cut, "resonance"));  // latched: repeated
    put(names::CNC_STATE, 10.2, state(10.2, -0.05, SPEED));       // before the start of the steady path
    put(names::CNC_STATE, 10.4, state(10.4, 0.01, 0.9 * SPEED));  // not at speed yet
    put(names::CNC_STATE, 10.6, state(10.6, 0.02, SPEED));
    put(names::CNC_STATE, 11.4, state(11.4, 0.09, SPEED));
    put(names::CNC_STATE, 11.6, state(11.6, 0.12, SPEED));  // past its end
    put(names::FORCE_COMPENSATED, 10.91, force(10.9, 2560, 1.0));
    put(names::TRUE_FORCE, 10.91, force(10.9, 2560, 2.0));
    plain::ChatterState window;
    window.condition = "resonance";
    window.valid = 1;
    window.chatter = 1;
    window.frequency = 900.0;
    put(names::CHATTER_STATE, 11.0, window);
    window.valid = 0;
    put(names::CHATTER_STATE, 11.1, window);
    put(names::CUTTING_CONDITION, 12.0, condition(12.0, Kind::none));
    // Delayed output of the filter: received after the end of the cut, stamped before it.
    put(names::FORCE_COMPENSATED, 12.05, force(11.99, 30464, 1.0));
    put(names::FORCE_COMPENSATED, 12.06, force(12.0, 30720, 1.0));
    CoefficientSet set;
    set.stamp = 12.0;
    set.value = set.std_dev = NOT_IDENTIFIED;
    set.value.ktc = 8e8;
    put(names::COEFFICIENTS, 12.1, set);
    set.value.ktc = 8.1e8;
    put(names::TRUE_COEFFICIENTS, 12.1, set);
    StabilityChart chart;
    chart.stamp = 12.1;
    chart.limit = {{900.0, 1100.0}, {1e-3, 2e-3}, {500.0, 510.0}};
    chart.torque_depth_limit = chart.power_depth_limit = {4e-3, 3e-3};
    chart.absolute_depth_limit = 1e-3;
    put(names::STABILITY_CHART, 12.2, chart);
    writer->close();
  }

  TemporaryFolder folder_;
  const std::string file_ = folder_.file("session.bag");
};

TEST_F(SessionBag, CutsHaveTheirSteadySegmentAndForces) {
  const SessionRecording recording = readSession(file_, {});
  ASSERT_EQ(recording.cuts.size(), 1u);
  const RecordedCut& cut = recording.cuts[0];
  EXPECT_EQ(cut.condition.name, "resonance");
  EXPECT_NEAR(cut.ends, 12.0, 1e-6);
  EXPECT_NEAR(cut.steady_from, 10.6, 1e-6);
  EXPECT_NEAR(cut.steady_to, 11.4, 1e-6);
  ASSERT_EQ(cut.windows.size(), 1u);
  EXPECT_TRUE(cut.windows[0].chatter);
  EXPECT_EQ(cut.compensated.covered(0, 100000), std::make_pair(std::uint64_t{2560}, std::uint64_t{2816}));
  EXPECT_EQ(cut.compensated.axis(0, 30464, 30720).size(), 256u);
  EXPECT_THROW(cut.compensated.axis(0, 30464, 30721), Error);
  EXPECT_EQ(cut.truth.axis(2, 2560, 2561)[0], 2.0);
  EXPECT_TRUE(cut.raw.empty());
}

// A pipe transmits no count: its reader counts from the first sample it receives.
TEST_F(SessionBag, ForcesOfAnInstrumentWithACountOfItsOwnArePairedByStamps) {
  const std::string file = folder_.file("pipe.bag");
  const auto writer = createRecording(file, RecordingCompression::lz4);
  const auto put = [&](const std::string& topic, double time, const auto& data) {
    writer->write(topic, static_cast<std::uint64_t>(std::llround(1e9 * time)), data);
  };
  put(names::CUTTING_CONDITION, 10.0, condition(10.0, CuttingCondition::Kind::cut, "resonance"));
  constexpr std::uint64_t OWN = 1000000;
  for (std::uint64_t i = 0; i < 3; ++i) {
    const double stamp = 10.0 + 0.01 * static_cast<double>(i);
    put(names::TRUE_FORCE, stamp + 0.001, force(stamp, 256 * i, 2.0));
    // Stamps of a counted clock wander; the blocks stay adjacent.
    put(names::FORCE_COMPENSATED, stamp + 0.002,
        force(stamp + 1e-6 * static_cast<double>(i), OWN + 256 * i, static_cast<double>(i)));
  }
  writer->close();
  const SessionRecording recording = readSession(file, {});
  ASSERT_EQ(recording.cuts.size(), 1u);
  EXPECT_EQ(recording.cuts[0].compensated.covered(0, 10000),
            std::make_pair(std::uint64_t{0}, std::uint64_t{768}));
  EXPECT_EQ(recording.cuts[0].compensated.axis(0, 256, 257)[0], 1.0);
}

TEST_F(SessionBag, MeasuredAndTrueValuesAreSeparate) {
  const SessionRecording recording = readSession(file_, {});
  ASSERT_TRUE(recording.coefficients && recording.true_coefficients && recording.chart);
  EXPECT_DOUBLE_EQ(recording.coefficients->value.ktc, 8e8);
  EXPECT_DOUBLE_EQ(recording.true_coefficients->value.ktc, 8.1e8);
  const Report report = makeReport(recording, {});
  EXPECT_NEAR(report.sections.at(0).figures.at(0).percent(), -100.0 / 81.0, 1e-9);
  EXPECT_NEAR(recording.duration, 2.2, 1e-6);
}

TEST_F(SessionBag, ABrokenBagIsRefusedWithOneLine) {
  std::ifstream in(file_, std::ios::binary);
  const std::string all((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  const std::string cut = folder_.write("cut.bag", all.substr(0, all.size() / 2));
  const std::string message = errorOf([&] { readSession(cut, {}); });
  EXPECT_NE(message.find("cut.bag"), std::string::npos) << message;
  EXPECT_EQ(message.find('\n'), std::string::npos);
  EXPECT_NE(errorOf([&] { readSession(folder_.file("absent.bag"), {}); }), "");
}

}  // namespace
}  // namespace smartmill::report
