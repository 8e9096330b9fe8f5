#include "node/node.h"

#include <exception>
#include <optional>
#include <utility>

#include <ros/ros.h>
#include <smartmill_msgs/SampleBlock.h>

#include "smartmill_core/formatted.h"
#include "smartmill_daq/acquisition/state_text.h"
#include "smartmill_ros/conversions.h"
#include "smartmill_ros/node_main.h"
#include "smartmill_ros/parameter_server.h"
#include "smartmill_ros/run_node.h"

namespace smartmill::daq {
namespace {

using Level = diagnostic_msgs::DiagnosticStatus;
constexpr double INPUT_TIMEOUT = 1.0;  // [s] of a shell that has no inputs
constexpr double PPM = 1e-6;

std::uint64_t eventsOf(const FaultLog& faults) {
  std::uint64_t events = 0;
  for (std::size_t kind = 0; kind < FAULT_KINDS; ++kind)
    events += faults.count(static_cast<FaultKind>(kind)).events;
  return events;
}

}  // namespace

DaqNode::DaqNode(ros::NodeHandle nh, const ros::NodeHandle& private_nh)
    : parameters_(parametersFromServer(private_nh).readAll<DaqNodeParameters>()),
      shell_(nh, private_nh, "daq", INPUT_TIMEOUT) {
  std::optional<StrictYaml> options;
  Instrument instrument = readInstrument(parameters_.instrument, &options);
  for (const Stream& stream : instrument.streams)
    publishers_[stream.topic] = nh.advertise<smartmill_msgs::SampleBlock>(stream.topic, STREAM_QUEUE);
  Acquisition::Outputs outputs;
  outputs.block = [this](const Stream& stream, const SampleBlock& block) {
    publishers_.at(stream.topic).publish(toMsg(block, stream.frame));
  };
  outputs.fault = [this](const Fault& fault) {
    ROS_WARN("%s: %s at sample %llu: %s", parameters_.instrument.c_str(), faultName(fault.kind),
             static_cast<unsigned long long>(fault.index), fault.text.c_str());
  };
  std::unique_ptr<Driver> driver = makeDriver(parameters_.instrument, instrument, options);
  acquisition_ = std::make_unique<Acquisition>(std::move(instrument), std::move(driver), outputs,
                                               [] { return toSec(ros::Time::now()); });
  shell_.diagnose("instrument " + acquisition_->instrument().name,
                  [this](auto& status) { diagnose(status); });
  std::size_t c = 0;
  for (const Stream& stream : acquisition_->instrument().streams) {
    for (const Channel& channel : stream.channels) {
      shell_.diagnose("channel " + stream.topic + "/" + channel.name,
                      [this, c](auto& status) { diagnoseChannel(c, status); });
      ++c;
    }
  }
  thread_ = std::thread([this] { run(); });
}

DaqNode::~DaqNode() {
  stopping_ = true;
  thread_.join();
}

void DaqNode::run() {
  try {
    // Stamps before the first message of a simulated clock would be 0.
    while (!stopping_ && !ros::Time::isValid()) ros::WallDuration(0.01).sleep();
    while (!stopping_ && acquisition_->step()) {
    }
    if (!stopping_) ROS_INFO("%s: the device has come to its end", parameters_.instrument.c_str());
  } catch (const std::exception& error) {
    ROS_FATAL("%s: %s", parameters_.instrument.c_str(), error.what());
    ros::requestShutdown();
  }
}

void DaqNode::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const InstrumentState state = acquisition_->state();
  const std::uint64_t events = eventsOf(state.faults);
  const std::uint64_t new_events = events - std::exchange(events_, events);
  if (!isWell(state)) {
    status.summary(state.ended ? Level::STALE : Level::ERROR, summaryOf(state));
  } else if (new_events > 0) {
    status.summary(Level::WARN, state.faults.last().text);
  } else {
    status.summary(Level::OK, summaryOf(state));
  }
  const SampleAccount& account = state.account;
  status.add("driver", acquisition_->instrument().driver);
  status.add("sample rate [Hz]", acquisition_->instrument().sample_rate);
  status.add("latency [s]", acquisition_->instrument().latency);
  status.add("standard deviation of the latency [s]", acquisition_->instrument().latency_std);
  status.add("samples in blocks", account.delivered);
  status.add("blocks", account.blocks);
  status.add("samples lost", account.lost);
  status.add("samples lost by the clock", account.estimated_lost);
  status.add("samples withheld", account.withheld);
  status.add("clock offset [s]", state.clock.offset);
  status.add("standard deviation of the offset [s]", state.clock.offset_std);
  status.add("clock drift [ppm]", state.clock.drift / PPM);
  status.add("standard deviation of the drift [ppm]", state.clock.drift_std / PPM);
  status.add("jitter of the arrivals [s]", state.clock.jitter);
  for (std::size_t kind = 0; kind < FAULT_KINDS; ++kind) {
    const auto fault = static_cast<FaultKind>(kind);
    status.add(std::string(faultName(fault)) + " events", state.faults.count(fault).events);
    status.add(std::string(faultName(fault)) + " samples", state.faults.count(fault).samples);
  }
  status.add("last fault", state.faults.last().text);
}

void DaqNode::diagnoseChannel(std::size_t channel, diagnostic_updater::DiagnosticStatusWrapper& status) {
  const InstrumentState state = acquisition_->state();
  const Channel described = acquisition_->instrument().channels()[channel];
  const ChannelLevel& level = state.levels[channel];
  if (!isWell(state)) {
    status.summary(Level::STALE, summaryOf(state));
  } else if (level.faulty) {
    status.summary(Level::ERROR, "no measurement: clipped, stuck or without supply");
  } else {
    status.summary(Level::OK, "alive");
  }
  status.add("unit", described.unit);
  status.add("mean [" + described.unit + "]", level.mean);
  status.add("rms [" + described.unit + "]", level.rms);
  status.add("peak [share of the range]", level.peak);
  status.add("samples clipped", level.clipped);
  status.add("samples stuck", level.stuck);
  status.add("samples without IEPE supply", level.bias);
  status.add("samples not finite", level.not_finite);
  status.add("sensitivity [V/" + described.unit + "]", described.sensitivity);
  status.add("standard deviation of the sensitivity",
             described.sensitivity_std ? formatted("%.4g", *described.sensitivity_std) : "not stated");
  status.add("date of the sensitivity", described.sensitivity_date.value_or("not stated"));
}

}  // namespace smartmill::daq

int smartmill::nodeMain(int argc, char** argv) {
  return runNode<daq::DaqNode>(argc, argv, "daq");
}
