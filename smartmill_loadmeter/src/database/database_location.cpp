#include "smartmill_loadmeter/database/database_location.h"

#include <algorithm>
#include <filesystem>

#include "smartmill_core/error.h"

namespace smartmill::loadmeter {

namespace {

namespace fs = std::filesystem;

std::unique_ptr<CoefficientDatabase> openChecked(const std::string& file) {
  auto database = std::make_unique<CoefficientDatabase>(file);
  database->check();
  return database;
}

}  // namespace

bool isWithoutFile(const std::string& database) {
  return database.empty() || database == DATABASE_NONE;
}

std::string databaseFile(const DataFolders& folders, const std::string& machine, const std::string& model) {
  std::string name = machine.empty() ? fs::path(model).stem().string() : machine;
  std::replace(name.begin(), name.end(), '/', '_');
  if (name.empty() || name[0] == '.') name = "machine" + name;
  return dataFile(folders, name + ".sqlite");
}

OpenedDatabase openDatabase(const std::string& database, const std::string& machine, const std::string& model,
                            const DataFolders& folders) {
  if (isWithoutFile(database)) return {std::make_unique<CoefficientDatabase>(""), "", ""};
  if (database != DATABASE_AUTO) return {openChecked(database), database, ""};
  try {
    const std::string file = databaseFile(folders, machine, model);
    std::error_code failed;
    fs::create_directories(fs::path(file).parent_path(), failed);
    if (failed)
      throw Error(fs::path(file).parent_path().string() + ": cannot be created: " + failed.message());
    return {openChecked(file), file, ""};
  } catch (const Error& error) {
    return {std::make_unique<CoefficientDatabase>(""), "",
            std::string(error.what()) + "; records of this run only (database:=FILE uses another file)"};
  }
}

}  // namespace smartmill::loadmeter
