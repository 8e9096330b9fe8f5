#pragma once

#include <string>

namespace smartmill {

/// Space of the file system of a file, for the user of this process.
struct DiskSpace {
  static constexpr double LOW_SHARE = 0.1;  ///< [1] below which a warning is logged
  static constexpr double RESERVE =
      100e6;  ///< [byte] below which nothing more is written: files are closed in it

  double available = 0.0, capacity = 0.0;  ///< [byte]

  double share() const { return capacity > 0.0 ? available / capacity : 0.0; }  ///< [1]
  bool isLow() const { return share() < LOW_SHARE; }
  bool isFull() const { return available < RESERVE; }
};

/// @param file existing, or to be created in an existing folder. @throws Error naming the file.
DiskSpace diskSpaceOf(const std::string& file);

}  // namespace smartmill
