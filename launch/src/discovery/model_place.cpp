#include "smartmill_launch/discovery/model_place.h"

#include <filesystem>
#include <utility>

#include "smartmill_core/error.h"

namespace smartmill::discovery {
namespace {

namespace fs = std::filesystem;

/// Beside its place first, then by a rename: never half a file.
void copyWhole(const std::string& from, const std::string& to) {
  std::error_code failed;
  const std::string partly = to + ".part";
  fs::copy_file(from, partly, fs::copy_options::overwrite_existing, failed);
  if (!failed) fs::rename(partly, to, failed);
  if (!failed) return;
  const std::string why = failed.message();
  fs::remove(partly, failed);
  throw Error(to + ": cannot be written: " + why);
}

}  // namespace

ModelPlace::ModelPlace(std::string folder, std::string in_use)
    : folder_(std::move(folder)), in_use_(std::move(in_use)) {
}

void ModelPlace::install(const std::string& model) {
  std::error_code failed;
  fs::create_directories(folder_, failed);
  if (failed) throw Error(folder_ + ": " + failed.message());
  int k = 1;
  while (fs::exists(folder_ + "/replaced_" + std::to_string(k) + ".yaml")) ++k;
  const std::string kept = folder_ + "/replaced_" + std::to_string(k) + ".yaml";
  const std::string place = folder_ + "/installed.yaml";
  copyWhole(in_use_, kept);
  try {
    copyWhole(model, place);
  } catch (const Error&) {
    fs::remove(kept, failed);
    throw;
  }
  before_ = std::exchange(in_use_, place);
  kept_ = kept;
}

void ModelPlace::undo() {
  if (kept_.empty()) return;
  if (before_ == in_use_) {
    copyWhole(kept_, in_use_);
  } else {
    std::error_code ignored;
    fs::remove(in_use_, ignored);
  }
  in_use_ = before_;
  std::error_code ignored;
  fs::remove(kept_, ignored);
  kept_.clear();
}

}  // namespace smartmill::discovery
