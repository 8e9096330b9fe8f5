#include <cmath>
#include <filesystem>
#include <optional>
#include <type_traits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rosbag/bag.h>

#include "../cut_simulator.h"
#include "../session.h"
#include "recordings/bag_identification.h"
#include "smartmill_core/names.h"
#include "smartmill_core/testing/shipped_parameters.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_msgs/CoefficientPrior.h"
#include "smartmill_msgs/IdentifyCoefficientsActionGoal.h"
#include "smartmill_ros/conversions.h"

namespace smartmill::loadmeter {
namespace {

using ::testing::HasSubstr;

/// Writes a session to a bag and passes the same messages to an identification, including goals.
class Recorder {
 public:
  explicit Recorder(const std::string& file) : bag_(file, rosbag::bagmode::Write), direct(model(), {}) {
    direct.outputs().result = [this](const IdentifyResult& result) {
      if (!result.reset) results.push_back(result);
    };
    session.state = [this](const CncState& s) { write("/smartmill/cnc/state", s); };
    session.load = [this](const LoadSample& l) {
      write("/smartmill/cnc/load", l);
      if (l.stamp < next_temperature_) return;
      next_temperature_ = l.stamp + 5.0;
      write("/smartmill/machine/temperature",
            MachineTemperature{l.stamp, {"X"}, {300.0}, {300.0}, 300.0 + 0.1 * (l.stamp - 1000.0)});
    };
    session.condition = [this](const CuttingCondition& c) { write("/smartmill/cut/condition", c); };
  }

  void goal(bool reset) {
    smartmill_msgs::IdentifyCoefficientsActionGoal m;
    m.goal.header.stamp = fromSec(session.now());
    m.goal.tool = "endmill";
    m.goal.material = "aluminium";
    m.goal.reset = reset;
    bag_.write("/smartmill/loadmeter/identify_coefficients/goal", m.goal.header.stamp, m);
    IdentifyGoal goal{toSec(m.goal.header.stamp), m.goal.tool, m.goal.material, reset, 0};
    knowledge_.use(&goal);
    direct.handle(goal);
  }

  void prior(const CoefficientSet& set, double covariance) {
    smartmill_msgs::CoefficientPrior m;
    m.header.stamp = fromSec(session.now());
    m.coefficients = toMsg(set);
    m.ktc_kte_covariance = covariance;
    bag_.write("/smartmill/material/prior", m.header.stamp, m);
    knowledge_.set(toSec(m.header.stamp), fromMsg(m.coefficients), covariance);
  }

  void inspect(const InspectionFeature& feature) { write("/smartmill/inspection/feature", feature); }

  Session session{21, 2e-4};
  std::vector<IdentifyResult> results;

 private:
  template <typename Input>
  void write(const std::string& topic, const Input& input) {
    const auto message = toMsg(input);
    bag_.write(topic, message.header.stamp, message);
    direct.handle(fromMsg(message));
  }

  rosbag::Bag bag_;
  PriorKnowledge knowledge_;
  double next_temperature_ = 0.0;  // [s]

 public:
  LoadMeterIdentification direct;
};

TEST(Bag, givesTheResultsOfTheLiveRunToTheLastDigit) {
  const TemporaryFolder folder;
  const std::string file = folder.file("run.bag");
  std::vector<IdentifyResult> live;
  std::vector<ForceEstimate> forces, played;
  {
    Recorder recorder(file);
    recorder.direct.outputs().force = [&](const ForceEstimate& f) { forces.push_back(f); };
    recorder.session.air(9000.0, 2.0);
    recorder.goal(true);
    runStandardTests(recorder.session);
    recorder.goal(false);
    live = recorder.results;
  }
  BagListeners listeners;
  listeners.force = [&](const ForceEstimate& f) { played.push_back(f); };
  const std::vector<IdentifyResult> found = identifyFromBag(file, model(), {}, listeners);
  ASSERT_EQ(live.size(), 1u);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].message, live[0].message);
  EXPECT_EQ(found[0].coefficients.value.ktc, live[0].coefficients.value.ktc);
  EXPECT_EQ(found[0].coefficients.std_dev.kte, live[0].coefficients.std_dev.kte);
  EXPECT_EQ(found[0].coefficients.stamp, live[0].coefficients.stamp);
  EXPECT_GT(found[0].record.temperature, 300.0);
  EXPECT_EQ(found[0].record.temperature, live[0].record.temperature);
  ASSERT_EQ(played.size(), 3u);
  ASSERT_EQ(forces.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(played[i].text(), forces[i].text());

  // A truncated bag is refused in one line.
  std::filesystem::resize_file(file, std::filesystem::file_size(file) / 2);
  const std::string message = errorOf([&] { identifyFromBag(file, model(), {}); });
  EXPECT_THAT(message, HasSubstr("run.bag"));
  EXPECT_EQ(message.find('\n'), std::string::npos);
}

TEST(Bag, inspectedDimensionsAreThoseOfTheLiveRun) {
  const TemporaryFolder folder;
  std::vector<InspectionResult> live, found;
  CuttingCondition cut;
  {
    Recorder recorder(folder.file("run.bag"));
    recorder.direct.outputs().inspected = [&](const InspectionResult& one) { live.push_back(one); };
    const auto write = recorder.session.condition;
    recorder.session.condition = [&](const CuttingCondition& c) {
      if (c.kind == CuttingCondition::Kind::cut) cut = c;
      write(c);
    };
    recorder.goal(true);
    runStandardTests(recorder.session);
    InspectionFeature step;
    step.stamp = recorder.session.now() + 600.0;
    step.condition = cut.name;
    step.kind = STEP_POSITION;
    step.direction = "z";
    step.nominal = 0.0;
    step.measured = -12e-6;
    step.std_dev = 2e-6;
    recorder.inspect(step);
    step.condition = "unheard of";
    recorder.inspect(step);
    recorder.goal(false);
  }
  BagListeners listeners;
  listeners.inspected = [&](const InspectionResult& one) { found.push_back(one); };
  identifyFromBag(folder.file("run.bag"), model(), {}, listeners);
  ASSERT_EQ(live.size(), 2u);
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(found[0].refusal, "");
  EXPECT_EQ(found[0].record.tool, cut.tool_name);
  EXPECT_EQ(found[0].record.cut_time, live[0].record.cut_time);
  EXPECT_NEAR(found[0].record.cut_time, cut.stamp, 1e-6);  // a stamp has nanoseconds
  // The spindle motor warms up by 0.1 K/s from 300 K at 1000 s.
  EXPECT_NEAR(found[0].record.machine_temperature, 300.0 + 0.1 * (cut.stamp - 1000.0), 1.0);
  EXPECT_EQ(found[0].record.machine_temperature, live[0].record.machine_temperature);
  EXPECT_EQ(found[0].record.measured, live[0].record.measured);
  EXPECT_THAT(found[1].refusal, HasSubstr("'unheard of': no cut of this name"));
  EXPECT_EQ(found[1].refusal, live[1].refusal);
}

TEST(Bag, containsTheKnowledgeThatTheLiveRunBeganWith) {
  const TemporaryFolder folder;
  std::vector<IdentifyResult> live;
  {
    Recorder recorder(folder.file("run.bag"));
    recorder.goal(true);
    for (const double rpm : {2000.0, 8000.0}) recorder.session.air(rpm, 2.0);
    CoefficientSet stored;
    stored.tool = "endmill", stored.material = "aluminium", stored.tests = 3;
    stored.value = stored.std_dev = NOT_IDENTIFIED;
    stored.value.ktc = TRUTH.ktc, stored.std_dev.ktc = 0.01 * TRUTH.ktc;
    stored.value.kte = TRUTH.kte, stored.std_dev.kte = 0.03 * TRUTH.kte;
    recorder.prior(stored, -0.8 * stored.std_dev.ktc * stored.std_dev.kte);
    for (const double feed : {4e-5, 8e-5}) recorder.session.slot(6100.0, feed, 4.0);
    recorder.goal(false);
    live = recorder.results;
  }
  const auto found = identifyFromBag(folder.file("run.bag"), model(), {});
  ASSERT_EQ(live.size(), 1u);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(live[0].coefficients.source, "load_meter and database") << live[0].message;
  EXPECT_EQ(found[0].message, live[0].message);
  EXPECT_EQ(found[0].coefficients.value.ktc, live[0].coefficients.value.ktc);
}

TEST(Bag, containsTheSpindleLoadOfAServoRecord) {
  const TemporaryFolder folder;
  const std::string file = folder.file("servo.bag");
  {
    rosbag::Bag bag(file, rosbag::bagmode::Write);
    for (int k = 0; k < 200; ++k) {
      SampleBlock block;
      block.stamp = 100.0 + 0.01 * k;
      block.sample_rate = 1000.0;
      block.first_index = static_cast<std::uint64_t>(10 * k);
      block.channels = {"spindle_load", "sequence"};
      block.units = {"1", "1"};
      for (int i = 0; i < 10; ++i) block.samples.insert(block.samples.end(), {0.25, k < 50 ? 1.0 : 100.0});
      const auto message = toMsg(block);
      bag.write("/smartmill/daq/servo", message.header.stamp, message);
    }
  }
  ServoTest test;
  test.block = 100;
  test.test.name = "slot";
  const auto records = servoLoadFromBag(file).records({test}, 8.0, file);
  ASSERT_EQ(records.size(), 1u);
  EXPECT_EQ(records[0].record.column("load_meter"), std::vector<double>(1500, 2.0));  // [V]
  EXPECT_NEAR(*records[0].test.start_time, 0.5, 1e-6);
  const std::string other = folder.file("other.bag");
  {
    Recorder recorder(other);
    recorder.session.air(9000.0, 1.0);
  }
  EXPECT_THAT(errorOf([&] { servoLoadFromBag(other); }), HasSubstr("other.bag: expected topic daq/servo"));
}

TEST(Bag, withoutAGoalIsIdentifiedAtItsEnd) {
  const TemporaryFolder folder;
  {
    Recorder recorder(folder.file("run.bag"));
    runStandardTests(recorder.session);
  }
  const auto found = identifyFromBag(folder.file("run.bag"), model(), {});
  ASSERT_EQ(found.size(), 1u);
  EXPECT_NEAR(found[0].coefficients.value.ktc, TRUTH.ktc, 0.01 * TRUTH.ktc);
}

TEST(Bag, runoutIsEstimatedAsInTheLiveRun) {
  const TemporaryFolder folder;
  std::vector<IdentifyResult> live;
  {
    Recorder recorder(folder.file("run.bag"));
    recorder.session.ripple = true;
    recorder.session.runout = 9e-6;
    recorder.session.runout_angle = 0.7;
    for (const double rpm : {3000.0, 6000.0, 9000.0, 12000.0}) recorder.session.air(rpm, 2.0);
    for (const double feed : {5e-5, 1e-4, 1.5e-4, 2e-4}) recorder.session.slot(4100.0, feed, 4.0);
    recorder.goal(false);
    live = recorder.results;
  }
  const auto found = identifyFromBag(folder.file("run.bag"), model(), {});
  ASSERT_EQ(found.size(), 1u);
  ASSERT_EQ(live.size(), 1u);
  EXPECT_EQ(found[0].message, live[0].message);
  const CoefficientSet& k = found[0].coefficients;
  EXPECT_NEAR(k.value.ktc, TRUTH.ktc, 0.005 * TRUTH.ktc);
  EXPECT_NEAR(k.value.ktc, TRUTH.ktc, 2.0 * k.std_dev.ktc);
  EXPECT_THAT(found[0].message, HasSubstr("; runout of "));
}

TEST(Bag, givesTheForceCurveOfTheLiveRunToTheLastDigit) {
  const TemporaryFolder folder;
  const std::string file = folder.file("run.bag");
  ForceCurvePipeline live({}, 0.05);
  std::optional<IdentifiedForceCurves> live_curves;
  live.identification().onCurves([&](const IdentifiedForceCurves& found) { live_curves = found; });
  {
    rosbag::Bag bag(file, rosbag::bagmode::Write);
    const auto write = [&](const std::string& topic, const auto& message) {
      bag.write("/smartmill/" + topic, message.header.stamp, message);
      live.push(fromMsg(message));
    };
    CutSimulator shop([&](const auto& input) {
      using Input = std::decay_t<decltype(input)>;
      if constexpr (std::is_same_v<Input, ForceBlock>) {
        write(names::FORCE_COMPENSATED, toMsg(input, "machine"));
      } else if constexpr (std::is_same_v<Input, SpindleAngle>) {
        write(names::SPINDLE_ANGLE, toMsg(input));
      } else if constexpr (std::is_same_v<Input, CncState>) {
        write(names::CNC_STATE, toMsg(input));
      } else {
        write(names::CUTTING_CONDITION, toMsg(input));
      }
    });
    for (const double feed : {5e-5, 1e-4, 2e-4}) shop.cut(std::to_string(feed), feed);
    shop.end();
  }
  live.flush();
  const std::vector<IdentifiedForceCurves> offline = curvesFromBag(file, {});
  ASSERT_TRUE(live_curves);
  ASSERT_EQ(offline.size(), 1u);
  // Also through the message.
  const IdentifiedForceCurves sent = fromMsg(toMsg(*live_curves));
  for (const IdentifiedForceCurves* found : {&offline[0], &sent}) {
    EXPECT_EQ(found->curves.tangential.value, live_curves->curves.tangential.value);
    EXPECT_EQ(found->curves.radial.std_dev, live_curves->curves.radial.std_dev);
    EXPECT_EQ(found->cuts, live_curves->cuts);
    EXPECT_EQ(found->material, "steel");
  }
  EXPECT_NEAR(live_curves->curves.tangential.at(1e-4), KTC * 1e-4 + KTE, 0.005 * (KTC * 1e-4 + KTE));

  smartmill_msgs::ForceCurve falling = toMsg(*live_curves);
  falling.radial[3] = 0.5 * falling.radial[2];
  EXPECT_THAT(errorOf([&] { fromMsg(falling); }), HasSubstr("radial: the coefficients must not fall"));
}

TEST(Bag, withoutForcesGivesNoForceCurveAndNamesTheReason) {
  const TemporaryFolder folder;
  {
    Recorder recorder(folder.file("run.bag"));
    runStandardTests(recorder.session);
  }
  EXPECT_THAT(errorOf([&] { curvesFromBag(folder.file("run.bag"), {}); }),
              HasSubstr("run.bag: expected topic force/compensated"));
}

TEST(Parameters, theShippedFileHasTheDefaultsAndErrorsAreNamed) {
  expectShipped<NodeParameters>(std::string(LAUNCH_CONFIG_FOLDER) + "/loadmeter.yaml",
                                "smartmill_loadmeter loadmeter_node");
  EXPECT_NO_THROW(NodeParameters().validate());
  const TemporaryFolder folder;
  const auto messageOf = [&](const std::string& text) {
    return errorOf(
        [&] { ParameterReader::fromFile(folder.write("p.yaml", text)).readAll<NodeParameters>(); });
  };
  EXPECT_THAT(messageOf("path_tolerance: 1e-3\n"), HasSubstr("path_tolerance"));
  EXPECT_THAT(messageOf("path_tolerance: -1.0\n"), HasSubstr("path_tolerance: -1 is out of range"));
  EXPECT_THAT(messageOf("settle: 8.0\n"), HasSubstr("settle"));
}

}  // namespace
}  // namespace smartmill::loadmeter
