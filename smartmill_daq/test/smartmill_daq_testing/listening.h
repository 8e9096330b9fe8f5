#pragma once

#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/io/text_file.h"
#include "smartmill_daq/acquisition/acquisition.h"

namespace smartmill::daq::testing {

/// An instrument of a file at work in real time, and what it gives.
class Listening {
 public:
  Listening(const std::string& file, const std::string& description) {
    writeText(file, description);
    std::optional<StrictYaml> options;
    const Instrument instrument = readInstrument(file, &options);
    Acquisition::Outputs outputs;
    outputs.block = [this](const Stream&, const SampleBlock& block) { blocks.push_back(block); };
    outputs.fault = [this](const Fault& fault) { faults.push_back(fault); };
    acquisition_.emplace(instrument, makeDriver(file, instrument, options), outputs, wallTime);
  }

  /// @return whether done() came true. @param patience [s] for a busy computer
  bool until(const std::function<bool()>& done, double patience = 60.0) {
    const double end = wallTime() + patience;
    while (!done() && wallTime() < end && acquisition_->step()) {
    }
    return done();
  }
  InstrumentState state() const { return acquisition_->state(); }

  static double wallTime() {
    return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
  }

  std::vector<SampleBlock> blocks;
  std::vector<Fault> faults;

 private:
  std::optional<Acquisition> acquisition_;
};

}  // namespace smartmill::daq::testing
