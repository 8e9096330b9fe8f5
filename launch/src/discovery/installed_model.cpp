#include "smartmill_launch/discovery/installed_model.h"

#include <filesystem>
#include <utility>

#include "smartmill_core/error.h"

namespace smartmill::discovery {
namespace {

namespace fs = std::filesystem;

/// Copies to a temporary file in the same folder, then renames it: the target is never incomplete.
void copyAtomically(const std::string& from, const std::string& to) {
  std::error_code failed;
  const std::string temporary = to + ".part";
  fs::copy_file(from, temporary, fs::copy_options::overwrite_existing, failed);
  if (!failed) fs::rename(temporary, to, failed);
  if (!failed) return;
  const std::string reason = failed.message();
  fs::remove(temporary, failed);
  throw Error(to + ": cannot be written: " + reason);
}

}  // namespace

InstalledModel::InstalledModel(std::string folder, std::string in_use)
    : folder_(std::move(folder)), in_use_(std::move(in_use)) {
}

void InstalledModel::install(const std::string& model) {
  std::error_code failed;
  fs::create_directories(folder_, failed);
  if (failed) throw Error(folder_ + ": " + failed.message());
  int k = 1;
  while (fs::exists(folder_ + "/replaced_" + std::to_string(k) + ".yaml")) ++k;
  const std::string replaced = folder_ + "/replaced_" + std::to_string(k) + ".yaml";
  const std::string installed = folder_ + "/installed.yaml";
  copyAtomically(in_use_, replaced);
  try {
    copyAtomically(model, installed);
  } catch (const Error&) {
    fs::remove(replaced, failed);
    throw;
  }
  previous_ = std::exchange(in_use_, installed);
  replaced_ = replaced;
}

void InstalledModel::undo() {
  if (replaced_.empty()) return;
  if (previous_ == in_use_) {
    copyAtomically(replaced_, in_use_);
  } else {
    std::error_code ignored;
    fs::remove(in_use_, ignored);
  }
  in_use_ = previous_;
  std::error_code ignored;
  fs::remove(replaced_, ignored);
  replaced_.clear();
}

}  // namespace smartmill::discovery
