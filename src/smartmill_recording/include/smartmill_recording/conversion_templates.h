#pragma once

#include "smartmill_recording/conversion/fields.h"
#include "smartmill_recording/conversion/results.h"
#include "smartmill_recording/conversion/streams.h"

/// Messages to core types and back, written once for the plain messages here and for the generated ones of
/// ROS, whose fields have the same names. read() expects a new object. What conversions.h says of errors
/// holds.
namespace smartmill::conversion {

template <class Data, class M>
Data from(const M& m) {
  Data data;
  read(m, data);
  return data;
}

template <class M, class... Arguments>
M to(const Arguments&... arguments) {
  M m;
  write(arguments..., m);
  return m;
}

}  // namespace smartmill::conversion
