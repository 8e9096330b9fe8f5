#include <algorithm>
#include <cmath>
#include <complex>
#include <filesystem>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/error.h"
#include "smartmill_core/io/csv.h"
#include "smartmill_core/io/uff.h"
#include "smartmill_recording/export/exported_stream.h"

namespace smartmill::recording {
namespace {

constexpr int DIGITS = 9;  // significant, as the records of a campaign

/// Kind of data of a universal file by unit.
int kindOf(const std::string& unit) {
  if (unit == "N") return uff::REACTION_FORCE;
  if (unit == "m") return uff::DISPLACEMENT;
  if (unit == "m/s") return uff::VELOCITY;
  return unit == "m/s2" ? uff::ACCELERATION : 0;
}

/// 1..3 for a name that ends in x, y or z; 0: a scalar.
int directionOf(const std::string& name) {
  const auto axis = name.empty() ? std::nullopt : axisIndex(name.substr(name.size() - 1));
  return axis ? static_cast<int>(*axis) + 1 : 0;
}

}  // namespace

void writeUffFile(const std::vector<ExportedStream>& streams, const std::string& file) {
  std::vector<UffFunction> functions;
  for (const ExportedStream& stream : streams) {
    for (std::size_t c = 1; c < stream.columns.size(); ++c) {
      const ExportedColumn& column = stream.columns[c];
      UffFunction function;
      function.type = uff::TIME_RESPONSE;
      function.name = stream.name + " " + column.name;
      function.response_node = 1;
      function.response_direction = directionOf(column.name);
      function.numerator = kindOf(column.unit);
      function.unit = column.unit;
      function.abscissa = stream.columns[0].values;
      function.value.assign(column.values.begin(), column.values.end());
      functions.push_back(std::move(function));
    }
  }
  writeUff(functions, file, true);
}

void writeCsvFolder(const std::vector<ExportedStream>& streams, const std::string& folder) {
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  if (failed) throw Error(folder + ": cannot be created: " + failed.message());
  for (const ExportedStream& stream : streams) {
    std::string header;
    for (const ExportedColumn& column : stream.columns)
      header += (header.empty() ? "" : ",") + column.name + "[" + column.unit + "]";
    CsvWriter table(header, DIGITS);
    for (std::size_t i = 0; i < stream.size(); ++i) {
      for (const ExportedColumn& column : stream.columns) table.cell(column.values[i]);
      table.endRow();
    }
    std::string name = stream.name;
    std::replace(name.begin(), name.end(), '/', '_');
    table.save((std::filesystem::path(folder) / (name + ".csv")).string());
  }
}

}  // namespace smartmill::recording
