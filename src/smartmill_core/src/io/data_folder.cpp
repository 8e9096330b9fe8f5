#include "smartmill_core/io/data_folder.h"

#include <cstdlib>
#include <filesystem>

#include "smartmill_core/error.h"

namespace smartmill {
namespace {

namespace fs = std::filesystem;

std::string variable(const char* name) {
  const char* value = std::getenv(name);
  return value ? value : "";
}

fs::path folderOf(const DataFolders& folders) {
  const fs::path state = folders.state.substr(0, folders.state.find(':'));
  if (state.is_absolute()) return state;
  if (fs::path(folders.data).is_absolute()) return fs::path(folders.data) / "smartmill";
  if (fs::path(folders.home).is_absolute()) return fs::path(folders.home) / ".local" / "share" / "smartmill";
  throw Error("no data folder: expected an absolute path in XDG_DATA_HOME or HOME");
}

}  // namespace

DataFolders DataFolders::ofEnvironment() {
  return {variable("STATE_DIRECTORY"), variable("XDG_DATA_HOME"), variable("HOME")};
}

std::string dataFile(const DataFolders& folders, const std::string& name) {
  return (folderOf(folders) / name).string();
}

}  // namespace smartmill
