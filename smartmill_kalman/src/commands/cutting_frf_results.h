#pragma once

#include <array>
#include <string>
#include <vector>

#include "smartmill_core/io/csv.h"
#include "smartmill_kalman/in_cut/cutting_frf.h"

namespace smartmill::kalman {

struct CuttingFrfRequest {
  std::string campaign, out, model, of = "tool", response, spindle_sensor;
  double length = 0.139;                                         // [m]
  double force_error = 1.0;                                      // [%]
  double speed_width = 100.0 * CuttingFrfOptions().speed_width;  // [%]
  bool identify = false, no_picture = false;
  CuttingFrfOptions options;
};

/// An axis: its lines in the cuts, and the tap at rest.
struct CuttingFrfAxis {
  std::size_t axis = 0;
  std::vector<FrfLine> lines;
  ModalModel rest;
  std::vector<SpeedFrf> found;
};

/// Prints the modes of the tap at rest.
void printRest(const CuttingFrfAxis& axis, bool receptance);
/// Prints the modes at a speed and adds them to the table.
void printFrf(const CuttingFrfAxis& axis, const SpeedFrf& frf, bool receptance, CsvWriter& table);
/// Ending of the files of an axis at a speed, e.g. "_x_6000".
std::string suffixOf(const CuttingFrfAxis& axis, const SpeedFrf& frf);
/// Magnitude over frequency at every speed, with the tap at rest.
void drawAxis(const CuttingFrfAxis& axis, const CuttingFrfRequest& request);

}  // namespace smartmill::kalman
