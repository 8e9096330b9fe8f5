#include "loadmeter/fleet_history.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/testing/temporary_folder.h"

namespace smartmill::studies {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using Kind = PushEvent::Kind;

/// Three records are acknowledged, two more were sent without an answer.
const PushHistory HISTORY{
    {"a", {{Kind::attempted, 0, 3}, {Kind::acknowledged, 0, 3}, {Kind::attempted, 3, 5}}}};

std::vector<loadmeter::CoefficientRecord> stored(std::size_t count) {
  std::vector<loadmeter::CoefficientRecord> records;
  for (std::size_t i = 0; i < count; ++i) records.push_back(recordOf("a", i));
  return records;
}

TEST(FleetHistory, RecordsWithoutAnAnswerMayBeThereOrNot) {
  for (const std::size_t count : {3u, 4u, 5u}) {
    EXPECT_THAT(violationsOf(HISTORY, stored(count)), IsEmpty());
    EXPECT_EQ(unknownOf(HISTORY, stored(count)).stored, count - 3);
    EXPECT_EQ(unknownOf(HISTORY, stored(count)).absent, 5 - count);
  }
}

TEST(FleetHistory, EveryViolationIsFound) {
  auto server = stored(5);
  server.erase(server.begin() + 1);
  EXPECT_THAT(violationsOf(HISTORY, server), ElementsAre("record 1 of a was acknowledged and is not stored"));
  server = stored(5);
  server.push_back(recordOf("a", 4));
  EXPECT_THAT(violationsOf(HISTORY, server), ElementsAre("record 4 of a is stored 2 times"));
  server = stored(5);
  server[2].set.value.ktc *= 1.0 + 1e-15;
  server[3].set.tool += " ";
  EXPECT_THAT(violationsOf(HISTORY, server),
              ElementsAre("record 2 of a has another content", "record 3 of a has another content"));
  server = stored(6);
  EXPECT_THAT(violationsOf(HISTORY, server), ElementsAre("record 5 of a was sent by no client"));
  server = stored(3);
  server.push_back(recordOf("b", 0));
  EXPECT_THAT(violationsOf(HISTORY, server), ElementsAre("record 0 of b was sent by no client"));
}

TEST(FleetHistory, ALineThatAKillHasCutOffIsLeftOut) {
  const TemporaryFolder folder;
  const auto events =
      readPushEvents(folder.write("a.log", "attempted 0 20\nacknowledged 0 20\nattempted 20 4"));
  ASSERT_EQ(events.size(), 2u);
  EXPECT_EQ(events[1].kind, Kind::acknowledged);
  EXPECT_EQ(events[1].last, 20u);
  EXPECT_THROW(readPushEvents(folder.write("b.log", "sent 0 20\n")), Error);
}

}  // namespace
}  // namespace smartmill::studies
