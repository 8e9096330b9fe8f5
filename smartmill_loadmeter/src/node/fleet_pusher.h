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

/// Pushes a machine's file to the fleet's server every now and then, in a thread of its own: the node never
/// waits for the network, and what the server has not got stays in the file. Then it looks at what the fleet
/// knows: records of the others come into a file of their own (FILE.fleet), so that each comes once, and the
/// machine's own file stays its own.
class FleetPusher {
 public:
  struct State {
    std::size_t behind = 0;  ///< records that the server has not acknowledged
    bool failing = false;    ///< the last try did
    std::string message = "no push yet";
    std::uint64_t tries = 0;
    std::shared_ptr<const FleetOverview> overview;  ///< of the last look that was one; empty: none yet
  };

  /// @param period [s] between tries
  FleetPusher(std::string file, std::string url, double period);
  ~FleetPusher();
  FleetPusher(const FleetPusher&) = delete;
  FleetPusher& operator=(const FleetPusher&) = delete;

  State state() const;

 private:
  void work();
  void pushOnce();
  void look(State& next);

  const std::string file_, url_;
  const double period_;
  mutable std::mutex mutex_;
  std::condition_variable wake_;
  bool end_ = false;
  State state_;
  std::thread thread_;
};

}  // namespace smartmill::loadmeter
