// Plain CMake finds the installed libraries: find_package(smartmill).
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smartmill_core/testing/temporary_folder.h"

namespace smartmill {
namespace {

TEST(Install, aProgramOutsideTheRepositoryFindsLinksAndRuns) {
  const TemporaryFolder folder;
  const auto call = [&](const std::string& command) {
    return std::system((command + " > " + folder.file("output") + " 2>&1").c_str());
  };
  const auto output = [&] {
    std::ostringstream text;
    text << std::ifstream(folder.file("output")).rdbuf();
    return text.str();
  };
  ASSERT_EQ(call(CMAKE " --install " BUILD " --prefix " + folder.file("prefix")), 0) << output();
  ASSERT_EQ(call(CMAKE " -S " CONSUMER " -B " + folder.file("build") + " -DCMAKE_CXX_COMPILER=" COMPILER +
                 " -DCMAKE_PREFIX_PATH=" + folder.file("prefix")),
            0)
      << output();
  ASSERT_EQ(call(CMAKE " --build " + folder.file("build")), 0) << output();
  ASSERT_EQ(call(folder.file("build/consumer")), 0) << output();
  EXPECT_EQ(output(), "1.200e-07 m/N\n");  // 1e-7 of the mode plus 2e-8 of the direct term
}

}  // namespace
}  // namespace smartmill
