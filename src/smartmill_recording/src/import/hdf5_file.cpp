#include <hdf5.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <functional>

#include "hdf5_errors.h"
#include "hdf5_handle.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_recording/import/channel_file.h"

namespace smartmill::recording {
namespace {

// The structure of H5Oget_info2() and H5Ovisit2() has a name of its own since HDF5 1.12.
#if H5_VERSION_GE(1, 12, 0)
using ObjectInfo = H5O_info1_t;
#else
using ObjectInfo = H5O_info_t;
#endif

constexpr hsize_t LONGEST_WORD = 1000;  // [byte] of an attribute

bool isNumeric(hid_t type) {
  const H5T_class_t kind = H5Tget_class(type);
  return kind == H5T_INTEGER || kind == H5T_FLOAT;
}

std::string readWord(hid_t attribute, hid_t type) {
  const Hdf5Handle space(H5Aget_space(attribute), H5Sclose);
  if (H5Sget_simple_extent_npoints(space) != 1) return {};
  const Hdf5Handle memory(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_cset(memory, H5Tget_cset(type));
  if (H5Tis_variable_str(type) > 0) {
    H5Tset_size(memory, H5T_VARIABLE);
    char* text = nullptr;
    if (H5Aread(attribute, memory, &text) < 0 || !text) return {};
    const std::string word = text;
    H5Dvlen_reclaim(memory, space, H5P_DEFAULT, &text);
    return word;
  }
  const std::size_t size = H5Tget_size(type);
  if (size == 0 || size > LONGEST_WORD) return {};
  std::string word(size + 1, '\0');
  H5Tset_size(memory, size + 1);
  if (H5Aread(attribute, memory, word.data()) < 0) return {};
  return word.substr(0, word.find('\0'));
}

/// Attributes of an object as PATH/NAME.
void readAttributes(hid_t object, const std::string& path, ChannelFile* file) {
  ObjectInfo info;
  if (H5Oget_info2(object, &info, H5O_INFO_NUM_ATTRS) < 0) return;
  for (hsize_t i = 0; i < info.num_attrs; ++i) {
    const Hdf5Handle attribute(
        H5Aopen_by_idx(object, ".", H5_INDEX_NAME, H5_ITER_INC, i, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
    if (attribute < 0) continue;
    std::array<char, 256> name{};
    H5Aget_name(attribute, name.size(), name.data());
    const Hdf5Handle type(H5Aget_type(attribute), H5Tclose), space(H5Aget_space(attribute), H5Sclose);
    const std::string key = (path.empty() ? "" : path + "/") + name.data();
    double value = 0.0;
    if (H5Tget_class(type) == H5T_STRING) {
      file->words[key] = readWord(attribute, type);
    } else if (isNumeric(type) && H5Sget_simple_extent_npoints(space) == 1 &&
               H5Aread(attribute, H5T_NATIVE_DOUBLE, &value) >= 0) {
      file->numbers[key] = value;
    }
  }
}

void readDataset(hid_t dataset, const std::string& path, ChannelFile* file) {
  const Hdf5Handle type(H5Dget_type(dataset), H5Tclose), space(H5Dget_space(dataset), H5Sclose);
  const int rank = H5Sget_simple_extent_ndims(space);
  const hssize_t count = H5Sget_simple_extent_npoints(space);
  if (!isNumeric(type)) {
    file->notes.push_back(path + ": not numeric, not read");
    return;
  }
  if (rank > 2 || count == 0) {
    file->notes.push_back(
        path + (count == 0 ? ": is empty" : formatted(": an array of %d dimensions, not read", rank)));
    return;
  }
  if (rank < 0 || count < 0) throw Error(file->file + ": " + path + ": damaged");
  if (static_cast<double>(count) > MOST_VALUES)
    throw Error(file->file + formatted(": %s: %lld values, at most %.0f are read", path.c_str(),
                                       static_cast<long long>(count), MOST_VALUES));
  if (H5Dget_storage_size(dataset) == 0)
    throw Error(file->file + ": " + path + ": its values were never written");
  std::vector<double> values(static_cast<std::size_t>(count));
  if (H5Dread(dataset, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) < 0)
    throw Error(file->file + ": " + path + ": its values cannot be read; the file is damaged");
  if (count == 1) {
    file->numbers[path] = values.front();
    return;
  }
  std::array<hsize_t, 2> dims{1, 1};
  H5Sget_simple_extent_dims(space, dims.data(), nullptr);
  if (rank == 1) {
    file->channels.push_back({path, "", std::move(values)});
    return;
  }
  const bool upright = dims[0] >= dims[1];  // the longer side is time
  const hsize_t channels = upright ? dims[1] : dims[0], samples = upright ? dims[0] : dims[1];
  for (hsize_t c = 0; c < channels; ++c) {
    FileChannel channel{channels == 1 ? path : path + ":" + std::to_string(c + 1), "", {}};
    channel.values.reserve(samples);
    for (hsize_t i = 0; i < samples; ++i)
      channel.values.push_back(values[upright ? i * dims[1] + c : c * dims[1] + i]);
    file->channels.push_back(std::move(channel));
  }
}

struct Visit {
  ChannelFile* file;
  std::exception_ptr fault;
};

// Called by libhdf5, which no exception may pass.
herr_t visit(hid_t root, const char* name, const ObjectInfo* info, void* data) {
  auto& to = *static_cast<Visit*>(data);
  try {
    const std::string path = std::string(name) == "." ? "" : name;
    const Hdf5Handle object(H5Oopen(root, name, H5P_DEFAULT), H5Oclose);
    if (object < 0) throw Error(to.file->file + ": " + path + ": cannot be read; the file is damaged");
    readAttributes(object, path, to.file);
    if (info->type == H5O_TYPE_DATASET) readDataset(object, path, to.file);
    return 0;
  } catch (...) {
    to.fault = std::current_exception();
    return -1;
  }
}

std::string folderOf(const std::string& path) {
  const std::size_t at = path.rfind('/');
  return at == std::string::npos ? "" : path.substr(0, at);
}

/// The rate nearest to the channels: of a dataset, its group, the group above it, ..., the root. All must
/// agree.
void takeRate(ChannelFile* file) {
  for (const FileChannel& channel : file->channels) {
    for (std::string path = channel.name.substr(0, channel.name.find(':'));; path = folderOf(path)) {
      bool found = false;
      for (const char* name : {"sample_rate_hz", "sample_rate", "dt"}) {
        const std::string key = (path.empty() ? "" : path + "/") + name;
        const auto at = file->numbers.find(key);
        if (at == file->numbers.end()) continue;
        const double rate = std::string(name) == "dt" ? 1.0 / at->second : at->second;
        if (!(at->second > 0.0) || !std::isfinite(rate))
          throw Error(file->file + ": " + key + ": expected a sample rate or step above 0");
        if (file->sample_rate && std::abs(*file->sample_rate / rate - 1.0) > 1e-6)
          throw Error(file->file + formatted(": %s states %g Hz, %s %g Hz; expected one rate per file",
                                             key.c_str(), rate, file->sample_rate_from.c_str(),
                                             *file->sample_rate));
        file->sample_rate = rate;
        file->sample_rate_from = key;
        found = true;
        break;
      }
      if (found || path.empty()) break;
    }
  }
}

}  // namespace

ChannelFile readHdf5File(const std::string& file) {
  const Hdf5ErrorsOff quiet;
  ChannelFile result;
  result.file = file;
  result.kind = "HDF5";
  const Hdf5Handle id(H5Fopen(file.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
  if (id < 0) throw Error(file + ": not a readable HDF5 file: truncated or damaged");
  Visit to{&result, nullptr};
  const herr_t code = H5Ovisit2(id, H5_INDEX_NAME, H5_ITER_INC, visit, &to, H5O_INFO_BASIC);
  if (to.fault) std::rethrow_exception(to.fault);
  if (code < 0) throw Error(file + ": not a readable HDF5 file: truncated or damaged");
  for (FileChannel& channel : result.channels) {
    const std::string path = channel.name.substr(0, channel.name.find(':'));
    for (const char* name : {"/unit", "/units"}) {
      const auto at = result.words.find(path + name);
      if (at != result.words.end()) channel.unit = at->second;
    }
  }
  takeRate(&result);
  if (result.channels.empty()) throw Error(file + ": no numeric dataset of rank 1 or 2");
  return result;
}

}  // namespace smartmill::recording
