#pragma once

namespace smartmill::sim {

/// Factors [1] on the programmed feed and spindle speed and on rapid traverse.
struct Overrides {
  struct Factors {
    double feed = 1.0, rapid = 1.0, spindle = 1.0;
  };
  Factors panel;       ///< set by the operator
  Factors data_table;  ///< set by the PMC program, in addition

  double feed(double programmed) const { return programmed * panel.feed * data_table.feed; }
  double rapid(double speed) const { return speed * panel.rapid; }
  double spindle(double programmed) const { return programmed * panel.spindle * data_table.spindle; }
};

}  // namespace smartmill::sim
