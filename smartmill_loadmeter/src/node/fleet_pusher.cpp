#include "node/fleet_pusher.h"

#include <chrono>
#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_loadmeter/database/fleet.h"

namespace smartmill::loadmeter {

FleetPusher::FleetPusher(std::string file, std::string url, double period)
    : file_(std::move(file)), url_(std::move(url)), period_(period), thread_([this] { work(); }) {
}

FleetPusher::~FleetPusher() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stop_ = true;
  }
  wake_.notify_all();
  thread_.join();
}

FleetPusher::State FleetPusher::state() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return state_;
}

void FleetPusher::work() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (!stop_) {
    lock.unlock();
    pushOnce();
    lock.lock();
    wake_.wait_for(lock, std::chrono::duration<double>(period_), [this] { return stop_; });
  }
}

// Push times change with every update, the overview only with new records.
void FleetPusher::updateOverview(State& next) {
  CoefficientDatabase shop(file_ + ".fleet");
  const std::vector<FleetMember> members = fleetMembers(url_);
  if (CoefficientDatabase(url_).size() != shop.size()) {
    pull(shop, url_);
  } else if (next.overview) {
    auto same = std::make_shared<FleetOverview>(*next.overview);
    if (updateMembers(members, *same)) {
      next.overview = same;
      return;
    }
  }
  next.overview =
      std::make_shared<FleetOverview>(fleetOverview(members, shop.records("", ""), loginOf(url_)));
}

void FleetPusher::pushOnce() {
  State next;
  next.tries = state_.tries + 1;
  next.overview = state_.overview;
  try {
    CoefficientDatabase local(file_);
    try {
      const FleetTransfer done = push(local, url_);
      next.message = std::to_string(done.fresh) + " new of " + std::to_string(done.offered) + " sent to " +
                     withoutPassword(url_);
      updateOverview(next);
    } catch (const Error& error) {
      next.failing = true;
      next.message = error.what();
    }
    next.behind = local.synchronisation().behind();
  } catch (const Error& error) {
    next.failing = true;
    next.message = error.what();
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  state_ = next;
}

}  // namespace smartmill::loadmeter
