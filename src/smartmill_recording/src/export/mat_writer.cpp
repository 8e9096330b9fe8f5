#include <matio.h>

#include <algorithm>
#include <cctype>
#include <memory>

#include "smartmill_core/error.h"
#include "smartmill_recording/export/exported_stream.h"

namespace smartmill::recording {
namespace {

/// Without a date, so that the same input gives the same bytes.
constexpr const char* HEADER = "MATLAB 5.0 MAT-file, written by SmartMill";

struct Closer {
  void operator()(mat_t* file) const { Mat_Close(file); }
  void operator()(matvar_t* variable) const { Mat_VarFree(variable); }
};

/// A name that MATLAB permits for a variable: letters, digits and _, the first a letter.
std::string variableName(const std::string& name) {
  std::string text;
  for (const char c : name) text += std::isalnum(static_cast<unsigned char>(c)) ? c : '_';
  return text.empty() || !std::isalpha(static_cast<unsigned char>(text.front())) ? "s_" + text : text;
}

// Mat_VarCreate() copies the data, which it takes as not const.
matvar_t* numbers(std::vector<double> values) {
  std::size_t dims[2] = {values.size(), 1};
  return Mat_VarCreate(nullptr, MAT_C_DOUBLE, MAT_T_DOUBLE, 2, dims, values.data(), 0);
}

matvar_t* word(std::string text) {
  std::size_t dims[2] = {1, text.size()};
  return Mat_VarCreate(nullptr, MAT_C_CHAR, MAT_T_UTF8, 2, dims, text.data(), 0);
}

std::unique_ptr<matvar_t, Closer> structOf(const ExportedStream& stream) {
  std::vector<std::pair<std::string, matvar_t*>> fields;
  for (const ExportedColumn& column : stream.columns) {
    const std::string name = variableName(column.name);
    fields.emplace_back(name, numbers(column.values));
    fields.emplace_back(name + "_unit", word(column.unit));
  }
  if (stream.sample_rate > 0.0) fields.emplace_back("sample_rate_hz", numbers({stream.sample_rate}));
  fields.emplace_back("start", numbers({stream.start}));
  std::vector<const char*> names;
  for (const auto& field : fields) names.push_back(field.first.c_str());
  std::size_t dims[2] = {1, 1};
  std::unique_ptr<matvar_t, Closer> all(Mat_VarCreateStruct(
      variableName(stream.name).c_str(), 2, dims, names.data(), static_cast<unsigned>(names.size())));
  for (const auto& [name, value] : fields) Mat_VarSetStructFieldByName(all.get(), name.c_str(), 0, value);
  return all;
}

}  // namespace

void writeMatFile(const std::vector<ExportedStream>& streams, const std::string& file) {
  const std::unique_ptr<mat_t, Closer> out(Mat_CreateVer(file.c_str(), HEADER, MAT_FT_MAT5));
  if (!out) throw Error(file + ": cannot be written");
  for (const ExportedStream& stream : streams) {
    const auto variable = structOf(stream);
    if (Mat_VarWrite(out.get(), variable.get(), MAT_COMPRESSION_ZLIB) != 0)
      throw Error(file + ": " + stream.name + " cannot be written");
  }
}

}  // namespace smartmill::recording
