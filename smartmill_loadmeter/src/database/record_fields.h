#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "smartmill_loadmeter/database/database.h"

namespace smartmill::loadmeter {

/// Field of a record, for SQL, CSV and YAML.
struct NumberField {
  std::string name;  ///< column of the table; with [unit] in files
  std::string unit;  ///< SI
  double (*get)(const CoefficientRecord&, std::size_t);
  void (*set)(CoefficientRecord&, std::size_t, double);
  std::size_t index;
  bool since_schema_3 = false;  ///< absent from older files; unknown, it is not part of a record's identity
};
struct TextField {
  std::string name;
  std::string& (*at)(CoefficientRecord&);
};

const std::vector<TextField>& textFields();
const std::vector<NumberField>& numberFields();

/// Kind of record: its table in file and server, text columns first.
struct RecordKind {
  std::string table;
  std::vector<std::string> words, numbers;
  bool by_speed = false;  ///< has the indexed column speed_bucket

  /// Column names of a Row, identity first, with `prefix`, separated by commas.
  std::string columns(const std::string& prefix = "") const;
};

/// Record of any kind in storage and transfer. NaN: unknown.
struct Row {
  std::string identity;
  std::int64_t speed_bucket = 0;
  std::vector<std::string> words;
  std::vector<double> numbers;
};

/// @{ All kinds, in the order of transfer.
const std::vector<RecordKind>& recordKinds();
const RecordKind& coefficientKind();
const RecordKind& improvementKind();
const RecordKind& healthKind();
const RecordKind& inspectionKind();
/// @}

/// @{ Conversion between a record and its row. @throws Error when its stamp is not a number.
Row rowOf(CoefficientRecord record);
Row rowOf(const ModelImprovement& improvement);
Row rowOf(const HealthRecord& health);
Row rowOf(const InspectionRecord& inspection);
void readRow(const Row& row, CoefficientRecord* record);
void readRow(const Row& row, ModelImprovement* improvement);
void readRow(const Row& row, HealthRecord* health);
void readRow(const Row& row, InspectionRecord* inspection);
/// @}

/// 17 significant digits; empty for NaN.
std::string exactNumber(double value);

/// Columns of all fields, text first, separated by commas.
std::string columns();

/// Two FNV-1a hashes of the content, equal on every machine, so that merging twice adds nothing.
std::string identityOf(CoefficientRecord record);
std::string identityOf(const std::string& content);

/// @{ Queries use buckets of half an octave of cutting speed.
constexpr int NO_SPEED = -1000000;  ///< bucket of records without a cutting speed
constexpr int BUCKETS = 7;          ///< searched on each side
constexpr int NEWEST = 16;          ///< newest records used of a bucket
int bucketOf(double cutting_speed);
/// @}

}  // namespace smartmill::loadmeter
