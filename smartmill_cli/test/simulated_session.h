#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>

#include "smartmill_core/campaign/record.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_recording/recording_writer.h"

namespace smartmill {

/// Cuts of the simulated mill, recorded without ROS on the topics and in the messages of the graph: force
/// sensor in blocks of 10 ms, spindle angle, controller state, load meter and cutting condition.
class SimulatedSession {
 public:
  static constexpr double RATE = 10000.0;  ///< [Hz] of the force sensor

  /// @param path ends in .bag or .mcap @param truth simulates the cuts @param begin [s] of the clock
  SimulatedSession(const std::string& path, const MachineModel& truth, double begin = 1000.0);

  /// A slot of a second. @param rpm spindle speed @param feed [m] per tooth @param depth [m]
  void slot(const std::string& name, double rpm, double feed, double depth);
  /// The spindle turning in air for a second.
  void air(const std::string& name, double rpm);
  /// The model's FRFs and modes of the tool tip along x and y as measured, its coefficients as identified.
  void results();
  void close();

  /// What a test's force sensor showed, rounded to six digits as it was recorded.
  const Record& record(const std::string& name) const { return records_.at(name); }
  /// [s] between the first samples of the session and of a test
  double offset(const std::string& name) const { return offsets_.at(name); }

 private:
  void run(const CampaignTest& test);
  void force(const Record& record, std::size_t first);
  template <class Data>
  void write(const std::string& topic, const Data& data) {
    writer_->write(topic, static_cast<std::uint64_t>(1e6 * now() + 0.5) * 1000, data);
  }
  double now() const { return begin_ + STEP * static_cast<double>(steps_); }

  static constexpr double STEP = 0.01;  // [s]
  std::unique_ptr<RecordingWriter> writer_;
  MachineModel truth_;
  double begin_, first_ = 0.0;  // [s] the first samples' stamp
  std::uint64_t steps_ = 0, samples_ = 0;
  std::map<std::string, Record> records_;
  std::map<std::string, double> offsets_;
};

}  // namespace smartmill
