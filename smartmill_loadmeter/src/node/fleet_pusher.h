#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "node/fleet_overview.h"

namespace smartmill::loadmeter {

/// Pushes a machine's file to the fleet's server periodically in its own thread, so that the node does not
/// wait for the network; unacknowledged records remain in the file. After each push it fetches the shop's
/// records into a separate file (FILE.fleet) and updates the overview.
class FleetPusher {
 public:
  struct State {
    std::size_t behind = 0;  ///< records that the server has not acknowledged
    bool failing = false;    ///< the last push failed
    std::string message = "no push yet";
    std::uint64_t tries = 0;
    std::shared_ptr<const FleetOverview> overview;  ///< of the last successful update; empty: none
  };

  /// @param period [s] between pushes
  FleetPusher(std::string file, std::string url, double period);
  ~FleetPusher();
  FleetPusher(const FleetPusher&) = delete;
  FleetPusher& operator=(const FleetPusher&) = delete;

  State state() const;

 private:
  void work();
  void pushOnce();
  void updateOverview(State& next);

  const std::string file_, url_;
  const double period_;
  mutable std::mutex mutex_;
  std::condition_variable wake_;
  bool stop_ = false;
  State state_;
  std::thread thread_;
};

}  // namespace smartmill::loadmeter
