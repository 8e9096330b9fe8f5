#pragma once

#include <memory>
#include <string>

#include "smartmill_loadmeter/database/database.h"

namespace smartmill::loadmeter {

/// @{ Values of the parameter `database` other than a file.
constexpr const char* DATABASE_AUTO = "auto";  ///< the machine's file in the user's data folder
constexpr const char* DATABASE_NONE = "none";  ///< this run only, as an empty value
/// @}

bool isWithoutFile(const std::string& database);

/// Variables of the environment that define the data folder. Empty: not set.
struct DataFolders {
  std::string state;  ///< $STATE_DIRECTORY, of a systemd service; the first of several separated by ':'
  std::string data;   ///< $XDG_DATA_HOME
  std::string home;   ///< $HOME

  static DataFolders ofEnvironment();
};

/// Path of a machine's file: $STATE_DIRECTORY/NAME.sqlite, else $XDG_DATA_HOME/smartmill/NAME.sqlite, else
/// ~/.local/share/smartmill/NAME.sqlite, where NAME is the machine's name or, without one, that of its model
/// file. Relative folders are ignored (XDG Base Directory Specification).
/// @throws Error when no folder is defined.
std::string databaseFile(const DataFolders& folders, const std::string& machine, const std::string& model);

struct OpenedDatabase {
  std::unique_ptr<CoefficientDatabase> database;
  std::string file;     ///< empty: this run only
  std::string problem;  ///< why the default file is not used; one line, empty: none
};

/// Opens the file of the parameter `database`. The default file is created with its folder; if it cannot be
/// used it stays as it is, and the records are those of this run only.
/// @throws Error when an explicit file cannot be used.
OpenedDatabase openDatabase(const std::string& database, const std::string& machine, const std::string& model,
                            const DataFolders& folders);

}  // namespace smartmill::loadmeter
