#include <cmath>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include <geometry_msgs/Quaternion.h>
#include <gtest/gtest.h>
#include <rosbag/bag.h>

#include "smartmill_core/error.h"
#include "smartmill_core/frames.h"
#include "smartmill_core/names.h"
#include "smartmill_core/parameters/parameter_reader.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_recording/recording_reader.h"
#include "smartmill_ros/conversions.h"

namespace smartmill {
namespace {

SampleBlock block() {
  SampleBlock b;
  b.stamp = toSec(ros::Time(1763700000, 123456789));
  b.sample_rate = 25600.0;
  b.first_index = 1ULL << 40;
  b.channels = {"fx", "fy"};
  b.units = {"N", "N"};
  b.samples = {1.0, 0.1, -3.25, 1e-17};
  return b;
}

TEST(Conversions, stampsAreStableAfterTheFirstConversion) {
  for (std::uint32_t ns : {0u, 1u, 123456789u, 999999999u}) {
    const double first = toSec(ros::Time(1763700000, ns));
    const double second = toSec(fromSec(first));
    EXPECT_EQ(first, second);
    EXPECT_NEAR(first - 1763700000.0, ns * 1e-9, 1.3e-7);  // half the resolution of a double at this value
  }
  EXPECT_THROW(fromSec(NAN), Error);
  EXPECT_THROW(fromSec(-1.0), Error);
}

TEST(Conversions, aBlockIsUnchangedAfterTheRoundTrip) {
  const SampleBlock b = block(), back = fromMsg(toMsg(b, "dynamometer"));
  EXPECT_EQ(back.stamp, b.stamp);
  EXPECT_EQ(back.first_index, b.first_index);
  EXPECT_EQ(back.samples, b.samples);
  EXPECT_EQ(back.channels, b.channels);
}

TEST(Conversions, inconsistentFieldsAreRefusedByName) {
  smartmill_msgs::SampleBlock m = toMsg(block());
  m.samples.pop_back();
  EXPECT_NE(errorOf([&] { fromMsg(m); }).find("samples"), std::string::npos);
  m = toMsg(block());
  m.sample_rate = 0.0;
  EXPECT_NE(errorOf([&] { fromMsg(m); }).find("sample_rate"), std::string::npos);
  smartmill_msgs::ForceBlock f;
  f.sample_rate = 1.0;
  f.fx = {1.0};
  EXPECT_NE(errorOf([&] { fromMsg(f); }).find("fy"), std::string::npos);
  smartmill_msgs::CncState s;
  s.axes = {"X"};
  EXPECT_NE(errorOf([&] { fromMsg(s); }).find("position"), std::string::npos);
}

TEST(Conversions, conditionAndModesAreUnchangedAfterTheRoundTrip) {
  CuttingCondition c;
  c.stamp = 10.5;
  c.kind = CuttingCondition::Kind::cut;
  c.tool = {4, 0.016, 0.5, {}};
  c.engagement = {0.1, 3.0, 2e-3, 5e-5};
  c.steady_to = {{1, 2, 3}};
  const CuttingCondition back = fromMsg(toMsg(c));
  EXPECT_EQ(back.engagement.exit, 3.0);
  EXPECT_EQ(back.engagement.feed_per_tooth, 5e-5);
  EXPECT_EQ(back.steady_to, c.steady_to);
  EXPECT_EQ(back.tool.teeth, 4);
  MeasuredModes modes;
  modes.stamp = 1.0;
  modes.model.modes = {{1000.0, 0.03, 1e-8, 1.0, 0.001, 1e-10}};
  modes.model.direct = 2e-9;
  EXPECT_EQ(fromMsg(toMsg(modes)).model.modes[0].gain_std, 1e-10);
  MeasuredFrf frf;
  frf.frf.frequency = {1.0, 2.0};
  frf.frf.value = {{1, 2}, {3, 4}};
  const smartmill_msgs::Frf message = toMsg(frf);
  EXPECT_TRUE(std::isnan(message.coherence.at(1)));  // unknown, not zero
  EXPECT_EQ(fromMsg(message).frf.value, frf.frf.value);
}

TEST(Conversions, aChartIsUnchangedAfterTheRoundTrip) {
  StabilityChart chart;
  chart.stamp = toSec(ros::Time(1763700000, 5));
  chart.tool = "end_mill";
  chart.material = "aluminium";
  chart.method = "collocation";
  chart.entry = 0.5;
  chart.exit = 3.0;
  chart.feed_per_tooth = 6e-5;
  chart.limit = {{900.0, 1000.0}, {1e-3, std::numeric_limits<double>::infinity()}, {812.0, 813.0}};
  chart.torque_depth_limit = {2e-3, 3e-3};
  chart.power_depth_limit = {4e-3, 5e-3};
  chart.absolute_depth_limit = 1e-3;
  chart.recommended = {{900.0, 0.8e-3, 1e-3, 812.0, 3.0, 2700.0, 1e-6}};
  chart.unstable = {{950.0, 2e-3, 1e-3, 812.5, 6.0, 5700.0, 2e-6}, {}};
  smartmill_msgs::StabilityChart message = toMsg(chart);
  EXPECT_EQ(message.depth_limit, chart.limit.depth);
  EXPECT_EQ(message.exit_angle, 3.0);
  EXPECT_EQ(message.unstable[0].power, 5700.0);
  const StabilityChart back = fromMsg(message);
  EXPECT_EQ(back.limit.chatter_frequency, chart.limit.chatter_frequency);
  EXPECT_EQ(back.absolute_depth_limit, chart.absolute_depth_limit);
  ASSERT_EQ(back.recommended.size(), 1u);
  EXPECT_EQ(back.recommended[0].material_removal_rate, 1e-6);
  message.power_depth_limit.pop_back();
  EXPECT_NE(errorOf([&] { fromMsg(message); }).find("power_depth_limit: 1 values, expected 2"),
            std::string::npos);
}

TEST(Frames, quarterTurnAboutZ) {
  geometry_msgs::Quaternion q;
  q.z = q.w = std::sqrt(0.5);
  const auto turned = frames::rotate(frames::rotationMatrix(q), {1.0, 0.0, 5.0});
  EXPECT_NEAR(turned[0], 0.0, 1e-12);
  EXPECT_NEAR(turned[1], 1.0, 1e-12);
  EXPECT_NEAR(turned[2], 5.0, 1e-12);
  q.w = 0.0;
  EXPECT_THROW(frames::rotationMatrix(q), Error);
}

class Files : public ::testing::Test {
 protected:
  TemporaryFolder folder_;
};

TEST_F(Files, parametersHaveTheTypesOfRoslaunch) {
  const std::string file =
      folder_.write("p.yaml", "a: 1.0e-2\nb: 3\nc: true\nd: text\ne: [1.0, 2]\nf: 1e-2\n");
  ParameterReader reader = ParameterReader::fromFile(file);
  double a = 0.0, b = 0.0, f = 0.0;
  bool c = false;
  std::string d;
  std::vector<double> e;
  reader.read("a", a);
  reader.read("b", b);  // an integer is accepted as a number
  reader.read("c", c);
  reader.read("d", d);
  reader.read("e", e);
  EXPECT_EQ(a, 0.01);
  EXPECT_EQ(b, 3.0);
  EXPECT_TRUE(c);
  EXPECT_EQ(d, "text");
  EXPECT_EQ(e, (std::vector<double>{1.0, 2.0}));
  const std::string message = errorOf([&] { reader.read("f", f); });
  EXPECT_NE(message.find("'1e-2' is a string"), std::string::npos) << message;
  EXPECT_NE(message.find("f"), std::string::npos);
}

TEST_F(Files, unknownMissingAndWrongParametersAreRefused) {
  ParameterReader reader = ParameterReader::fromFile(folder_.write("p.yaml", "hits: 2.5\nrubbish: 1\n"));
  int hits = 0;
  EXPECT_NE(errorOf([&] { reader.read("hits", hits); }).find("integer"), std::string::npos);
  EXPECT_NE(errorOf([&] { reader.require("gone", hits); }).find("gone is missing"), std::string::npos);
  EXPECT_NE(errorOf([&] { reader.finish(); }).find("rubbish is unknown"), std::string::npos);
  EXPECT_THROW(ParameterReader::fromFile(folder_.file("none.yaml")), Error);
  EXPECT_THROW(ParameterReader::fromFile(folder_.write("bad.yaml", "a: [1\n")), Error);
}

TEST_F(Files, bagsAreReadInOrderAndDamagedOnesRefused) {
  const std::string path = folder_.file("a.bag");
  {
    rosbag::Bag bag(path, rosbag::bagmode::Write);
    for (int i = 0; i < 200; ++i) {
      smartmill_msgs::SampleBlock m = toMsg(block());
      m.first_index = static_cast<std::uint64_t>(i);
      bag.write(names::absolute(names::DYNAMOMETER), ros::Time(100.0 + i), m);
    }
  }
  RecordingReader reader(path);
  std::vector<std::uint64_t> seen;
  reader.on<SampleBlock>(names::DYNAMOMETER,
                         [&](const SampleBlock& m, double) { seen.push_back(m.first_index); });
  reader.run();
  ASSERT_EQ(seen.size(), 200u);
  EXPECT_EQ(seen.back(), 199u);
  EXPECT_TRUE(reader.has(names::DYNAMOMETER));
  EXPECT_FALSE(reader.has(names::HAMMER));
  EXPECT_NEAR(reader.duration(), 199.0, 1e-9);

  std::filesystem::resize_file(path, std::filesystem::file_size(path) / 2);
  const std::string message = errorOf([&] {
    RecordingReader cut(path);
    cut.run();
  });
  EXPECT_NE(message.find("a.bag"), std::string::npos) << message;
  EXPECT_EQ(message.find('\n'), std::string::npos);
  EXPECT_THROW(RecordingReader(folder_.file("none.bag")), Error);
  EXPECT_THROW(RecordingReader(folder_.write("text.bag", "no bag at all")), Error);
}

}  // namespace
}  // namespace smartmill
