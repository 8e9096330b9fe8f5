#include "smartmill_core/io/secret_file.h"

#include <cctype>
#include <filesystem>
#include <fstream>

#include "smartmill_core/error.h"

namespace smartmill {

std::string readSecret(const std::string& key, const std::string& file) {
  namespace fs = std::filesystem;
  std::ifstream in(file);
  std::string secret;
  if (!in.is_open() || !std::getline(in, secret)) throw Error(key + " " + file + ": cannot be read");
  std::error_code failed;
  const fs::perms others = fs::perms::group_all | fs::perms::others_all;
  if ((fs::status(file, failed).permissions() & others) != fs::perms::none)
    throw Error(key + " " + file + ": readable by others, expected mode 600 (chmod 600)");
  while (!secret.empty() && std::isspace(static_cast<unsigned char>(secret.back()))) secret.pop_back();
  return secret;
}

}  // namespace smartmill
