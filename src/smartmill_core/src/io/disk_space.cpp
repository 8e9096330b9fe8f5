#include "smartmill_core/io/disk_space.h"

#include <filesystem>
#include <system_error>

#include "smartmill_core/error.h"

namespace smartmill {

DiskSpace diskSpaceOf(const std::string& file) {
  namespace fs = std::filesystem;
  std::error_code error;
  const fs::path folder =
      fs::is_directory(file, error) ? fs::path(file) : fs::absolute(file, error).parent_path();
  const fs::space_info space = fs::space(folder, error);
  if (error) throw Error(file + ": free space of the disk: " + error.message());
  return {static_cast<double>(space.available), static_cast<double>(space.capacity)};
}

}  // namespace smartmill
