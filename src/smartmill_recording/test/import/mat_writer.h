#pragma once

#include <matio.h>

#include <cstring>
#include <string>
#include <utility>
#include <vector>

namespace smartmill::recording {

/// Writes MATLAB files with libmatio for the tests.
class MatWriter {
 public:
  MatWriter(const std::string& file, mat_ft version, matio_compression packing = MAT_COMPRESSION_NONE)
      : mat_(Mat_CreateVer(file.c_str(), nullptr, version)), packing_(packing) {}
  ~MatWriter() { Mat_Close(mat_); }
  MatWriter(const MatWriter&) = delete;
  MatWriter& operator=(const MatWriter&) = delete;

  static matvar_t* numbers(const std::string& name, std::vector<double> values, std::size_t columns = 1) {
    std::size_t dims[2] = {values.size() / columns, columns};
    return Mat_VarCreate(name.c_str(), MAT_C_DOUBLE, MAT_T_DOUBLE, 2, dims, values.data(), 0);
  }
  static matvar_t* word(const std::string& name, std::string text) {
    std::size_t dims[2] = {1, text.size()};
    return Mat_VarCreate(name.c_str(), MAT_C_CHAR, MAT_T_UTF8, 2, dims, text.data(), 0);
  }
  static matvar_t* structOf(const std::string& name,
                            const std::vector<std::pair<std::string, matvar_t*>>& fields) {
    std::vector<const char*> names;
    for (const auto& field : fields) names.push_back(field.first.c_str());
    std::size_t dims[2] = {1, 1};
    matvar_t* all =
        Mat_VarCreateStruct(name.c_str(), 2, dims, names.data(), static_cast<unsigned>(names.size()));
    for (const auto& [field, value] : fields) Mat_VarSetStructFieldByName(all, field.c_str(), 0, value);
    return all;
  }
  void add(matvar_t* variable) {
    Mat_VarWrite(mat_, variable, packing_);
    Mat_VarFree(variable);
  }

 private:
  mat_t* mat_;
  matio_compression packing_;
};

}  // namespace smartmill::recording
