#pragma once

#include <memory>
#include <string>

#include "smartmill_core/io/data_folder.h"
#include "smartmill_loadmeter/database/database.h"

namespace smartmill::loadmeter {

/// @{ Values of the parameter `database` other than a file.
constexpr const char* DATABASE_AUTO = "auto";  ///< the machine's file in the user's data folder
constexpr const char* DATABASE_NONE = "none";  ///< this run only, as an empty value
/// @}

bool isWithoutFile(const std::string& database);

/// Path of a machine's file NAME.sqlite in the data folder (dataFile), where NAME is the machine's name or,
/// without one, that of its model file.
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
