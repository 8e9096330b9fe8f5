#include "smartmill_core/formatted.h"

#include <gtest/gtest.h>

namespace smartmill {
namespace {

TEST(Formatted, EqualsPrintf) {
  EXPECT_EQ(formatted("%s", ""), "");
  EXPECT_EQ(formatted("%.1f mm at %d%%", 2.54, 7), "2.5 mm at 7%");
}

TEST(Formatted, DoesNotTruncateLongLines) {
  for (const std::size_t length : {198u, 199u, 200u, 201u, 5000u}) {
    const std::string word(length, 'x');
    EXPECT_EQ(formatted("%s.", word.c_str()), word + ".");
  }
}

}  // namespace
}  // namespace smartmill
