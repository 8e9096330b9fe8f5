#include <matio.h>

#include <array>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <memory>

#include "hdf5_errors.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_recording/import/channel_file.h"

namespace smartmill::recording {
namespace {

constexpr std::uint64_t HEADER = 128;            // [byte] of a file of version 5 (MAT-File Format, MathWorks)
constexpr std::uint64_t LARGEST_PACKING = 1100;  // values in a byte: zlib packs at most 1032 to 1

struct Closer {
  void operator()(mat_t* file) const { Mat_Close(file); }
  void operator()(matvar_t* variable) const { Mat_VarFree(variable); }
};

/// Size of a file, after a check that its elements end inside it: libmatio takes a cut file for a shorter
/// one.
std::uint64_t checkedSize(const std::string& file) {
  std::ifstream stream(file, std::ios::binary | std::ios::ate);
  const auto size = static_cast<std::uint64_t>(stream.tellg());
  std::array<char, HEADER> head{};
  stream.seekg(0);
  if (size < HEADER || !stream.read(head.data(), HEADER))
    throw Error(file + formatted(": truncated: %llu bytes, a header of 128 bytes expected",
                                 static_cast<unsigned long long>(size)));
  if (std::memcmp(head.data(), "MATLAB 5.0", 10) != 0) return size;  // 7.3: HDF5 checks its own end
  const bool little = head[126] == 'I' && head[127] == 'M';
  if (!little && !(head[126] == 'M' && head[127] == 'I'))
    throw Error(file + ": not a MATLAB file: no byte order mark in the header");
  const auto number = [&](const unsigned char* b) {
    return little ? b[0] | b[1] << 8 | b[2] << 16 | static_cast<std::uint32_t>(b[3]) << 24
                  : b[3] | b[2] << 8 | b[1] << 16 | static_cast<std::uint32_t>(b[0]) << 24;
  };
  for (std::uint64_t at = HEADER; at < size;) {
    std::array<unsigned char, 8> tag{};
    stream.seekg(static_cast<std::streamoff>(at));
    if (at + 8 > size || !stream.read(reinterpret_cast<char*>(tag.data()), 8))
      throw Error(file + formatted(": truncated at byte %llu", static_cast<unsigned long long>(size)));
    const std::uint32_t type = number(tag.data()), bytes = number(tag.data() + 4);
    if (type != MAT_T_MATRIX && type != MAT_T_COMPRESSED)
      throw Error(file + formatted(": byte %llu: element type %u, a variable expected",
                                   static_cast<unsigned long long>(at), type));
    if (bytes > size - at - 8)
      throw Error(file + formatted(": truncated: the variable at byte %llu has %u bytes, %llu follow",
                                   static_cast<unsigned long long>(at), bytes,
                                   static_cast<unsigned long long>(size - at - 8)));
    at += 8 + bytes;
  }
  return size;
}

double countOf(const matvar_t& variable) {
  double count = 1.0;
  for (int d = 0; d < variable.rank; ++d) count *= static_cast<double>(variable.dims[d]);
  return count;
}

bool isNumeric(const matvar_t& v) {
  return v.class_type >= MAT_C_DOUBLE && v.class_type <= MAT_C_UINT64;
}

/// What is refused or passed over, before any value is read.
void checkClaim(const matvar_t& v, const std::string& name, std::uint64_t size, const std::string& file) {
  if (v.rank < 0 || (v.rank > 0 && !v.dims)) throw Error(file + ": " + name + ": damaged");
  const double count = countOf(v);
  if (count > MOST_VALUES)
    throw Error(file +
                formatted(": %s: %.0f values, at most %.0f are read", name.c_str(), count, MOST_VALUES));
  if (count > static_cast<double>(size) * LARGEST_PACKING)
    throw Error(file + formatted(": %s: %.0f values in a file of %llu bytes: damaged", name.c_str(), count,
                                 static_cast<unsigned long long>(size)));
  if (v.class_type != MAT_C_STRUCT || count != 1.0) return;
  if (!v.data || v.nbytes == 0)
    throw Error(file + ": " + name + ": a struct without its fields; the file is damaged");
  auto& changeable = const_cast<matvar_t&>(v);  // libmatio's getters take no const
  char* const* names = Mat_VarGetStructFieldnames(&v);
  for (unsigned f = 0; names && f < Mat_VarGetNumberOfFields(&changeable); ++f) {
    const matvar_t* field = Mat_VarGetStructFieldByIndex(&changeable, f, 0);
    if (field) checkClaim(*field, name + "." + names[f], size, file);
  }
}

template <typename T>
void append(const void* data, std::size_t begin, std::size_t step, std::size_t count,
            std::vector<double>* to) {
  const T* values = static_cast<const T*>(data);
  for (std::size_t i = 0; i < count; ++i) to->push_back(static_cast<double>(values[begin + i * step]));
}

bool appendValues(const matvar_t& v, std::size_t begin, std::size_t step, std::size_t count,
                  std::vector<double>* to) {
  switch (v.data_type) {
    case MAT_T_DOUBLE:
      append<double>(v.data, begin, step, count, to);
      return true;
    case MAT_T_SINGLE:
      append<float>(v.data, begin, step, count, to);
      return true;
    case MAT_T_INT8:
      append<std::int8_t>(v.data, begin, step, count, to);
      return true;
    case MAT_T_UINT8:
      append<std::uint8_t>(v.data, begin, step, count, to);
      return true;
    case MAT_T_INT16:
      append<std::int16_t>(v.data, begin, step, count, to);
      return true;
    case MAT_T_UINT16:
      append<std::uint16_t>(v.data, begin, step, count, to);
      return true;
    case MAT_T_INT32:
      append<std::int32_t>(v.data, begin, step, count, to);
      return true;
    case MAT_T_UINT32:
      append<std::uint32_t>(v.data, begin, step, count, to);
      return true;
    case MAT_T_INT64:
      append<std::int64_t>(v.data, begin, step, count, to);
      return true;
    case MAT_T_UINT64:
      append<std::uint64_t>(v.data, begin, step, count, to);
      return true;
    default:
      return false;
  }
}

void addWord(const matvar_t& v, const std::string& name, ChannelFile* file) {
  const auto count = static_cast<std::size_t>(countOf(v));
  if (!v.data || v.data_size < 1) return;
  std::string word;
  for (std::size_t i = 0; i < count && (i + 1) * static_cast<std::size_t>(v.data_size) <= v.nbytes; ++i) {
    const unsigned char* c =
        static_cast<const unsigned char*>(v.data) + i * static_cast<std::size_t>(v.data_size);
    const bool wide = v.data_size > 1 && c[1] != 0;
    if (v.data_size > 1 && !wide && c[0] > 0x7F) {  // Latin-1 letters of UTF-16 as UTF-8
      word += static_cast<char>(0xC0 | c[0] >> 6);
      word += static_cast<char>(0x80 | (c[0] & 0x3F));
    } else {
      word += wide ? '?' : static_cast<char>(c[0]);
    }
  }
  file->words[name] = word;
}

void addNumbers(const matvar_t& v, const std::string& name, ChannelFile* file) {
  const auto count = static_cast<std::size_t>(countOf(v));
  if (v.rank != 2) {
    file->notes.push_back(name + formatted(": an array of %d dimensions, not read", v.rank));
    return;
  }
  if (count == 0) {
    file->notes.push_back(name + ": is empty");
    return;
  }
  if (v.isComplex) {
    file->notes.push_back(name + ": complex values, not read");
    return;
  }
  if (!v.data || v.data_size < 1 || v.nbytes < count * static_cast<std::size_t>(v.data_size))
    throw Error(file->file + ": " + name + ": its values cannot be read; the file is damaged");
  const std::size_t rows = v.dims[0], columns = v.dims[1];
  const bool upright = rows >= columns;  // the longer side is time
  const std::size_t channels = upright ? columns : rows, samples = upright ? rows : columns;
  for (std::size_t c = 0; c < channels; ++c) {
    FileChannel channel{channels == 1 ? name : name + ":" + std::to_string(c + 1), "", {}};
    channel.values.reserve(samples);
    if (!appendValues(v, upright ? c * rows : c, upright ? 1 : rows, samples, &channel.values)) {
      file->notes.push_back(name + ": values of an unknown type, not read");
      return;
    }
    if (count == 1) {
      file->numbers[name] = channel.values.front();
    } else {
      file->channels.push_back(std::move(channel));
    }
  }
}

void add(matvar_t& v, const std::string& name, bool in_struct, ChannelFile* file) {
  if (isNumeric(v)) return addNumbers(v, name, file);
  if (v.class_type == MAT_C_CHAR) return addWord(v, name, file);
  if (v.class_type == MAT_C_STRUCT && !in_struct && countOf(v) == 1.0) {
    char* const* names = Mat_VarGetStructFieldnames(&v);
    for (unsigned f = 0; names && f < Mat_VarGetNumberOfFields(&v); ++f) {
      matvar_t* field = Mat_VarGetStructFieldByIndex(&v, f, 0);
      if (field) add(*field, name + "." + names[f], true, file);
    }
    return;
  }
  const char* what = v.class_type == MAT_C_CELL     ? "a cell array"
                     : v.class_type == MAT_C_STRUCT ? (in_struct ? "a struct in a struct" : "a struct array")
                     : v.class_type == MAT_C_SPARSE ? "a sparse matrix"
                     : v.class_type == MAT_C_EMPTY  ? "empty"
                                                    : "an object or a function";
  file->notes.push_back(name + ": " + what + ", not read");
}

/// fx_unit or fx_units, s.fx_unit, units.fx.
void takeUnits(ChannelFile* file) {
  for (FileChannel& channel : file->channels) {
    const std::string whole = channel.name.substr(0, channel.name.find(':'));
    const std::size_t dot = whole.find('.');
    const std::string last = dot == std::string::npos ? whole : whole.substr(dot + 1);
    for (const std::string& name : {whole + "_unit", whole + "_units", "units." + last, "unit." + last}) {
      const auto at = file->words.find(name);
      if (at != file->words.end() && channel.unit.empty()) channel.unit = at->second;
    }
  }
}

}  // namespace

ChannelFile readMatFile(const std::string& file) {
  const std::uint64_t size = checkedSize(file);
  const Hdf5ErrorsOff quiet;
  // Without libmatio's messages: a fault is reported once, by what it makes impossible to read. The text is
  // char*, since matio 1.5.24 const char*.
  Mat_LogInitFunc("smartmill", [](int, auto* /*text*/) {});
  const std::unique_ptr<mat_t, Closer> mat(Mat_Open(file.c_str(), MAT_ACC_RDONLY));
  if (!mat) throw Error(file + ": not a readable MATLAB file");
  ChannelFile result;
  result.file = file;
  result.kind = Mat_GetVersion(mat.get()) == MAT_FT_MAT73 ? "MATLAB 7.3" : "MATLAB 5";
  std::size_t variables = 0;
  for (;;) {
    const std::unique_ptr<matvar_t, Closer> variable(Mat_VarReadNextInfo(mat.get()));
    if (!variable) break;
    ++variables;
    if (!variable->name) continue;  // an object's data
    checkClaim(*variable, variable->name, size, file);
    if (Mat_VarReadDataAll(mat.get(), variable.get()) != 0)
      throw Error(file + ": " + variable->name + ": its values cannot be read; the file is damaged");
    add(*variable, variable->name, false, &result);
  }
  if (variables == 0) throw Error(file + ": no variable can be read");
  takeUnits(&result);
  return result;
}

}  // namespace smartmill::recording
