#include "smartmill_core/io/disk_space.h"

#include <sys/statvfs.h>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/testing/temporary_folder.h"

namespace smartmill {
namespace {

// statvfs(3): blocks for users without privileges.
TEST(DiskSpace, IsThatOfTheFileSystem) {
  const TemporaryFolder folder;
  struct statvfs system {};
  ASSERT_EQ(::statvfs(folder.file("").c_str(), &system), 0);
  const DiskSpace space = diskSpaceOf(folder.file("session.bag"));
  EXPECT_EQ(space.capacity, static_cast<double>(system.f_blocks) * static_cast<double>(system.f_frsize));
  // Other programs write meanwhile.
  EXPECT_NEAR(space.available, static_cast<double>(system.f_bavail) * static_cast<double>(system.f_frsize),
              0.01 * space.capacity);
  EXPECT_THROW(diskSpaceOf(folder.file("none/session.bag")), Error);
}

TEST(DiskSpace, IsLowByItsShareAndFullByItsSize) {
  EXPECT_FALSE((DiskSpace{11e9, 100e9}.isLow()));
  EXPECT_TRUE((DiskSpace{9e9, 100e9}.isLow()));
  EXPECT_FALSE((DiskSpace{9e9, 100e9}.isFull()));
  EXPECT_TRUE((DiskSpace{99e6, 100e9}.isFull()));
  EXPECT_TRUE(DiskSpace().isFull());
}

}  // namespace
}  // namespace smartmill
