#include <actionlib/client/simple_action_client.h>
#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/WrenchStamped.h>
#include <ros/ros.h>

#include <cmath>
#include <filesystem>
#include <map>
#include <mutex>

#include <gtest/gtest.h>

#include "../session.h"
#include "smartmill_core/names.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_loadmeter/database/database.h"
#include "smartmill_msgs/CncState.h"
#include "smartmill_msgs/CuttingCoefficients.h"
#include "smartmill_msgs/CuttingCondition.h"
#include "smartmill_msgs/DiscoverActionResult.h"
#include "smartmill_msgs/FindCoefficients.h"
#include "smartmill_msgs/ForceEstimate.h"
#include "smartmill_msgs/IdentifyCoefficientsAction.h"
#include "smartmill_msgs/InspectionFeature.h"
#include "smartmill_msgs/LoadSample.h"
#include "smartmill_msgs/MachineTemperature.h"
#include "smartmill_msgs/SampleBlock.h"
#include "smartmill_msgs/SpindleHealth.h"
#include "smartmill_ros/conversions.h"
#include "smartmill_ros/follower.h"

namespace smartmill::loadmeter {
namespace {

using Client = actionlib::SimpleActionClient<smartmill_msgs::IdentifyCoefficientsAction>;

const ros::Duration PATIENCE(120.0);  // for a busy machine

smartmill_msgs::IdentifyCoefficientsGoal goalAt(double stamp, bool reset) {
  smartmill_msgs::IdentifyCoefficientsGoal goal;
  goal.header.stamp = fromSec(stamp);
  goal.tool = "endmill";
  goal.material = "aluminium";
  goal.reset = reset;
  return goal;
}

TEST(LoadMeterNode, identifiesPublishesAndAnswers) {
  ros::NodeHandle nh;
  ros::AsyncSpinner spinner(1);
  spinner.start();
  const auto states = nh.advertise<smartmill_msgs::CncState>("cnc/state", 0);
  const auto loads = nh.advertise<smartmill_msgs::LoadSample>("cnc/load", 0);
  const auto temperatures = nh.advertise<smartmill_msgs::MachineTemperature>("machine/temperature", 0);
  const auto currents = nh.advertise<smartmill_msgs::SampleBlock>("daq/motor_current", 0);
  geometry_msgs::WrenchStamped force;
  std::mutex force_lock;
  const boost::function<void(const geometry_msgs::WrenchStamped&)> take = [&](const auto& m) {
    const std::lock_guard<std::mutex> guard(force_lock);
    force = m;
  };
  const auto forces = nh.subscribe<geometry_msgs::WrenchStamped>("force/motor_current", 10, take);
  const auto conditions = nh.advertise<smartmill_msgs::CuttingCondition>("cut/condition", 0, true);
  Client client("loadmeter/identify_coefficients", false);
  ASSERT_TRUE(client.waitForServer(PATIENCE));
  Followers node({names::absolute("loadmeter")});
  node.begin();
  for (const ros::Publisher& publisher : {states, loads, temperatures, currents, conditions})
    node.expect(publisher);
  node.expect(forces);
  // A goal is not ordered with the streams: it must arrive before they continue.
  const auto send = [&](double stamp, bool reset) {
    client.sendGoal(goalAt(stamp, reset));
    node.settle();
  };

  Session session(4, 2e-4);
  session.state = [&](const CncState& s) { node.publish(states, toMsg(s)); };
  double next_temperature = 0.0;
  session.load = [&](const LoadSample& l) {
    node.publish(loads, toMsg(l));
    if (l.stamp < next_temperature) return;
    next_temperature = l.stamp + 5.0;
    node.publish(temperatures, toMsg(MachineTemperature{l.stamp, {"X"}, {300.0}, {300.0}, 310.0}));
  };
  session.cutting = {TRUTH.ktc, 420e6, 0.0, TRUTH.kte, 21e3, 0.0};
  session.currents = [&](const SampleBlock& b) { node.publish(currents, toMsg(b)); };
  session.condition = [&](const CuttingCondition& c) {
    node.publish(conditions, toMsg(c));
    node.settle();
  };

  // A discarded plan has no effect.
  session.air(9000.0, 2.0);
  send(session.now(), true);
  session.air(2000.0, 0.2);
  ASSERT_TRUE(client.waitForResult(PATIENCE));
  EXPECT_EQ(client.getResult()->code, smartmill_msgs::IdentifyCoefficientsResult::OK);

  send(session.now(), false);
  session.air(2000.0, 0.2);
  ASSERT_TRUE(client.waitForResult(PATIENCE));
  EXPECT_EQ(client.getState(), actionlib::SimpleClientGoalState::ABORTED);
  EXPECT_EQ(client.getResult()->code, smartmill_msgs::IdentifyCoefficientsResult::TOO_FEW_TESTS);

  runStandardTests(session);
  send(session.now(), false);
  node.leave();
  // No more data: the node must not wait for a stream that has ended.
  ASSERT_TRUE(client.waitForResult(PATIENCE));
  const auto result = client.getResult();
  ASSERT_EQ(result->code, smartmill_msgs::IdentifyCoefficientsResult::OK) << result->message;
  EXPECT_NEAR(result->coefficients.ktc, TRUTH.ktc, 0.01 * TRUTH.ktc);
  EXPECT_NEAR(result->coefficients.kte, TRUTH.kte, 0.03 * TRUTH.kte);
  EXPECT_GT(result->coefficients.ktc_std, 0.0);
  EXPECT_TRUE(std::isnan(result->coefficients.krc));
  EXPECT_EQ(result->coefficients.test_count, 3u);
  EXPECT_NE(result->message.find("spindle motor at 310.0 K"), std::string::npos) << result->message;
  EXPECT_EQ(result->coefficients.source, "load_meter");

  // Latched: a late subscriber receives it.
  const auto latched =
      ros::topic::waitForMessage<smartmill_msgs::CuttingCoefficients>("material/coefficients", nh, PATIENCE);
  ASSERT_TRUE(latched);
  EXPECT_EQ(latched->ktc, result->coefficients.ktc);

  auto find = nh.serviceClient<smartmill_msgs::FindCoefficients>("loadmeter/find_coefficients");
  smartmill_msgs::FindCoefficients call;
  call.request.tool = "endmill";
  call.request.material = "aluminium";
  ASSERT_TRUE(find.call(call));
  EXPECT_EQ(call.response.code, smartmill_msgs::FindCoefficients::Response::OK);
  EXPECT_EQ(call.response.coefficients.ktc, result->coefficients.ktc);
  EXPECT_TRUE(call.response.of_pair);
  EXPECT_EQ(call.response.identifications, 1u);
  EXPECT_EQ(call.response.next_test.kind, smartmill_msgs::CuttingCondition::CUT);
  EXPECT_LT(call.response.next_std[0], result->coefficients.ktc_std);
  std::string database;
  ASSERT_TRUE(ros::param::get("/smartmill/loadmeter/database", database));
  EXPECT_EQ(call.response.database, database);
  call.request.material = "steel";
  ASSERT_TRUE(find.call(call));
  EXPECT_EQ(call.response.code, smartmill_msgs::FindCoefficients::Response::NOT_FOUND);
  EXPECT_TRUE(std::isnan(call.response.coefficients.ktc));
  EXPECT_NE(call.response.message.find("endmill / aluminium"), std::string::npos);

  // Cuts of half immersion at two feeds next to the stored identification; one of them is too deep.
  call.request.material = "aluminium";
  for (const double feed : {4e-5, 8e-5, 1.2e-4}) {
    CuttingCondition cut;
    cut.kind = CuttingCondition::Kind::cut;
    cut.name = "half_" + std::to_string(call.request.candidates.size());
    cut.tool = {3, 0.012, 0.6, {}};
    cut.spindle_speed = 600.0;
    cut.engagement = {0.0, 0.5 * units::PI, 2e-3, feed};
    cut.steady_to = {feed * 3 * 600.0 / units::TWO_PI * 2.0, 0.0, 0.0};
    call.request.candidates.push_back(toMsg(cut));
    call.request.cutting_time.push_back(3.0);
    call.request.stock.push_back(6e-3);
    call.request.depth_limit.push_back(feed > 1e-4 ? 1e-3 : 0.0);
  }
  call.request.stock_available = 0.1;
  call.request.target_std[0] = 2.0 * result->coefficients.ktc_std;
  call.request.target_std[1] = 2.0 * result->coefficients.kte_std;
  ASSERT_TRUE(find.call(call));
  EXPECT_NE(call.response.message.find("air cuts at 0 speeds"), std::string::npos) << call.response.message;
  for (const double speed : {300.0, 900.0}) {
    CuttingCondition air;
    air.kind = CuttingCondition::Kind::air;
    air.spindle_speed = speed;
    call.request.tests.push_back(toMsg(air));
  }
  ASSERT_TRUE(find.call(call));
  EXPECT_TRUE(call.response.target_reached) << call.response.message;
  EXPECT_EQ(call.response.chosen.size(), 2u) << "two feeds check the stored coefficients";
  ASSERT_EQ(call.response.excluded.size(), 1u);
  EXPECT_EQ(call.response.excluded[0],
            "half_2: 2.00 mm deep, expected at most 0.80 mm, 80 % of the stability limit");
  call.request.stock.pop_back();
  ASSERT_TRUE(find.call(call));
  EXPECT_NE(call.response.message.find("3 cuts, 3 cutting_time, 2 stock"), std::string::npos);
  EXPECT_TRUE(call.response.chosen.empty());

  node.begin();
  // After a pass in air the X drive gives the force of a cut; Y and Z are at rest and not observable.
  session.airPass(6000.0, 6e-5, 4.0);
  session.slot(6000.0, 6e-5, 4.0);
  session.air(2000.0, 0.3);
  const double truth = MechanisticForce({3, 0.012, units::radFromDeg(35.0), {}}, session.cutting,
                                        {0.0, units::PI, 0.002, 6e-5})
                           .mean()
                           .fx;
  geometry_msgs::WrenchStamped last;
  for (int i = 0; i < 2400; ++i) {
    ros::WallDuration(0.05).sleep();
    const std::lock_guard<std::mutex> guard(force_lock);
    last = force;
    if (std::isfinite(last.wrench.force.x) && last.wrench.force.x != 0.0) break;
  }
  EXPECT_NEAR(last.wrench.force.x, truth, 4.0);  // the calibration's scatter is 1 N
  EXPECT_TRUE(std::isnan(last.wrench.force.y));
  EXPECT_TRUE(std::isnan(last.wrench.force.z));

  // The estimator gives all three components of the same cut with their uncertainty.
  smartmill_msgs::ForceEstimate::ConstPtr estimate;
  for (int i = 0; i < 200 && !(estimate && estimate->header.stamp == last.header.stamp); ++i)
    estimate = ros::topic::waitForMessage<smartmill_msgs::ForceEstimate>(names::FORCE_ESTIMATE, nh, PATIENCE);
  ASSERT_TRUE(estimate && estimate->header.stamp == last.header.stamp);
  EXPECT_EQ(estimate->sources, (std::vector<std::string>{"load_meter", "motor_x"}));
  EXPECT_NEAR(estimate->mean.x, truth, 3.0 * estimate->mean_std.x);
  EXPECT_LT(estimate->mean_std.x, 0.1 * std::abs(truth));
  EXPECT_GT(estimate->mean_std.y, estimate->mean_std.x);
  EXPECT_GT(estimate->rms.y, 0.0);
}

// An explanation of a discovery is stored with its evidence; without an explanation nothing is stored.
TEST(LoadMeterNode, storesExplanations) {
  ros::NodeHandle nh;
  ros::AsyncSpinner spinner(1);
  spinner.start();
  const TemporaryFolder folder;
  folder.write("report.json", R"({"format": "smartmill-report/1", "verdict": "no_disagreement",
    "effects": [], "not_separable": [], "resembles": [], "suggested_test": null, "gaps": [],
    "gap": {"before": {"fit": 1.0, "heldout": 1.0}, "after": {"fit": 1.0, "heldout": 1.0}}})");
  const auto results = nh.advertise<smartmill_msgs::DiscoverActionResult>("discover/result", 0);
  for (int i = 0; i < 2400 && results.getNumSubscribers() == 0; ++i) ros::WallDuration(0.05).sleep();
  std::mutex lock;
  std::string kept;
  const boost::function<void(const diagnostic_msgs::DiagnosticArray&)> take = [&](const auto& m) {
    const std::lock_guard<std::mutex> guard(lock);
    for (const auto& status : m.status) {
      for (const auto& value : status.values) {
        if (value.key == "explanations stored") kept = value.value;
      }
    }
  };
  const auto diagnostics = nh.subscribe<diagnostic_msgs::DiagnosticArray>("/diagnostics", 10, take);
  smartmill_msgs::DiscoverActionResult result;
  result.header.stamp = ros::Time(1000.0);
  results.publish(result);
  result.result.verdict = "no_disagreement";
  result.result.report = folder.file("");
  results.publish(result);
  results.publish(result);  // repeated
  for (int i = 0; i < 2400; ++i) {
    ros::WallDuration(0.05).sleep();
    const std::lock_guard<std::mutex> guard(lock);
    if (kept == "1") break;
  }
  const std::lock_guard<std::mutex> guard(lock);
  EXPECT_EQ(kept, "1");
}

// A measured dimension of a part is stored with the tool of its cut; what is refused is named in the
// diagnostics.
TEST(LoadMeterNode, storesInspectedDimensions) {
  ros::NodeHandle nh, node("loadmeter");
  ros::AsyncSpinner spinner(1);
  spinner.start();
  const auto conditions = nh.advertise<smartmill_msgs::CuttingCondition>(names::CUTTING_CONDITION, 0, true);
  const auto features = nh.advertise<smartmill_msgs::InspectionFeature>(names::INSPECTION_FEATURE, 10);
  std::mutex lock;
  std::map<std::string, std::string> shown;
  const boost::function<void(const diagnostic_msgs::DiagnosticArray&)> take = [&](const auto& m) {
    const std::lock_guard<std::mutex> guard(lock);
    for (const auto& status : m.status) {
      if (status.name.find(": load meter") == std::string::npos) continue;
      shown["summary"] = status.message;
      for (const auto& value : status.values) shown[value.key] = value.value;
    }
  };
  const auto diagnostics = nh.subscribe<diagnostic_msgs::DiagnosticArray>("/diagnostics", 10, take);
  const auto waitFor = [&](const std::string& key, const std::string& part) {
    for (int i = 0; i < 2400; ++i) {
      ros::WallDuration(0.05).sleep();
      const std::lock_guard<std::mutex> guard(lock);
      if (shown[key].find(part) != std::string::npos) return true;
    }
    const std::lock_guard<std::mutex> guard(lock);
    ADD_FAILURE() << key << ": '" << shown[key] << "', expected '" << part << "'";
    return false;
  };
  Followers player({names::absolute("loadmeter")});
  player.begin();
  for (const ros::Publisher& publisher : {conditions, features}) player.expect(publisher);
  CuttingCondition cut;
  cut.stamp = 900000.0;  // after the other tests' cuts
  cut.kind = CuttingCondition::Kind::cut;
  cut.name = "inspected slot";
  cut.material = "aluminium";
  cut.tool_name = "worn endmill";
  cut.tool = {3, 12e-3, 0.0, {}};
  cut.engagement = {0.0, units::PI, 2e-3, 6e-5};
  cut.spindle_speed = 600.0;
  player.publish(conditions, toMsg(cut));
  cut.kind = CuttingCondition::Kind::none;
  cut.name = "";
  cut.stamp += 10.0;
  player.publish(conditions, toMsg(cut));
  smartmill_msgs::CuttingCondition unknown = toMsg(cut);
  unknown.kind = 200;  // refused by one line, and the node goes on
  player.publish(conditions, unknown);
  player.settle();
  player.end();  // the conditions wait for no stream
  smartmill_msgs::InspectionFeature feature;
  feature.header.stamp = ros::Time(950000.0);
  feature.condition = "inspected slot";
  feature.kind = smartmill_msgs::InspectionFeature::SLOT_WIDTH;
  feature.direction = "y";
  feature.nominal = 12e-3;
  feature.measured = 11.984e-3;
  feature.std_dev = 2e-6;
  features.publish(feature);
  ASSERT_TRUE(waitFor("inspected dimensions stored", "1"));
  EXPECT_TRUE(waitFor("inspection",
                      "worn endmill: effective radius: 5.9920 +- 0.0010 mm, -8.0 um from the stated one"));
  std::string file;
  ASSERT_TRUE(node.getParam("database", file));
  const auto kept = CoefficientDatabase(file).evidence().inspections("worn endmill");
  ASSERT_EQ(kept.size(), 1u);
  EXPECT_EQ(kept[0].machine, "mill 07");
  EXPECT_EQ(kept[0].condition, "inspected slot");
  EXPECT_EQ(kept[0].diameter, 12e-3);
  EXPECT_EQ(kept[0].measured, 11.984e-3);
  EXPECT_EQ(kept[0].cut_time, 900000.0);
  EXPECT_EQ(kept[0].stamp, 950000.0);

  const auto refuses = [&](smartmill_msgs::InspectionFeature bad, const std::string& reason) {
    features.publish(bad);
    EXPECT_TRUE(waitFor("inspection refused", reason));
    EXPECT_TRUE(waitFor("summary", reason));
  };
  smartmill_msgs::InspectionFeature bad = feature;
  bad.condition = "unheard of";
  refuses(bad, "'unheard of': no cut of this name since the start");
  bad = feature;
  bad.measured = std::nan("");
  refuses(bad, "'inspected slot': measured: nan is out of range");
  bad = feature;
  bad.measured = 11.984;  // in mm
  refuses(bad, "'inspected slot': measured: 11972.0000 mm from nominal, expected at most 1.0000 mm");
  bad = feature;
  bad.measured = 0.0;  // not stated
  refuses(bad, "'inspected slot': measured: 0 is out of range");
  EXPECT_EQ(CoefficientDatabase(file).evidence().inspections().size(), 1u);
  // A good one ends the warning.
  feature.measured = 11.986e-3;
  features.publish(feature);
  ASSERT_TRUE(waitFor("inspected dimensions stored", "2"));
  EXPECT_TRUE(waitFor("inspection", "from 2 slot widths"));
}

// Spindle health of the hammer's node is stored with the other records, each quantity once.
TEST(LoadMeterNode, storesSpindleHealth) {
  ros::NodeHandle nh, node("loadmeter");
  ros::AsyncSpinner spinner(1);
  spinner.start();
  const auto health = nh.advertise<smartmill_msgs::SpindleHealth>(names::SPINDLE_HEALTH, 0);
  for (int i = 0; i < 2400 && health.getNumSubscribers() == 0; ++i) ros::WallDuration(0.05).sleep();
  smartmill_msgs::SpindleHealth message;
  message.header.stamp = ros::Time(2000.5);
  message.measured = "T1 tool_tip x";
  message.days = 1.5;
  message.changes.resize(2);
  message.changes[0].quantity = "frequency of the mode at 1000 Hz";
  message.changes[0].first = 1000.0;
  message.changes[0].now = 1012.0;
  message.changes[0].deviations = 4.2;
  message.changes[0].drifted = true;
  message.changes[1] = message.changes[0];
  message.changes[1].quantity = "gain of the mode at 2200 Hz, gone";
  message.changes[1].deviations = std::nan("");
  health.publish(message);
  health.publish(message);  // repeated
  std::string file;
  ASSERT_TRUE(node.getParam("database", file));
  std::vector<HealthRecord> kept;
  for (int i = 0; i < 2400 && kept.size() < 2; ++i) {
    ros::WallDuration(0.05).sleep();
    kept = CoefficientDatabase(file).evidence().health();
  }
  ros::WallDuration(0.2).sleep();
  kept = CoefficientDatabase(file).evidence().health();
  ASSERT_EQ(kept.size(), 2u);
  EXPECT_EQ(kept[0].machine, "mill 07");
  EXPECT_EQ(kept[0].measured, "T1 tool_tip x");
  EXPECT_EQ(kept[0].quantity, "frequency of the mode at 1000 Hz");
  EXPECT_EQ(kept[0].stamp, 2000.5);
  EXPECT_EQ(kept[0].days, 1.5);
  EXPECT_EQ(kept[0].first, 1000.0);
  EXPECT_EQ(kept[0].now, 1012.0);
  EXPECT_EQ(kept[0].deviations, 4.2);
  EXPECT_EQ(kept[0].drifted, 1.0);
  EXPECT_TRUE(std::isnan(kept[1].deviations));
  // The node has the file open; this is the last test.
  for (const char* part : {"", "-shm", "-wal"}) std::filesystem::remove(file + part);
}

}  // namespace
}  // namespace smartmill::loadmeter

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "loadmeter_node_test");
  return RUN_ALL_TESTS();
}
