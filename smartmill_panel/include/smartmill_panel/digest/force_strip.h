#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_core/signal/streams.h"

namespace smartmill::panel {

struct StripParameters {
  double bin = 0.005;
  int bins = 20;

  void declare(ParameterTable& table) {
    table.number("strip_bin", bin, "s", Range::closed(1.0e-4, 1.0), "length of a bin of the scrolling strip");
    table.number("strip_bins", bins, "1", Range::closed(1, 10000), "of a message");
  }
};

/// Least and largest value of each short bin of time: a strip drawn of them hides no peak and invents none,
/// as every nth sample (aliasing) and means (lost peaks) do.
struct ForceStrip {
  double stamp = 0.0;            ///< [s] begin of the first bin
  double bin = 0.0;              ///< [s]
  std::vector<float> low, high;  ///< [N] fx fy fz of the first bin, of the second, ...; NaN: no sample
};

/// Makes strips of blocks in the order of their stamps; time that goes back begins anew.
class StripMaker {
 public:
  using Handler = std::function<void(const ForceStrip&)>;
  /// @throws Error on a parameter out of its bounds.
  StripMaker(const StripParameters& parameters, Handler handler);

  /// Samples that are NaN belong to no bin.
  void push(const ForceBlock& block);
  /// Hands out what has gathered, however little.
  void flush();

 private:
  void begin(std::int64_t bin);
  void open();

  StripParameters parameters_;
  Handler handler_;
  std::int64_t bin_ = 0;  // the open one, counted from the epoch
  std::array<float, 3> low_{}, high_{};
  bool any_ = false;  // a bin is open
  ForceStrip strip_;
};

}  // namespace smartmill::panel
