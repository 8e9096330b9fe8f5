#include "smartmill_launch/session/session_progress.h"

#include <gtest/gtest.h>

#include "smartmill_core/error.h"

namespace smartmill::session {
namespace {

// FRF, an air cut, two slots of which the second is interrupted.
SessionProgress interrupted() {
  SessionProgress progress;
  progress.subject = "mill";
  progress.begin("FRF", "", 0, false);
  progress.end("812 Hz");
  progress.begin("air", "loadmeter", 1, false);
  progress.end("3000 rpm");
  progress.begin("air", "loadmeter", 1, false);
  progress.end("again");
  progress.begin("slot_1", "loadmeter", 1, true);
  progress.end("4000 rpm");
  progress.begin("slot_2", "loadmeter", 1, true);
  return SessionProgress::of(progress.text());
}

TEST(SessionProgress, DoneActionsAreTakenOnceInOrder) {
  SessionProgress progress = interrupted();
  EXPECT_EQ(progress.subject, "mill");
  EXPECT_EQ(progress.take("FRF")->detail, "812 Hz");
  EXPECT_FALSE(progress.take("FRF"));
  EXPECT_EQ(progress.take("air")->detail, "3000 rpm");
  EXPECT_EQ(progress.take("air")->detail, "again");
  EXPECT_FALSE(progress.take("air"));
  EXPECT_TRUE(progress.take("slot_1"));
  EXPECT_FALSE(progress.take("slot_2"));  // interrupted
  EXPECT_EQ(progress.lostLanes(), 1u);
  EXPECT_TRUE(progress.cutLanes());
}

TEST(SessionProgress, ARestartedNodeHasLostWhatItHeld) {
  SessionProgress progress = interrupted();
  EXPECT_EQ(progress.holders(), std::vector<std::string>{"loadmeter"});
  progress.restarted("loadmeter", 1);
  EXPECT_EQ(progress.lostLanes(), 1u);
  progress.restarted("loadmeter", 2);
  EXPECT_FALSE(progress.take("air"));
  EXPECT_FALSE(progress.take("slot_1"));
  EXPECT_TRUE(progress.take("FRF"));
  EXPECT_EQ(progress.lostLanes(), 2u);
}

TEST(SessionProgress, OwnActionsAreNotTaken) {
  SessionProgress progress;
  progress.begin("air", "loadmeter", 1, false);
  progress.end("");
  EXPECT_FALSE(progress.take("air"));  // the plan has a second one of this name
  EXPECT_EQ(progress.lostLanes(), 0u);
  EXPECT_FALSE(progress.cutLanes());
}

TEST(SessionProgress, WhatIsNotItsTextIsAnError) {
  EXPECT_THROW(SessionProgress::of("x"), Error);
  EXPECT_THROW(SessionProgress::of("{}"), Error);
  EXPECT_THROW(SessionProgress::of(R"({"subject":"","summary":"","actions":[["a"]]})"), Error);
}

}  // namespace
}  // namespace smartmill::session
