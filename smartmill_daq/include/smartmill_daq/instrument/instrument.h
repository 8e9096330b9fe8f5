#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/model/strict_yaml.h"

namespace smartmill::daq {

enum class Coupling {
  dc,
  ac,
  iepe  ///< supplied sensor: a bias voltage shows whether the cable is whole
};

/// One measured quantity: value = (volts - offset) / sensitivity.
struct Channel {
  std::string input;                      ///< on the device: a number from 1, or the device's name of it
  std::string name;                       ///< in the block, e.g. fx
  std::string unit;                       ///< SI, e.g. N
  double sensitivity = 1.0;               ///< [V/unit], not 0; its sign turns the direction
  std::optional<double> sensitivity_std;  ///< [V/unit] standard deviation
  std::optional<std::string> sensitivity_date;  ///< of the calibration, YYYY-MM-DD
  double offset = 0.0;                          ///< [V] at zero of the quantity
  double range = 10.0;                          ///< [V] full scale of the input, both signs
  Coupling coupling = Coupling::dc;
  double stuck = 0.0;  ///< [s] of equal values after which the channel counts as stuck; 0: never
};

/// A topic and its channels.
struct Stream {
  std::string topic;  ///< relative to /smartmill, e.g. daq/dynamometer
  std::string frame;  ///< tf2 frame of the sensor; empty: none
  std::vector<Channel> channels;
};

enum class ClockSource {
  counted,  ///< samples are counted; offset and drift against the computer's clock are estimated
  device    ///< the device stamps its samples by a clock that is synchronous with the computer's (PTP)
};

/// A device with its channels (smartmill-instrument/1).
struct Instrument {
  std::string name;
  std::string driver;
  double sample_rate = 0.0;  ///< [Hz]
  double block = 0.005;      ///< [s] length of a block
  ClockSource clock = ClockSource::counted;
  double latency = 0.0;          ///< [s] shortest time from a sample to its arrival
  double latency_std = 0.0;      ///< [s] standard deviation of that value
  double silence = 0.15;         ///< [s] without a sample after which the device counts as silent
  double rate_tolerance = 1e-3;  ///< [1] larger relative deviations of the rate are a fault
  std::vector<Stream> streams;

  /// Of all streams, in the order of a raw sample.
  std::vector<Channel> channels() const;
};

/// Reads the file up to the options of its driver.
/// @param options receives the map `options`, which the driver has to read and finish; empty without one.
/// @throws Error "FILE: key: what".
Instrument readInstrument(const std::string& file, std::optional<StrictYaml>* options);

/// One channel of the file by topic and name. @throws Error "FILE: what"
Channel readChannel(const std::string& file, const std::string& topic, const std::string& name);

}  // namespace smartmill::daq
