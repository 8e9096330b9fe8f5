#pragma once

#include <array>
#include <string>
#include <vector>

#include "smartmill_loadmeter/database/database.h"

namespace smartmill::loadmeter {

/// One table of the fields of a record, which SQL, CSV and YAML share.
struct NumberField {
  std::string name;  ///< column of the table; in files with [unit]
  std::string unit;  ///< SI
  double (*get)(const CoefficientRecord&, std::size_t);
  void (*set)(CoefficientRecord&, std::size_t, double);
  std::size_t index;
};
struct WordField {
  std::string name;
  std::string& (*at)(CoefficientRecord&);
};

const std::vector<WordField>& wordFields();
const std::vector<NumberField>& numberFields();

/// 17 significant digits; empty for NaN.
std::string exactNumber(double value);

}  // namespace smartmill::loadmeter
