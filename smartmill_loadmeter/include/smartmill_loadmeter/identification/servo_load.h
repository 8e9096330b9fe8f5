#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_loadmeter/identification/campaign_identification.h"

namespace smartmill::loadmeter {

/// Cut or air cut in a record of Servo Guide: one execution of an NC block (Dunwoody, section 6.1).
struct ServoTest {
  int block = 0;  ///< N word of the NC block at whose start the cut begins
  /// [s] since the start of the block, from which the tool is fully engaged and the load meter has settled;
  /// 0: the cut begins with the block, and the response of the load meter is fitted.
  double begin = 0.0;
  double end = 0.0;  ///< [s] since the start of the block; 0: until the end of the block
  CampaignTest test;
};

/// Conditions of the cuts of a record, smartmill-servo-cuts/1 (docs/formats.md). Executions of one block are
/// listed in the order of time. @throws Error with file, key and value.
std::vector<ServoTest> readServoTests(const std::string& file);

/// Spindle load of a record of Servo Guide (daq/servo: channels spindle_load, sequence).
class ServoLoad {
 public:
  /// Appends a block. @throws Error without the channels, or when the rate changes.
  void add(const SampleBlock& block);

  /// Records of the tests. @param full_scale [V] of the load meter. @param where source, for messages
  /// @throws Error naming the test: executions of a block that differ in number from the tests, lost samples,
  /// a value that is not a finite number, or less than SHORTEST.
  std::vector<TestRecord> records(const std::vector<ServoTest>& tests, double full_scale,
                                  const std::string& where) const;

  static constexpr double SHORTEST = 1.0;  ///< [s] of a cut (Dunwoody, section 6.1)

 private:
  /// One execution of an NC block.
  struct Execution {
    int block = 0;
    std::size_t first = 0, count = 0;  // samples
    bool gap = false;                  // lost samples
  };
  std::vector<Execution> executionsOf(int block) const;

  double rate_ = 0.0;  // [Hz]
  std::uint64_t next_ = 0;
  std::vector<double> load_;  // [1] of full scale
  std::vector<double> time_;  // [s]
  std::vector<Execution> executions_;
};

}  // namespace smartmill::loadmeter
