#pragma once

#include <cstddef>
#include <deque>
#include <functional>
#include <string>

namespace smartmill::loadmeter {

/// Records that the database has refused (full disk, lost server): kept in order until it takes them.
class WaitingRecords {
 public:
  /// Adds a record to the database. @throws Error when the database refuses it
  using Store = std::function<void()>;

  /// @param most [1] number of records kept; the oldest of more are lost
  explicit WaitingRecords(std::size_t most = 10000) : most_(most) {}

  /// Stores a record behind those that wait, or keeps it. @return whether it is stored
  bool add(Store store);
  /// Stores those that wait, in order, until one is refused. @return how many were stored
  std::size_t retry();

  std::size_t size() const { return waiting_.size(); }
  std::size_t lost() const { return lost_; }
  /// Why the oldest one waits; empty: none waits
  const std::string& problem() const { return problem_; }

 private:
  std::size_t most_;
  std::deque<Store> waiting_;
  std::size_t lost_ = 0;
  std::string problem_;
};

}  // namespace smartmill::loadmeter
