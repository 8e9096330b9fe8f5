#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_exchange/items/asset.h"
#include "smartmill_exchange/items/observation.h"
#include "smartmill_exchange/mtconnect/agent_request.h"
#include "smartmill_exchange/mtconnect/observation_buffer.h"

namespace smartmill::exchange {

struct AgentOptions {
  std::string device = "SmartMill";  ///< name, an XML name
  std::string uuid = "smartmill";    ///< of the machine, unique in a shop
  std::string manufacturer, model;
  std::string sender = "smartmill";  ///< of the documents
  std::size_t buffer = 131072;       ///< [1] observations
  std::size_t assets = 1024;         ///< [1]
  std::uint64_t instance = 1;        ///< differs after each start, e.g. the time of the start in seconds
};

/// A streaming answer: documents until the client leaves.
struct AgentStream {
  bool sample = true;  ///< false: current
  std::vector<bool> selected;
  std::uint64_t next = 0;   ///< sequence number
  std::size_t count = 100;  ///< [1] of a document
  double interval = 0.0;    ///< [s] between documents
  double heartbeat = 10.0;  ///< [s] after which a document without observations is sent
  double sent = 0.0;        ///< [s] time of the last document
};

struct AgentAnswer {
  int status = 200;
  std::string document;                    ///< XML
  std::optional<AgentStream> stream = {};  ///< the document is its first
};

/// An MTConnect agent (1.8) of one machine: read-only, thread-confined, without sockets.
class Agent {
 public:
  /// @param now [s] since 1970. @throws Error on an option out of its bounds
  Agent(AgentOptions options, double now);

  void observe(const Observation& observation) { buffer_.push(observation); }
  /// The oldest asset is removed when there are too many.
  void store(const Asset& asset);

  /// @param target of an HTTP GET, e.g. /sample?from=1&count=10
  AgentAnswer answer(const std::string& target, double now) const;
  /// The document of an error; `text` is shown to the client.
  AgentAnswer refuse(const AgentError& error, double now) const;

  /// The next document of a stream, empty while none is to be sent. @throws AgentError when the client is
  /// behind the buffer
  std::string next(AgentStream& stream, double now) const;

  const ObservationBuffer& buffer() const { return buffer_; }
  const AgentOptions& options() const { return options_; }

 private:
  AgentAnswer answerOrThrow(const AgentRequest& request, double now) const;
  void requireDevice(const AgentRequest& request) const;
  std::string header(const char* kind, double now, const std::string& more) const;
  std::string probe(double now) const;
  std::string streams(const std::vector<std::vector<const Record*>>& records, std::uint64_t next,
                      double now) const;
  std::string current(const Snapshot& snapshot, const std::vector<bool>& selected, double now) const;
  std::string sample(const std::vector<bool>& selected, std::uint64_t from, long count, double now,
                     std::uint64_t* next) const;
  AgentAnswer assets(const AgentRequest& request, double now) const;

  AgentOptions options_;
  double started_;
  ObservationBuffer buffer_;
  std::deque<Asset> assets_;  // newest first
};

}  // namespace smartmill::exchange
