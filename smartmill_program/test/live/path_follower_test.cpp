// The follower on trajectories that this file makes of points and feeds, without the program's path.

#include "smartmill_program/live/path_follower.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>

#include "smartmill_core/signal/steady_path.h"
#include "test_part.h"

namespace smartmill::program {
namespace {

using units::MM;
using units::PI;

constexpr double PERIOD = 0.02;                        // [s] of the states
constexpr double RPS = 50.0;                           // 3000 rpm
const std::array<double, 3> ZERO{{0.1, -0.05, -0.2}};  // [m] machine position of the program's zero
constexpr double RAPID = 200.0;                        // [mm/s]

/// Slot, a step of 3 mm down-milling and one up-milling, as straight lines along x.
const char* const SHOULDER =
    "G21 G90 G17 S3000 M3 F600\n"
    "N10 G0 X-10 Y10 Z5\n"  // 2
    "N20 G1 Z-2\n"          // 3
    "N30 G1 X70\n"          // 4
    "N40 G1 Y13\n"          // 5
    "N50 G1 X-10\n"         // 6
    "N60 G1 Y16\n"          // 7
    "N70 G1 X70\n"          // 8
    "N80 G0 Z5\n"
    "M30\n";

/// A point of the trajectory [mm] and the feed to it [mm/s].
struct Way {
  int sequence;
  std::array<double, 3> to;
  double feed;
};
const std::vector<Way> SHOULDER_WAYS{
    {10, {-10, 10, 5}, RAPID}, {20, {-10, 10, -2}, 10}, {30, {70, 10, -2}, 10}, {40, {70, 13, -2}, 10},
    {50, {-10, 13, -2}, 10},   {60, {-10, 16, -2}, 10}, {70, {70, 16, -2}, 10}, {80, {70, 16, 5}, RAPID}};

/// A controller that moves along points, polled every 20 ms with noise of 2 um.
class Controller {
 public:
  explicit Controller(PathFollower& follower, unsigned seed = 1) : follower_(follower), random_(seed) {}

  std::function<double(double time)> override_of = [](double) { return 1.0; };
  std::array<double, 3> error{};  // [mm] of the tool off its path
  double speed = RPS * units::TWO_PI;
  bool with_sequence = true;

  /// Runs ways from a point on. @param hold called at each state: whether the feed is held
  void run(const std::vector<Way>& ways, const std::function<bool(const std::array<double, 3>&)>& hold = {}) {
    for (const Way& way : ways) {
      std::array<double, 3> from = at;
      double length = 0.0;
      for (std::size_t a = 0; a < 3; ++a) length += std::pow(way.to[a] - from[a], 2);
      length = std::sqrt(length);
      for (double done = 0.0; done < length;) {
        const bool held = hold && hold(at);
        const double feed = held ? 0.0 : way.feed * override_of(time);
        done = std::min(length, done + feed * PERIOD);
        for (std::size_t a = 0; a < 3; ++a) at[a] = from[a] + done / length * (way.to[a] - from[a]);
        poll(held ? CncRun::hold : CncRun::start, feed, with_sequence ? way.sequence : 0);
      }
    }
  }
  /// The program has ended or was reset.
  void stop(int states = 10) {
    for (int i = 0; i < states; ++i) poll(CncRun::reset, 0.0, 0);
  }
  void poll(CncRun run, double feed, int sequence) {
    std::normal_distribution<double> noise(0.0, 0.002);
    time += PERIOD;
    CncState state;
    state.stamp = time;
    state.connected = true;
    state.run = run;
    state.motion = feed > 0.0;
    state.sequence = sequence;
    state.axes = {"X", "Y", "Z"};
    for (std::size_t a = 0; a < 3; ++a)
      state.position.push_back((at[a] + error[a] + noise(random_)) * MM + ZERO[a]);
    state.feed = feed * MM;
    state.spindle_speed = speed;
    if (const auto condition = follower_.handle(state)) {
      conditions.push_back(*condition);
      places.push_back(at);
    }
  }
  std::vector<CuttingCondition> cuts() const { return ofKind(CuttingCondition::Kind::cut); }
  std::vector<CuttingCondition> ofKind(CuttingCondition::Kind kind) const {
    std::vector<CuttingCondition> found;
    for (const CuttingCondition& condition : conditions)
      if (condition.kind == kind) found.push_back(condition);
    return found;
  }

  double time = 1000.0;                     // [s]
  std::array<double, 3> at{{-10, 10, 50}};  // [mm]
  std::vector<CuttingCondition> conditions;
  std::vector<std::array<double, 3>> places;  // [mm] of the tool when they were stated

 private:
  PathFollower& follower_;
  std::mt19937 random_;
};

PathFollower followerOf(const char* text, const FollowerParameters& parameters = {}) {
  return {std::make_shared<const LiveProgram>(prepareText(text)), ZERO, {"end_mill", "al7050"}, parameters};
}

TEST(PathFollower, StatesEachCutOfAProgramWhileItIsSteady) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    PathFollower follower = followerOf(SHOULDER);
    Controller controller(follower, seed);
    controller.run(SHOULDER_WAYS);
    controller.stop();
    const std::vector<CuttingCondition> cuts = controller.cuts();
    ASSERT_EQ(cuts.size(), 3u);
    const double wall = std::acos(1.0 - 3.0 / 5.0);
    const double entry[] = {0.0, PI - wall, 0.0}, exit[] = {PI, PI, wall};
    const char* const name[] = {"part.nc line 4", "part.nc line 6", "part.nc line 8"};
    for (std::size_t k = 0; k < 3; ++k) {
      EXPECT_EQ(cuts[k].name, name[k]);
      EXPECT_NEAR(cuts[k].engagement.entry, entry[k], 0.001);
      EXPECT_NEAR(cuts[k].engagement.exit, exit[k], 0.001);
      EXPECT_NEAR(cuts[k].engagement.axial_depth, 2 * MM, 1e-9);
      EXPECT_NEAR(cuts[k].engagement.feed_per_tooth, 10.0 / (4 * RPS) * MM, 1e-9);
      EXPECT_EQ(cuts[k].material, "al7050");
      EXPECT_EQ(cuts[k].tool_name, "end_mill");
      EXPECT_EQ(cuts[k].tool.teeth, 4);
      EXPECT_NEAR(cuts[k].steady_from[1], (10 + 3.0 * static_cast<double>(k)) * MM + ZERO[1], 1e-9);
      EXPECT_NEAR(cuts[k].steady_from[2], -2 * MM + ZERO[2], 1e-9);
    }
    // Each is stated where the engagement is that of the condition, and its end before it changes.
    for (std::size_t i = 0; i < controller.conditions.size(); ++i) {
      const bool begins = controller.conditions[i].kind == CuttingCondition::Kind::cut;
      const bool ends = i > 0 && controller.conditions[i - 1].kind == CuttingCondition::Kind::cut;
      EXPECT_FALSE(ends && begins) << i;
      if (!begins && !ends) continue;
      EXPECT_GE(controller.places[i][0], 0.0) << i;
      EXPECT_LE(controller.places[i][0], 60.0) << i;
    }
    EXPECT_EQ(controller.conditions.back().kind, CuttingCondition::Kind::none);
    EXPECT_EQ(follower.status().parts, 1);
    EXPECT_EQ(follower.status().lost, 0u);
  }
}

// Contact in the slot from x = -5 to 60 mm, in the steps from sqrt(5^2 - 2^2) mm before the stock to its end.
TEST(PathFollower, EachCutStatesTheTimeThatTheToolWasInTheWork) {
  PathFollower follower = followerOf(SHOULDER);
  Controller controller(follower);
  controller.override_of = [](double time) { return time < 1004.0 ? 1.0 : 0.5; };
  controller.run(SHOULDER_WAYS);
  const double feed = 5.0, reach = std::sqrt(21.0);  // [mm/s], [mm]
  std::vector<double> expected, stated, place;
  for (std::size_t i = 0; i < controller.conditions.size(); ++i) {
    const CuttingCondition& condition = controller.conditions[i];
    if (condition.kind != CuttingCondition::Kind::cut) continue;
    const double x = controller.places[i][0];
    stated.push_back(condition.cut_time_before);
    place.push_back(x);
    if (condition.name == "part.nc line 6") expected.push_back((60.0 + reach - x) / feed);
    if (condition.name == "part.nc line 8") expected.push_back((60.0 + reach + reach + x) / feed);
  }
  ASSERT_EQ(stated.size(), expected.size() + 2);  // the slot before and after the change of the feed
  // Of the slot the feed changed in its middle: its time is the same in both steps.
  const double slot = stated[2] - expected[0];
  EXPECT_NEAR(stated[3] - expected[1], slot, 0.1);
  EXPECT_GT(slot, 65.0 / 10.0);
  EXPECT_LT(slot, 65.0 / 5.0);
  EXPECT_NEAR(stated[0], (place[0] + 5.0) / 10.0, 0.1);
}

TEST(PathFollower, AirIsStatedWithTheSpindleTurning) {
  PathFollower follower = followerOf(SHOULDER);
  Controller controller(follower);
  controller.run(SHOULDER_WAYS);
  controller.stop();
  // Before the slot, and from the slot round the end of the stock to the second pass: 0.5 + 0.3 + 0.5 s.
  const auto air = controller.ofKind(CuttingCondition::Kind::air);
  ASSERT_GE(air.size(), 2u);
  EXPECT_EQ(air[0].name, "part.nc air from line 3");
  EXPECT_NEAR(air[0].spindle_speed, RPS * units::TWO_PI, 1e-9);
  for (std::size_t i = 0; i + 1 < controller.conditions.size(); ++i) {
    if (controller.conditions[i].kind != CuttingCondition::Kind::air) continue;
    // From its statement to its end the front of the tool is outside of the block: on the way in its radius
    // before the edge, on the way out with its centre on the edge.
    EXPECT_TRUE(controller.places[i][0] <= 0.0 || controller.places[i][0] >= 60.0);
    const double end = controller.places[i + 1][0];
    EXPECT_TRUE(end < -5.0 || end > 64.5) << end;
  }
}

// Contact in the slot while the front of the tool is in the stock, x = -5 to 60 mm.
TEST(PathFollower, WhileTheToolIsInTheWorkItsCutIsSteadyOrUnsteady) {
  PathFollower follower = followerOf(SHOULDER);
  Controller controller(follower);
  int in_work = 0, out_of_it = 0;
  controller.run({SHOULDER_WAYS.begin(), SHOULDER_WAYS.begin() + 4}, [&](const std::array<double, 3>& at) {
    const bool stated = !controller.conditions.empty() && controller.conditions.back().isInWork();
    // A state is 0.2 mm of way; ahead are 0.15 s of it.
    if (at[1] < 10.1 && at[2] < 0.0 && at[0] > -4.8 && at[0] < 59.8) in_work += stated ? 1 : 1000;
    if (at[0] < -7.5 || (at[1] > 11.0 && at[1] < 12.5)) out_of_it += stated ? 1000 : 1;
    return false;
  });
  EXPECT_NEAR(in_work, 323, 2);
  EXPECT_NEAR(out_of_it, 60, 20);
  // From the entry until the slot is steady, and where it ends.
  const auto unsteady = controller.ofKind(CuttingCondition::Kind::unsteady);
  ASSERT_EQ(unsteady.size(), 2u);
  EXPECT_EQ(unsteady[0].name, "part.nc unsteady from line 4");
  EXPECT_EQ(unsteady[1].name, "part.nc unsteady from line 4 (2)");
  for (const CuttingCondition& condition : {unsteady[0], unsteady[1]}) {
    EXPECT_NEAR(condition.engagement.axial_depth, 2 * MM, 1e-9);
    EXPECT_NEAR(condition.engagement.feed_per_tooth, 10.0 / (4 * RPS) * MM, 1e-9);
    EXPECT_NEAR(condition.engagement.exit, PI, 0.01);
    EXPECT_NEAR(condition.engagement.entry, 0.0, 0.01);
    EXPECT_EQ(condition.tool.teeth, 4);
    EXPECT_TRUE(std::isnan(condition.steady_to[0]));
  }
}

TEST(PathFollower, AnOverrideEndsTheConditionAndBeginsOneWithTheActualFeed) {
  PathFollower follower = followerOf(SHOULDER);
  Controller controller(follower);
  // The slot begins 1.2 s after the start; 50 % from 4 s on.
  controller.override_of = [](double time) { return time < 1004.0 ? 1.0 : 0.5; };
  controller.run({SHOULDER_WAYS.begin(), SHOULDER_WAYS.begin() + 3});
  const std::vector<CuttingCondition> cuts = controller.cuts();
  ASSERT_EQ(cuts.size(), 2u);
  EXPECT_NEAR(cuts[0].engagement.feed_per_tooth, 0.05 * MM, 1e-9);
  EXPECT_NEAR(cuts[1].engagement.feed_per_tooth, 0.025 * MM, 1e-9);
  EXPECT_EQ(cuts[1].name, "part.nc line 4 (2)");
  EXPECT_NEAR(cuts[1].stamp, 1004.0 + 0.1, 2.5 * PERIOD);  // after the steady time
}

TEST(PathFollower, AChangingFeedIsNotSteady) {
  PathFollower follower = followerOf(SHOULDER);
  Controller controller(follower);
  controller.override_of = [](double time) { return 1.0 + 0.2 * std::sin(4.0 * time); };
  controller.run({SHOULDER_WAYS.begin(), SHOULDER_WAYS.begin() + 3});
  // Its slope is below 0.3 / s at the extremes only, for a fraction of a second.
  for (std::size_t i = 0; i + 1 < controller.conditions.size(); ++i) {
    if (controller.conditions[i].kind == CuttingCondition::Kind::cut) {
      EXPECT_LT(controller.conditions[i + 1].stamp - controller.conditions[i].stamp, 0.4);
    }
  }
}

TEST(PathFollower, AFeedHoldEndsTheConditionUntilTheProgramGoesOn) {
  PathFollower follower = followerOf(SHOULDER);
  Controller controller(follower);
  int states = 0;
  controller.run({SHOULDER_WAYS.begin(), SHOULDER_WAYS.begin() + 3},
                 [&](const std::array<double, 3>& at) { return at[0] > 20.0 && ++states <= 200; });
  const std::vector<CuttingCondition> cuts = controller.cuts();
  ASSERT_EQ(cuts.size(), 2u);
  const auto second = std::find_if(controller.conditions.begin(), controller.conditions.end(),
                                   [&](const CuttingCondition& c) { return c.name == cuts[1].name; });
  const CuttingCondition& held = *(second - 1);
  EXPECT_EQ(held.kind, CuttingCondition::Kind::unsteady);
  EXPECT_NEAR(cuts[1].stamp - held.stamp, 200 * PERIOD + 0.1, 2.5 * PERIOD);
  EXPECT_EQ(follower.status().parts, 1);
}

TEST(PathFollower, ANewFollowerFindsTheToolInMidProgram) {
  for (const bool with_sequence : {true, false}) {
    PathFollower follower = followerOf(SHOULDER);
    Controller controller(follower);
    controller.with_sequence = with_sequence;
    controller.at = {30, 13, -2};
    controller.run({SHOULDER_WAYS.begin() + 4, SHOULDER_WAYS.end()});
    ASSERT_EQ(controller.cuts().size(), 2u);
    EXPECT_EQ(controller.cuts()[0].name, "part.nc line 6");
    EXPECT_EQ(controller.cuts()[1].name, "part.nc line 8");
  }
}

TEST(PathFollower, ARestartInMidProgramStatesOnlyWhatIsNotCutYet) {
  PathFollower follower = followerOf(SHOULDER);
  Controller controller(follower);
  controller.run({SHOULDER_WAYS.begin(), SHOULDER_WAYS.begin() + 4});
  controller.run({{50, {30, 13, -2}, 10}});
  controller.stop();
  ASSERT_EQ(controller.cuts().size(), 2u);
  // Again from the begin of this pass, then to its end: it was cut from 60 to 30 mm.
  controller.at = {70, 13, -2};
  controller.run({SHOULDER_WAYS.begin() + 4, SHOULDER_WAYS.begin() + 5});
  EXPECT_EQ(controller.cuts().size(), 2u);
  EXPECT_EQ(follower.status().parts, 1);
  controller.run({SHOULDER_WAYS.begin() + 5, SHOULDER_WAYS.end()});
  ASSERT_EQ(controller.cuts().size(), 3u);
  EXPECT_EQ(controller.cuts()[2].name, "part.nc line 8");
}

TEST(PathFollower, AfterSkippedCutsTheMaterialIsUnknown) {
  PathFollower follower = followerOf(SHOULDER);
  Controller controller(follower);
  controller.run({SHOULDER_WAYS.begin(), SHOULDER_WAYS.begin() + 3});
  controller.stop();
  // The second pass is left out: the third meets twice the material.
  controller.at = {-10, 16, 5};
  controller.run({{60, {-10, 16, -2}, 10}, SHOULDER_WAYS[6]});
  EXPECT_EQ(controller.cuts().size(), 1u);
  EXPECT_TRUE(follower.status().material_unknown);
}

TEST(PathFollower, ASecondRunIsANewPart) {
  PathFollower follower = followerOf(SHOULDER);
  Controller controller(follower);
  for (int part = 0; part < 2; ++part) {
    controller.at = {-10, 10, 50};
    controller.run(SHOULDER_WAYS);
    controller.stop();
  }
  const std::vector<CuttingCondition> cuts = controller.cuts();
  ASSERT_EQ(cuts.size(), 6u);
  EXPECT_EQ(cuts[3].name, "part.nc line 4 (2)");
  EXPECT_EQ(follower.status().parts, 2);
}

TEST(PathFollower, BesideThePathTheToolIsLostAndFoundAgain) {
  PathFollower follower = followerOf(SHOULDER);
  Controller controller(follower);
  controller.run({SHOULDER_WAYS.begin(), SHOULDER_WAYS.begin() + 2});
  controller.run({{30, {20, 10, -2}, 10}});
  ASSERT_TRUE(follower.states());
  controller.error = {0, 1.0, 0};
  controller.run({{30, {30, 10, -2}, 10}});
  EXPECT_EQ(controller.conditions.back().kind, CuttingCondition::Kind::unsteady);  // in the work or not
  EXPECT_EQ(controller.conditions.back().engagement.axial_depth, 0.0);
  EXPECT_EQ(follower.status().follows, PathFollower::Follows::lost);
  EXPECT_EQ(follower.status().lost, 1u);
  EXPECT_EQ(follower.status().line, 4);
  controller.error = {};
  controller.run({{30, {40, 10, -2}, 10}});
  EXPECT_EQ(follower.status().follows, PathFollower::Follows::following);
  EXPECT_EQ(controller.cuts().size(), 2u);
}

TEST(PathFollower, TheDeviationFromThePathIsAnUncertaintyOfTheWall) {
  PathFollower follower = followerOf(SHOULDER);
  Controller controller(follower);
  controller.run({SHOULDER_WAYS.begin(), SHOULDER_WAYS.begin() + 6});
  controller.error = {0, 0.1, 0};
  controller.run({{70, {30, 16, -2}, 10}});
  ASSERT_TRUE(follower.states());
  EXPECT_NEAR(follower.status().deviation, 0.1 * MM, 0.01 * MM);  // noise 2 um
  // d(angle) = d / (R sin(angle)) of the wall, sin = sqrt(1 - 0.4^2)
  EXPECT_NEAR(follower.status().angle_std, 0.1 / (5.0 * std::sqrt(0.84)), 0.1 * 0.1 / 5.0);
  EXPECT_EQ(follower.status().lost, 0u);
}

TEST(PathFollower, TheWayBackInTheSlotIsNoCut) {
  PathFollower follower =
      followerOf("G21 G90 G17 S3000 M3 F600\nG0 X-10 Y10 Z5\nG1 Z-2\nG1 X40\nG1 X-10\nG0 Z5\nM30\n");
  Controller controller(follower);
  controller.with_sequence = false;
  controller.run({{0, {-10, 10, 5}, RAPID}, {0, {-10, 10, -2}, 10}, {0, {40, 10, -2}, 10}});
  ASSERT_EQ(controller.cuts().size(), 1u);
  controller.run({{0, {-10, 10, -2}, 10}});
  EXPECT_EQ(controller.cuts().size(), 1u);
  ASSERT_FALSE(controller.conditions.empty());
  EXPECT_EQ(controller.conditions.back().name, "part.nc air from line 5");
}

TEST(PathFollower, TheBlockDistinguishesTwoVisitsOfAPoint) {
  // The start is visited a second time before the second slot.
  PathFollower follower = followerOf(
      "G21 G90 G17 S3000 M3 F600\nN10 G0 X-10 Y10 Z5\nN20 G4 X3.\nN30 G1 Z-2\nN40 G1 X40\nN50 G0 Z5\n"
      "N60 G0 X-10 Y10\nN70 G1 Z-4\nN80 G1 X40\nN90 G0 Z5\nM30\n");
  Controller controller(follower);
  // The last state of the rapid move is 0.15 mm before the point, nearer to the path of N60 along x.
  controller.at = {-10.1, 10.11, 5};
  controller.poll(CncRun::start, 10.0, 10);
  controller.at = {-10, 10, 5};
  controller.poll(CncRun::start, 0.0, 10);
  EXPECT_EQ(follower.status().follows, PathFollower::Follows::ambiguous);
  for (int i = 0; i < 150; ++i) controller.poll(CncRun::start, 0.0, 20);
  EXPECT_EQ(follower.status().follows, PathFollower::Follows::following);
  ASSERT_EQ(controller.conditions.size(), 1u);
  EXPECT_EQ(controller.conditions[0].name, "part.nc air from line 3");
}

TEST(PathFollower, ADwellInTheCutIsNoCondition) {
  PathFollower follower =
      followerOf("G21 G90 G17 S3000 M3 F600\nG0 X-10 Y10 Z5\nG1 Z-2\nG1 X30\nG4 X3.\nG1 X50\nG0 Z5\nM30\n");
  Controller controller(follower);
  controller.run({{0, {-10, 10, 5}, RAPID}, {0, {-10, 10, -2}, 10}, {0, {30, 10, -2}, 10}});
  for (int i = 0; i < 150; ++i) controller.poll(CncRun::start, 0.0, 0);
  EXPECT_EQ(controller.conditions.back().kind, CuttingCondition::Kind::unsteady);
  controller.run({{0, {50, 10, -2}, 10}});
  ASSERT_EQ(controller.cuts().size(), 2u);
  EXPECT_EQ(controller.cuts()[1].name, "part.nc line 6");
}

TEST(PathFollower, NoneIsStatedWhileAnotherNodeDoes) {
  PathFollower follower = followerOf(SHOULDER);
  Controller controller(follower);
  follower.setOtherSource(true);
  controller.run(SHOULDER_WAYS);
  EXPECT_TRUE(controller.conditions.empty());
}

TEST(PathFollower, AProgramOfAnotherNumberOrBesideThePathIsIgnored) {
  FollowerParameters parameters;
  parameters.number = 17;
  PathFollower numbered = followerOf(SHOULDER, parameters);
  Controller other(numbered);
  other.run(SHOULDER_WAYS);  // number 0
  EXPECT_TRUE(other.conditions.empty());
  EXPECT_EQ(numbered.status().follows, PathFollower::Follows::idle);

  PathFollower follower = followerOf(SHOULDER);
  Controller controller(follower);
  controller.at = {0, 0, 80};
  controller.run({{0, {50, 30, 80}, 10}, {0, {0, 0, 80}, 10}});
  EXPECT_TRUE(controller.conditions.empty());
  EXPECT_EQ(follower.status().follows, PathFollower::Follows::searching);
}

TEST(PathFollower, OnACircleThePlaceIsFoundAtItsStartAndEnd) {
  // A full circle in the pocket that it widens, then a line.
  PathFollower follower =
      followerOf("G21 G90 G17 S3000 M3 F600\nG0 X20 Y20 Z1\nG1 Z-2\nG3 X20 Y20 I5 J0\nG1 X50\nG0 Z5\nM30\n");
  Controller controller(follower);
  controller.with_sequence = false;
  controller.at = {20, 20, 1};
  controller.run({{0, {20, 20, -2}, 10}});
  std::vector<Way> circle;
  for (int i = 1; i <= 360; ++i) {
    const double angle = PI + i * PI / 180.0;
    circle.push_back({0, {25 + 5 * std::cos(angle), 20 + 5 * std::sin(angle), -2}, 10});
  }
  controller.run(circle);
  EXPECT_EQ(follower.status().lost, 0u);
  controller.run({{0, {50, 20, -2}, 10}});
  EXPECT_EQ(follower.status().lost, 0u);
  ASSERT_EQ(controller.cuts().size(), 2u);
  EXPECT_EQ(controller.cuts()[0].name.substr(0, 14), "part.nc line 4");
  EXPECT_TRUE(feedTurns(controller.cuts()[0]));
  EXPECT_EQ(controller.cuts()[1].name.substr(0, 14), "part.nc line 5");
  EXPECT_FALSE(feedTurns(controller.cuts()[1]));
}

}  // namespace
}  // namespace smartmill::program
