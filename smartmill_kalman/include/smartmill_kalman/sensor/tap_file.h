#pragma once

#include <string>
#include <vector>

#include "smartmill_kalman/sensor/transfer_matrix.h"

namespace smartmill::kalman {

/// Taps of one sensor at one sample rate.
struct TapRecords {
  std::vector<MatrixTap> taps;
  double rate = 0.0;  ///< [Hz]
};

/// A smartmill-taps/1 file and the tables that it names. @throws Error naming file, key and value.
TapRecords readTapFile(const std::string& path);
/// Writes the file and its tables NAME_01.csv ... in the same folder. @throws Error.
void writeTapFile(const TapRecords& records, const std::string& path);

}  // namespace smartmill::kalman
