#pragma once

#include <map>
#include <optional>
#include <string>

#include "smartmill_core/model/machine_model.h"

namespace smartmill {

/// "N=FILE", the model file of tool N, or "FILE".
struct ToolFile {
  std::optional<int> number;  ///< of at most four digits; empty: the text has none
  std::string file;
};
ToolFile toolFileOf(const std::string& text);

/// Models of several tools by their number (T). @param text "N=FILE ...", separated by blanks; may be empty
/// @param key for messages @throws Error on another form, a number twice, and as readMachineModel
std::map<int, MachineModel> readToolModels(const std::string& text, const std::string& key);

}  // namespace smartmill
