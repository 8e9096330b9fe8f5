#pragma once

#include <functional>
#include <memory>
#include <string>

#include <ros/node_handle.h>

#include "smartmill_core/modal/results.h"
#include "smartmill_core/signal/streams.h"

namespace smartmill {

/// The action of a measurement of FRFs, for the node around the class that measures: one goal at a time, each
/// begun at its turn among the streams; results go out on tool/frf and tool/modes as well, where a late
/// subscriber gets every direction. All in the thread of the callbacks.
class FrfServer {
 public:
  struct Handlers {
    /// A goal has come: to be called at its turn with whether no measurement runs; true: measure it.
    std::function<void(const MeasureFrfGoal& goal, std::function<bool(bool free)> begin)> goal;
    /// A cancel has come: at its turn the running measurement ends when `due` still says so.
    std::function<void(std::function<bool()> due)> cancel;
  };
  struct Result {
    FrfCode code = FrfCode::ok;
    std::string message;
    MeasuredFrf frf;
    MeasuredModes modes;
    MeasuredFrf cross;                      ///< read at right angles to the blow; empty: none
    double sensitivity = NOT_A_NUMBER;      ///< [m/V] of the capacitive sensor, where there is one
    double sensitivity_std = NOT_A_NUMBER;  ///< [m/V]
    double flute_sure = NOT_A_NUMBER;       ///< [1]
    int spindle_moves = 0;                  ///< [1]
  };

  /// @param action name, relative @param node name in the log
  FrfServer(ros::NodeHandle nh, const std::string& action, const std::string& node, Handlers handlers);
  ~FrfServer();

  void feedback(const std::string& stage, double progress, int hits_done);
  void finish(const Result& result);
  /// Time went back: nothing that was measured or asked for is of this run.
  void restart();
  /// Goals that wait for a dead stream would wait for ever. @param patience [s] of wall time since they came
  void refuseWaiting(const std::string& why, double patience);

  const std::string& lastMessage() const;  ///< of the last result

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace smartmill
