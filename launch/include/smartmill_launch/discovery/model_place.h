#pragma once

#include <string>

namespace smartmill::discovery {

/// The file at which the model in use stands; what stood there before is kept beside it.
class ModelPlace {
 public:
  /// @param folder that holds installed.yaml and replaced_1.yaml, replaced_2.yaml ...
  /// @param in_use file of the model that is in use now
  ModelPlace(std::string folder, std::string in_use);

  const std::string& inUse() const { return in_use_; }

  /// Puts a copy of a model in place, the one in use kept. Whole or not at all.
  /// @throws Error naming the file that cannot be written; then nothing has changed.
  void install(const std::string& model);
  /// Takes the last install() back.
  void undo();

  const std::string& kept() const { return kept_; }  ///< file of the one before; empty: none yet

 private:
  std::string folder_, in_use_, before_, kept_;
};

}  // namespace smartmill::discovery
