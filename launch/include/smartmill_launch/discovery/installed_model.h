#pragma once

#include <string>

namespace smartmill::discovery {

/// The model file in use. Replaced models are kept in the same folder.
class InstalledModel {
 public:
  /// @param folder of installed.yaml and of the replaced models replaced_1.yaml, replaced_2.yaml ...
  /// @param in_use model file in use at the start
  InstalledModel(std::string folder, std::string in_use);

  const std::string& inUse() const { return in_use_; }

  /// Keeps the model in use as replaced_N.yaml and copies the new model to installed.yaml, atomically.
  /// @throws Error naming the file that cannot be written; then nothing has changed.
  void install(const std::string& model);
  /// Reverts the last install().
  void undo();

  const std::string& replaced() const { return replaced_; }  ///< file of the previous model; empty: none

 private:
  std::string folder_, in_use_, previous_, replaced_;
};

}  // namespace smartmill::discovery
