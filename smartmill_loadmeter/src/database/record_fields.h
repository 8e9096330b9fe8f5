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

/// Columns of all fields, words first, between commas.
std::string columns();

/// Two FNV-1a hashes of everything that was identified: the same everywhere, so that merging twice adds
/// nothing.
std::string identityOf(CoefficientRecord record);

/// @{ Records are looked up by half octaves of cutting speed.
constexpr int NO_SPEED = -1000000;  ///< bucket of records without a cutting speed
constexpr int BUCKETS = 7;          ///< looked at on each side
constexpr int NEWEST = 16;          ///< records of a bucket that count
int bucketOf(double cutting_speed);
/// @}

}  // namespace smartmill::loadmeter
