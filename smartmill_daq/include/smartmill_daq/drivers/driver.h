#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/error.h"
#include "smartmill_core/model/strict_yaml.h"
#include "smartmill_daq/instrument/instrument.h"

namespace smartmill::daq {

/// What a device has delivered at one time.
struct RawBatch {
  double arrival = 0.0;                      ///< [s] computer's clock when the last sample was there
  std::optional<std::uint64_t> first_index;  ///< the device's own count of the first sample
  std::optional<double> time;                ///< [s] of the first sample by the device's clock
  std::optional<double> sample_rate;         ///< [Hz] that the device states
  std::uint64_t lost = 0;      ///< [1] samples that are missing by the count of the driver before this batch
  bool interrupted = false;    ///< an unknown number is missing before this batch
  std::vector<double> values;  ///< [V] or, of Driver::shareOfRange(), [1]; inputs interleaved
  std::uint64_t overloaded = 0, bias_fault = 0;  ///< one bit per input: reported by the device
};

/// The device is gone: unplugged, connection closed. It is opened again later.
class DeviceLost : public Error {
 public:
  using Error::Error;
};

/// the device sends unreadable bytes; it is opened again as when it was lost.
class MalformedData : public DeviceLost {
 public:
  using DeviceLost::DeviceLost;
};

/// A kind of device. Not shared between threads.
class Driver {
 public:
  Driver() = default;
  Driver(const Driver&) = delete;
  Driver& operator=(const Driver&) = delete;
  virtual ~Driver() = default;

  /// @throws DeviceLost when it is not there (yet); Error when it can never work as described.
  virtual void open() = 0;
  /// @param timeout [s] @return false: nothing came in that time.
  /// @throws DeviceLost; Error on what no waiting repairs.
  virtual bool read(RawBatch* batch, double timeout) = 0;
  /// May be called at any time, twice too.
  virtual void close() = 0;
  /// Whether values are shares of the input's range, not volts.
  virtual bool shareOfRange() const { return false; }
  /// Whether the device has come to its end; no batch follows.
  virtual bool ended() const { return false; }
};

/// What a driver is made of.
struct DriverSetup {
  const Instrument& instrument;
  std::vector<Channel> channels;             ///< whose inputs a sample has, in this order
  const std::optional<StrictYaml>& options;  ///< the driver's own; finish() is called by makeDriver()
};

/// A key of a driver's options, for those who describe an instrument.
struct DriverOption {
  std::string key, meaning;
};

/// A driver is one file, src/drivers/NAME_driver.cpp, which defines `DriverKind NAMEDriver()`.
struct DriverKind {
  std::string name;
  /// Reads the options. @throws Error "FILE: options.key: what". Empty: not built.
  std::function<std::unique_ptr<Driver>(const DriverSetup&)> make;
  std::vector<DriverOption> options;
};

/// All drivers, those that were not built too, by name.
const std::vector<DriverKind>& driverKinds();

/// @throws Error in one line: unknown driver, driver not built, option wrong or unknown.
std::unique_ptr<Driver> makeDriver(const std::string& file, const Instrument& instrument,
                                   const std::optional<StrictYaml>& options);

/// Numbers of the inputs from 0. @throws Error unless all are integers from 1 to most.
std::vector<std::size_t> inputNumbers(const std::vector<Channel>& channels, std::size_t most);

}  // namespace smartmill::daq
