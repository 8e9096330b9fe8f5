#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <ros/node_handle.h>

#include "smartmill_core/modal/results.h"
#include "smartmill_core/signal/streams.h"

namespace smartmill {

/// Action server of FRF measurements: one goal at a time, started in stamp order with the streams. Results
/// are also published on tool/frf and tool/modes, latched for every direction. Used in the thread of the
/// callbacks only.
class FrfServer {
 public:
  struct Handlers {
    /// Receives a goal. `begin` is to be called at the goal's turn, with whether no measurement runs; it
    /// returns true if the goal is to be measured.
    std::function<void(const MeasureFrfGoal& goal, std::function<bool(bool free)> begin)> goal;
    /// Receives a cancel request. At its turn the running measurement is to end if `still_active` returns
    /// true.
    std::function<void(std::function<bool()> still_active)> cancel;
  };
  struct Result {
    FrfCode code = FrfCode::ok;
    std::string message;
    MeasuredFrf frf;
    MeasuredModes modes;
    MeasuredFrf cross;                      ///< response perpendicular to the hit; empty: none
    double sensitivity = NOT_A_NUMBER;      ///< [m/V] of the capacitive sensor; NaN: none
    double sensitivity_std = NOT_A_NUMBER;  ///< [m/V]
    double flute_sure = NOT_A_NUMBER;       ///< [1]
    int spindle_moves = 0;                  ///< [1]
  };

  /// @param action name, relative @param node name in the log
  FrfServer(ros::NodeHandle nh, const std::string& action, const std::string& node, Handlers handlers);
  ~FrfServer();

  void feedback(const std::string& stage, double progress, int hits_done);
  void finish(const Result& result);
  /// After a jump back in time: discards results and goals.
  void restart();
  /// Rejects goals that wait for a dead stream. @param timeout [s] of wall time since their reception
  void refuseWaiting(const std::string& reason, double timeout);

  const std::string& lastMessage() const;  ///< of the last result
  /// Modes that this node measured, also before its last restart.
  std::vector<MeasuredModes> modes() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace smartmill
