#pragma once

#include <array>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/error.h"
#include "smartmill_daq/calibration/sensitivity.h"
#include "smartmill_daq/setup/trial.h"

namespace smartmill::daq {

/// The device is not there or sends too little.
class NoSamples : public Error {
 public:
  using Error::Error;
};

/// A file exists or cannot be written.
class NotWritten : public Error {
 public:
  using Error::Error;
};

/// The record does not show the known quantity.
class UnsuitableRecord : public Error {
 public:
  using Error::Error;
};

/// A known quantity and the channel that is to show it.
struct CalibrationRequest {
  enum class Method { exciter, empty, mass, hits };
  std::string file, topic, channel;
  Method method = Method::exciter;
  double seconds = 5.0;                  ///< [s] of the record
  double exciter = 0.0;                  ///< [unit] effective value
  double frequency = EXCITER_FREQUENCY;  ///< [Hz]
  double mass = 0.0;                     ///< [kg]
  bool against = false;                  ///< the mass acts against the direction of the channel
  double gravity = STANDARD_GRAVITY;     ///< [m/s2]
  std::string accelerometer;             ///< TOPIC/CHANNEL of the same instrument
  double reference_std = 0.0;            ///< [1] relative, of the known quantity
};

/// First connection of instruments and their calibration: descriptions are tried on their devices and stored
/// in one folder. Reads devices only.
class InstrumentSetup {
 public:
  /// @param folder of the instrument files @param now [s] the computer's clock
  InstrumentSetup(std::string folder, std::function<double()> now);

  /// Names of the instruments in the folder, without .yaml.
  std::vector<std::string> files() const;

  /// Checks a description and reads its device. @param seconds [s] of samples; 0: the device is not opened
  /// @throws Error "instrument: key: what" on a wrong description
  Trial check(const std::string& description, double seconds) const;
  /// Stores a description. @param name letters, digits, - and _ @param replace an existing file of that name
  /// @return path of the file @throws NotWritten; Error as check()
  std::string store(const std::string& description, const std::string& name, bool replace) const;

  /// Takes a record of the channel. @return no value after a record without the mass
  /// @throws Error on a wrong request; NoSamples; UnsuitableRecord
  std::optional<NewSensitivity> calibrate(const CalibrationRequest& request);
  /// Stores the last result of a channel in its file. @param date YYYY-MM-DD @throws Error without a result
  NewSensitivity storeResult(const std::string& file, const std::string& topic, const std::string& channel,
                             const std::string& date);

 private:
  using Key = std::array<std::string, 3>;  // file, topic, channel

  std::string pathOf(const std::string& name) const;
  Trial tryText(const std::string& description, double seconds) const;

  std::string folder_;
  std::function<double()> now_;
  std::map<Key, std::vector<double>> empty_;  // [unit] records without the mass
  std::map<Key, NewSensitivity> results_;
};

}  // namespace smartmill::daq
