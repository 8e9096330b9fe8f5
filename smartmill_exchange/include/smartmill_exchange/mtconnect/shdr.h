#pragma once

#include <map>
#include <string>
#include <vector>

#include "smartmill_exchange/items/asset.h"
#include "smartmill_exchange/items/observation.h"

namespace smartmill::exchange {

/// Lines of an SHDR adapter (MTConnect's reference agent reads them): TIME|ITEM|VALUE for samples and events,
/// TIME|ITEM|LEVEL|CODE|SEVERITY|QUALIFIER|TEXT for conditions, TIME|ITEM|KEY=VALUE ... for data sets, and
/// TIME|@ASSET@|ID|TYPE|--multiline--TAG with an XML document. Values never contain a line break or a bar.
class ShdrWriter {
 public:
  /// @param device_uuid of the assets
  explicit ShdrWriter(std::string device_uuid);

  /// Lines for clients that are connected.
  std::string observe(const Observation& observation);
  std::string store(const Asset& asset);

  /// Lines for a client that connects: every item with its last value, every asset.
  std::string greeting(double now) const;

 private:
  std::string lines(const Observation& observation, const Value& before) const;

  std::string uuid_;
  std::vector<Observation> last_;        // by item
  std::map<std::string, Asset> assets_;  // by id
};

/// What a client of an adapter sends: lines of which only `* PING` has a meaning.
class ShdrCommands {
 public:
  /// @return number of complete `* PING` lines among the bytes so far, since the last call. A line beyond
  /// LONGEST is dropped.
  int push(const char* data, std::size_t size);

  static constexpr std::size_t LONGEST = 1024;  ///< [byte]

 private:
  std::string line_;
  bool too_long_ = false;
};

}  // namespace smartmill::exchange
