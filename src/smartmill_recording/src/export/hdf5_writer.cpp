#include <hdf5.h>

#include <algorithm>

#include "hdf5_errors.h"
#include "hdf5_handle.h"
#include "smartmill_core/error.h"
#include "smartmill_recording/export/exported_stream.h"

namespace smartmill::recording {
namespace {

constexpr hsize_t CHUNK = 65536;  // values
constexpr unsigned PACKING = 4;   // level of zlib

void requireDone(herr_t result, const std::string& file, const std::string& what) {
  if (result < 0) throw Error(file + ": " + what + " cannot be written");
}

void writeAttribute(hid_t object, const char* name, hid_t type, const void* value, const std::string& file) {
  const Hdf5Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  const Hdf5Handle attribute(H5Acreate2(object, name, type, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
  requireDone(H5Awrite(attribute, type, value), file, name);
}

void writeNumber(hid_t object, const char* name, double value, const std::string& file) {
  writeAttribute(object, name, H5T_NATIVE_DOUBLE, &value, file);
}

void writeColumn(hid_t group, const ExportedColumn& column, const std::string& file) {
  const hsize_t count = column.values.size();
  const hsize_t dims[1] = {count}, chunk[1] = {std::min(count, CHUNK)};
  const Hdf5Handle space(H5Screate_simple(1, dims, nullptr), H5Sclose);
  const Hdf5Handle options(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  H5Pset_chunk(options, 1, chunk);
  H5Pset_obj_track_times(options, false);  // the same input gives the same bytes
  H5Pset_shuffle(options);
  H5Pset_deflate(options, PACKING);
  const Hdf5Handle dataset(
      H5Dcreate2(group, column.name.c_str(), H5T_IEEE_F64LE, space, H5P_DEFAULT, options, H5P_DEFAULT),
      H5Dclose);
  requireDone(H5Dwrite(dataset, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, column.values.data()), file,
              column.name);
  if (column.unit.empty()) return;
  const Hdf5Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_size(type, column.unit.size());
  writeAttribute(dataset, "unit", type, column.unit.data(), file);
}

}  // namespace

void writeHdf5File(const std::vector<ExportedStream>& streams, const std::string& file) {
  const Hdf5ErrorsOff quiet;
  const Hdf5Handle out(H5Fcreate(file.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT), H5Fclose);
  if (out < 0) throw Error(file + ": cannot be written");
  const Hdf5Handle nested(H5Pcreate(H5P_LINK_CREATE), H5Pclose);
  H5Pset_create_intermediate_group(nested, 1);
  for (const ExportedStream& stream : streams) {
    const Hdf5Handle group(H5Gcreate2(out, stream.name.c_str(), nested, H5P_DEFAULT, H5P_DEFAULT), H5Gclose);
    requireDone(group < 0 ? -1 : 0, file, stream.name);
    writeNumber(group, "start", stream.start, file);
    if (stream.sample_rate > 0.0) writeNumber(group, "sample_rate_hz", stream.sample_rate, file);
    for (const ExportedColumn& column : stream.columns) writeColumn(group, column, file);
  }
  requireDone(H5Fflush(out, H5F_SCOPE_GLOBAL), file, "the end of the file");
}

}  // namespace smartmill::recording
