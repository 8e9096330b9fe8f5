#include "smartmill_core/signal/watchdog.h"

#include <gtest/gtest.h>

namespace smartmill {
namespace {

TEST(Watchdog, silenceCountsFromTheStartOrTheLastThingHeard) {
  Watchdog dog(1.0, 100.0);
  EXPECT_FALSE(dog.ever());
  EXPECT_FALSE(dog.dead(101.0));
  EXPECT_TRUE(dog.dead(101.1));
  dog.heard(105.0);
  EXPECT_TRUE(dog.ever());
  EXPECT_DOUBLE_EQ(dog.silent(105.5), 0.5);
  EXPECT_FALSE(dog.dead(105.5));
}

TEST(Watchdog, anEndIsToldOnceForEachStretchThatWasHeard) {
  Watchdog dog(1.0, 0.0);
  EXPECT_FALSE(dog.ended(5.0));  // nothing has begun
  dog.heard(6.0);
  EXPECT_FALSE(dog.ended(6.5));
  EXPECT_TRUE(dog.ended(7.5));
  EXPECT_FALSE(dog.ended(8.0));
  dog.heard(9.0);
  EXPECT_FALSE(dog.ended(9.5));
  EXPECT_TRUE(dog.ended(11.0));
}

}  // namespace
}  // namespace smartmill
