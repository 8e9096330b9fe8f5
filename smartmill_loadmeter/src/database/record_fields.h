#pragma once

#include <array>
#include <cstdint>
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

/// A kind of record: its table in both homes, columns words first.
struct RecordKind {
  std::string table;
  std::vector<std::string> words, numbers;
  bool by_speed = false;  ///< has the column speed_bucket, by which it is looked up

  /// Names of what a Row holds, identity first, each after `prefix`, between commas.
  std::string columns(const std::string& prefix = "") const;
};

/// A record of any kind, as it is stored and handed on. NaN: not known.
struct Row {
  std::string identity;
  std::int64_t speed_bucket = 0;
  std::vector<std::string> words;
  std::vector<double> numbers;
};

/// @{ All kinds there are, in the order in which they are handed on.
const std::vector<RecordKind>& recordKinds();
const RecordKind& coefficientKind();
const RecordKind& improvementKind();
const RecordKind& healthKind();
/// @}

/// @{ Between a record and its row. @throws Error when its stamp is not a number.
Row rowOf(CoefficientRecord record);
Row rowOf(const ModelImprovement& improvement);
Row rowOf(const HealthRecord& health);
void take(const Row& row, CoefficientRecord* record);
void take(const Row& row, ModelImprovement* improvement);
void take(const Row& row, HealthRecord* health);
/// @}

/// 17 significant digits; empty for NaN.
std::string exactNumber(double value);

/// Columns of all fields, words first, between commas.
std::string columns();

/// Two FNV-1a hashes of everything that was identified: the same everywhere, so that merging twice adds
/// nothing.
std::string identityOf(CoefficientRecord record);
std::string identityOf(const std::string& content);

/// @{ Records are looked up by half octaves of cutting speed.
constexpr int NO_SPEED = -1000000;  ///< bucket of records without a cutting speed
constexpr int BUCKETS = 7;          ///< looked at on each side
constexpr int NEWEST = 16;          ///< records of a bucket that count
int bucketOf(double cutting_speed);
/// @}

}  // namespace smartmill::loadmeter
