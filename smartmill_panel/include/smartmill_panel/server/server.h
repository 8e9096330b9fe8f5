#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace smartmill::panel {

/// A topic as clients see it; messages are its ROS 1 bytes, untouched.
struct Channel {
  std::uint32_t id = 0;
  std::string topic;
  std::string type;        ///< smartmill_msgs/CncState
  std::string definition;  ///< of the message with all that it contains
};

/// What a page asks beside its files: GET (questions) and POST (commands) below /api/.
struct Question {
  std::string path;                          ///< without /api/
  std::map<std::string, std::string> query;  ///< decoded
  bool post = false;
  std::string body, token, from;  ///< token: header X-SmartMill-Token; from: address of the client
};
struct Answer {
  int status = 200;
  std::string body;  ///< JSON
};

struct ServerOptions {
  std::string address = "127.0.0.1";
  int port = 0;                      ///< 0: any free one
  std::string folder;                ///< of the page; nothing outside of it is served
  std::vector<std::string> origins;  ///< other sites that may connect, e.g. http://localhost:8080
  std::vector<std::string> names;    ///< names of this computer under which browsers may ask
  std::vector<std::string> others;   ///< other panels (http://host:port) that the page may look at
  std::string name = "SmartMill";
  std::size_t queue = 4u << 20;  ///< [bytes] that wait for a client before messages to it are dropped
  std::size_t most_clients = 64;
};

struct ServerStatistics {
  std::size_t clients = 0;
  std::uint64_t sent = 0, dropped = 0;  ///< messages
  std::uint64_t bytes = 0;              ///< of the messages sent
  std::uint64_t refused = 0;            ///< requests of hostile origins, wrong paths and the like
};

/// Page and WebSocket on one port, for browsers and for desktops that speak the Foxglove WebSocket protocol
/// (foxglove.websocket.v1, foxglove.sdk.v1). Clients can subscribe and nothing else. It runs in a thread of
/// its own; every function may be called from any thread.
class Server {
 public:
  using Respond = std::function<void(Answer)>;
  struct Handlers {
    /// Somebody wants a channel now, or nobody any more. Called in the server's thread.
    std::function<void(std::uint32_t channel, bool wanted)> wanted;
    /// Called in the server's thread; respond may be called later and from any thread, while the server
    /// lives.
    std::function<void(Question, Respond)> ask;
  };

  /// @throws Error when the address cannot be listened at or the folder is not there.
  Server(ServerOptions options, Handlers handlers);
  ~Server();

  int port() const;
  void advertise(const Channel& channel);
  /// @param stamp [ns] @param kept the message stays, one for each key, for who subscribes later
  void publish(std::uint32_t channel, std::uint64_t stamp, std::string data, bool kept = false,
               const std::string& key = {});
  /// The clock, a sign of life for the page. @param now [ns]
  void tell(std::uint64_t now);
  ServerStatistics statistics() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

/// Whether a browser's page from origin may talk to a server that it asked for as host. Without an origin
/// (desktops, rosrun) and from the page's own host: yes; a host must be loopback, a plain address (which no
/// name server can turn to here) or one of names.
bool originAllowed(const std::string& origin, const std::string& host, const ServerOptions& options);

/// The file of a request's target below a folder; empty when there is none to serve: types that are no
/// page's, hidden files, whatever leads out of the folder (links too).
std::string fileOf(const std::string& folder, const std::string& target);

/// name=value&... of a target, percent signs decoded.
std::map<std::string, std::string> queryOf(const std::string& target);

}  // namespace smartmill::panel
