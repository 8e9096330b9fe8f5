#pragma once

#include <array>
#include <atomic>
#include <deque>
#include <map>
#include <memory>
#include <set>
#include <string>

#include <boost/asio.hpp>
#include <boost/beast.hpp>
#include <nlohmann/json.hpp>

#include "smartmill_panel/server/server.h"

namespace smartmill::panel {

using Bytes = std::shared_ptr<const std::string>;

class Client;

/// Channels and their subscribers. Used in the server's thread only, except for the counters.
class Hub {
 public:
  Hub(ServerOptions server_options, Server::Handlers server_handlers)
      : options(std::move(server_options)), handlers(std::move(server_handlers)) {}

  void advertise(const Channel& channel);
  void publish(std::uint32_t id, std::uint64_t stamp, const Bytes& data, bool latched,
               const std::string& key);
  void sendTime(std::uint64_t now);

  /// @return false if there are too many
  bool enter(const std::shared_ptr<Client>& client);
  void leave(const std::shared_ptr<Client>& client);
  /// @return false if the channel does not exist
  bool subscribe(Client& client, std::uint32_t id, std::uint32_t subscription);
  void unsubscribe(std::uint32_t id);
  nlohmann::json advertisement() const;
  void closeAll();

  const ServerOptions options;
  const Server::Handlers handlers;
  std::atomic<std::uint64_t> sent{0}, dropped{0}, bytes{0}, refused{0};
  std::atomic<std::size_t> clients{0};

 private:
  struct Message {
    std::uint64_t stamp = 0;
    Bytes data;
  };
  struct Entry {
    Channel channel;
    std::map<std::string, Message> latched;
    std::size_t listeners = 0;
  };
  std::map<std::uint32_t, Entry> channels_;
  std::set<std::shared_ptr<Client>> clients_;
};

/// One WebSocket client. Its queue is bounded: a client that stops reading loses messages, other clients lose
/// none.
class Client : public std::enable_shared_from_this<Client> {
 public:
  Client(boost::asio::ip::tcp::socket socket, Hub& hub) : stream_(std::move(socket)), hub_(hub) {}

  void start(const boost::beast::http::request<boost::beast::http::string_body>& request);
  void text(const nlohmann::json& json);
  void message(std::uint32_t subscription, std::uint64_t stamp, const Bytes& data);
  void clock(std::uint64_t now);
  void close();

  std::map<std::uint32_t, std::uint32_t> subscriptions;  // by channel

 private:
  struct Frame {
    bool binary;
    std::string head;  // of a binary frame
    Bytes body;
    std::size_t size() const { return head.size() + body->size(); }
  };
  void open();
  void send(Frame frame);
  void write();
  void read();
  void handle(const std::string& text);
  void handleSubscribe(const nlohmann::json& json);
  void handleUnsubscribe(const nlohmann::json& json);
  void status(int level, const std::string& line);
  void end();

  boost::beast::websocket::stream<boost::beast::tcp_stream> stream_;
  Hub& hub_;
  boost::beast::flat_buffer buffer_;
  std::deque<Frame> queue_;
  std::size_t waiting_ = 0;     // [bytes]
  bool drop_reported_ = false;  // since the queue was last empty
  bool closing_ = false;
};

}  // namespace smartmill::panel
