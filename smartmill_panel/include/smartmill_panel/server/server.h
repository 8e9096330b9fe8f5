#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace smartmill::panel {

/// A topic as advertised to clients; messages are unmodified ROS 1 bytes.
struct Channel {
  std::uint32_t id = 0;
  std::string topic;
  std::string type;        ///< for example smartmill_msgs/CncState
  std::string definition;  ///< message definition including all nested types
};

/// A request of the page below /api/: GET (queries) and POST (commands).
struct ApiRequest {
  std::string path;                          ///< without /api/
  std::map<std::string, std::string> query;  ///< decoded
  bool post = false;
  std::string body, token, from;  ///< token: header X-SmartMill-Token; from: address of the client
};
struct ApiResponse {
  int status = 200;
  std::string body;  ///< JSON
};

struct ServerOptions {
  std::string address = "127.0.0.1";
  int port = 0;                      ///< 0: any free one
  std::string folder;                ///< of the page; no file outside is served
  std::vector<std::string> origins;  ///< other permitted origins, for example http://localhost:8080
  std::vector<std::string> names;    ///< permitted host names of this computer
  std::vector<std::string> others;   ///< other panels (http://host:port) to which the page may connect
  std::string name = "SmartMill";
  std::size_t queue = 4u << 20;  ///< [bytes] queued for a client before its messages are dropped
  std::size_t most_clients = 64;
};

struct ServerStatistics {
  std::size_t clients = 0;
  std::uint64_t sent = 0, dropped = 0;  ///< messages
  std::uint64_t bytes = 0;              ///< of the messages sent
  std::uint64_t refused = 0;            ///< requests with a forbidden origin, path or method
};

/// HTTP and WebSocket server on one port, for browsers and for programs with the Foxglove WebSocket protocol
/// (foxglove.websocket.v1, foxglove.sdk.v1). WebSocket clients can only subscribe. Runs in a thread of its
/// own; all functions are thread-safe.
class Server {
 public:
  using Respond = std::function<void(ApiResponse)>;
  struct Handlers {
    /// The first client has subscribed to a channel, or the last one has left. Called in the server's thread.
    std::function<void(std::uint32_t channel, bool wanted)> wanted;
    /// Called in the server's thread; respond may be called later and from any thread while the server
    /// exists.
    std::function<void(ApiRequest, Respond)> request;
  };

  /// @throws Error if the server cannot listen at the address or the folder does not exist.
  Server(ServerOptions options, Handlers handlers);
  ~Server();

  int port() const;
  void advertise(const Channel& channel);
  /// @param stamp [ns] @param latched stores the message, one per key, for later subscribers
  void publish(std::uint32_t channel, std::uint64_t stamp, std::string data, bool latched = false,
               const std::string& key = {});
  /// Sends the time, which the page uses as a heartbeat. @param now [ns]
  void sendTime(std::uint64_t now);
  ServerStatistics statistics() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

/// Whether a page from origin may connect to the server under a host name. Permitted without an origin
/// (desktop programs, rosrun) and from the page's own host; the host must be loopback, an IP address (safe
/// against DNS rebinding) or one of names.
bool originAllowed(const std::string& origin, const std::string& host, const ServerOptions& options);

/// File of a request target below a folder; empty if not served: other file types, hidden files, paths and
/// links that leave the folder.
std::string fileOf(const std::string& folder, const std::string& target);

/// Query of a target (name=value&...), percent-decoded.
std::map<std::string, std::string> queryOf(const std::string& target);

}  // namespace smartmill::panel
