#include "smartmill_core/testing/shared_data.h"

#include <cstdlib>
#include <filesystem>

namespace smartmill {

std::string sharedFolder() {
  const char* given = std::getenv("SMARTMILL_SHARED");
  return given ? given : SMARTMILL_SHARED_DEFAULT;
}

std::string sharedData(const std::string& name) {
  const std::string path = sharedFolder() + "/" + name;
  return std::filesystem::exists(path) ? path : std::string();
}

}  // namespace smartmill
