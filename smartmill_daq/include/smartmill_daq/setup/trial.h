#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "smartmill_daq/acquisition/acquisition.h"
#include "smartmill_daq/drivers/driver.h"
#include "smartmill_daq/instrument/instrument.h"

namespace smartmill::daq {

/// Samples of a channel in a trial.
struct TriedChannel {
  std::string topic;
  Channel channel;
  std::vector<double> samples;   ///< [unit] NaN: no measurement
  double mean = 0.0, rms = 0.0;  ///< [unit] rms about the mean; NaN: nothing measured
  double peak = 0.0;             ///< [1] largest share of the range; 1 where samples were clipped
  std::uint64_t clipped = 0;     ///< [1] samples
  bool faulty = false;           ///< the last sample was no measurement
};

/// A device that was opened and read for a while.
struct Trial {
  std::string problem;  ///< one line why too few samples came; empty: as many as requested
  std::vector<TriedChannel> channels;
  ClockState clock;
  std::vector<std::string> faults;  ///< one line each
};

/// Opens a device and reads it, at most two seconds longer than the samples take.
/// @param seconds [s] of samples @param now [s] the computer's clock @throws Error on what no waiting repairs
Trial tryInstrument(const Instrument& instrument, std::unique_ptr<Driver> driver, double seconds,
                    const std::function<double()>& now);

}  // namespace smartmill::daq
