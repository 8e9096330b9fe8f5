#include "smartmill_stability/learning/probing_choice.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

using units::MM;

ChartCut tool() {
  ChartCut cut;
  cut.parameters.speed_low = 400.0;
  cut.parameters.speed_high = 1600.0;
  cut.tool.teeth = 4;
  cut.tool.diameter = 16.0 * MM;
  return cut;
}

/// Fewer machines than by default: a test takes a second.
LearningOptions quick() {
  LearningOptions options;
  options.candidates = 1000;
  options.kept = options.shown = 150;
  options.judged = 40;
  return options;
}

ProbingRequest oneStableCut() {
  ProbingRequest request;
  request.ktc = Measured{8e8, 8e6};
  JudgedCut cut;
  cut.speed = 450.0;
  cut.depth = 0.5 * MM;
  request.cuts = {cut};
  return request;
}

TEST(ProbingChoice, ACutThatWasStableMayBeRecommended) {
  const ProbingChoice choice = chooseProbingCut(tool(), oneStableCut(), quick());
  ASSERT_TRUE(choice.next);
  ASSERT_TRUE(choice.recommended);
  EXPECT_GE(choice.next->speed, 400.0);
  EXPECT_LE(choice.next->speed, 1600.0 * 1.000001);
  EXPECT_GE(choice.recommended->stable, 0.95);
  EXPECT_GE(choice.recommended->removal(), 450.0 * 0.5 * MM);
  ProbingRequest last = oneStableCut();
  last.last = true;
  EXPECT_FALSE(chooseProbingCut(tool(), last, quick()).next);
}

TEST(ProbingChoice, DepthsEndAtTheLoadOfTheSpindle) {
  ChartCut weak = tool();
  // Mean torque of a slot: Ktc N c a R / pi over 2 R arcs of R: ktc teeth depth feed diameter / (2 pi).
  weak.spindle.rated_torque = 0.8;
  weak.parameters.load_share = 1.0;
  const double most = 0.8 / (8e8 * 4.0 * weak.parameters.feed_per_tooth * 16.0 * MM / units::TWO_PI);
  const ProbingChoice choice = chooseProbingCut(weak, oneStableCut(), quick());
  ASSERT_TRUE(choice.next && choice.recommended);
  EXPECT_LE(choice.next->depth, most * 1.001);
  EXPECT_LE(choice.recommended->depth, most * 1.001);
  // A stable cut near the highest speed and the largest depth leaves nothing to gain.
  ProbingRequest done = oneStableCut();
  done.cuts[0].speed = 1580.0;
  done.cuts[0].depth = most;
  EXPECT_FALSE(chooseProbingCut(weak, done, quick()).next);
}

TEST(ProbingChoice, RefusesBadRequestsInOneLine) {
  const auto refusal = [](const ProbingRequest& request) -> std::string {
    try {
      chooseProbingCut(tool(), request, quick());
    } catch (const Error& error) {
      return error.what();
    }
    return "none";
  };
  ProbingRequest request = oneStableCut();
  request.exit = 0.0;
  EXPECT_NE(refusal(request).find("exit angle"), std::string::npos) << refusal(request);
  request = oneStableCut();
  request.ktc->value = -1.0;
  EXPECT_NE(refusal(request).find("tangential coefficient"), std::string::npos) << refusal(request);
  request = oneStableCut();
  request.speed_high = 100.0;
  EXPECT_NE(refusal(request).find("highest speed"), std::string::npos) << refusal(request);
}

}  // namespace
}  // namespace smartmill::stability
