#pragma once

#include <string>

namespace smartmill {

/// Variables of the environment that define the data folder. Empty: not set.
struct DataFolders {
  std::string state;  ///< $STATE_DIRECTORY, of a systemd service; the first of several separated by ':'
  std::string data;   ///< $XDG_DATA_HOME
  std::string home;   ///< $HOME

  static DataFolders ofEnvironment();
};

/// Path of a file of data: $STATE_DIRECTORY/NAME, else $XDG_DATA_HOME/smartmill/NAME, else
/// ~/.local/share/smartmill/NAME. Relative folders are ignored (XDG Base Directory Specification).
/// @throws Error when no folder is defined.
std::string dataFile(const DataFolders& folders, const std::string& name);

}  // namespace smartmill
