#include "smartmill_core/signal/watchdog.h"

#include <gtest/gtest.h>

namespace smartmill {
namespace {

TEST(Watchdog, silenceCountsFromTheStartOrTheLastMessage) {
  Watchdog dog(1.0);
  EXPECT_FALSE(dog.ever());
  dog.tick(1.0);
  EXPECT_FALSE(dog.dead());
  dog.tick(0.125);
  EXPECT_TRUE(dog.dead());
  dog.heard();
  EXPECT_TRUE(dog.ever());
  EXPECT_FALSE(dog.dead());
  dog.tick(0.5);
  EXPECT_DOUBLE_EQ(dog.silent(), 0.5);
}

TEST(Watchdog, anEndIsReportedOnceForEachActivePeriod) {
  Watchdog dog(1.0);
  dog.tick(5.0);
  EXPECT_FALSE(dog.ended());  // nothing has begun
  dog.heard();
  dog.tick(0.5);
  EXPECT_FALSE(dog.ended());
  dog.tick(1.0);
  EXPECT_TRUE(dog.ended());
  EXPECT_FALSE(dog.ended());
  dog.heard();
  EXPECT_FALSE(dog.ended());
  dog.tick(2.0);
  EXPECT_TRUE(dog.ended());
}

TEST(Watchdog, theProducerMayReportTheEnd) {
  Watchdog dog(1.0);
  dog.end();
  EXPECT_FALSE(dog.ended());  // nothing was received
  dog.heard();
  dog.end();
  EXPECT_TRUE(dog.dead());
  EXPECT_TRUE(dog.ended());
  EXPECT_FALSE(dog.ended());
  dog.heard();
  EXPECT_FALSE(dog.dead());
}

}  // namespace
}  // namespace smartmill
