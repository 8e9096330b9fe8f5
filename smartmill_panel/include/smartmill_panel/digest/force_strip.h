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
    table.number("strip_bin", bin, "s", Range::closed(1.0e-4, 1.0), "length of a bin of the strip chart");
    table.number("strip_bins", bins, "1", Range::closed(1, 10000), "bins of a message");
  }
};

/// Minimum and maximum of each short time bin: a strip chart without aliasing (as with every nth sample) and
/// without lost peaks (as with means).
struct ForceStrip {
  double stamp = 0.0;            ///< [s] start of the first bin
  double bin = 0.0;              ///< [s]
  std::vector<float> low, high;  ///< [N] fx, fy, fz of the first bin, of the second, ...; NaN: no sample
};

/// Computes strips from blocks in the order of their stamps; a backward jump of time starts a new strip.
class StripMaker {
 public:
  using Handler = std::function<void(const ForceStrip&)>;
  /// @throws Error on a parameter out of its bounds.
  StripMaker(const StripParameters& parameters, Handler handler);

  /// Ignores NaN samples.
  void push(const ForceBlock& block);
  /// Passes on an incomplete strip.
  void flush();

 private:
  void begin(std::int64_t bin);
  void open();

  StripParameters parameters_;
  Handler handler_;
  std::int64_t bin_ = 0;  // index of the open bin since the epoch
  std::array<float, 3> low_{}, high_{};
  bool any_ = false;  // a bin is open
  ForceStrip strip_;
};

}  // namespace smartmill::panel
