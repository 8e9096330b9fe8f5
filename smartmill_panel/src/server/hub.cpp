#include "server/hub.h"

namespace smartmill::panel {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using nlohmann::json;

constexpr const char* PROTOCOLS[] = {"foxglove.sdk.v1", "foxglove.websocket.v1"};
constexpr std::size_t LONGEST_REQUEST = 64u << 10;  // [bytes] of a message of a client
constexpr std::uint8_t MESSAGE = 1, TIME = 2;       // opcodes of binary frames
constexpr int WARNING = 1, FAULT = 2;               // levels of a status

std::string littleEndian(std::uint64_t value, int count) {
  std::string out;
  for (int i = 0; i < count; ++i) out.push_back(static_cast<char>(value >> (8 * i)));
  return out;
}

json advertised(const Channel& c) {
  return {{"id", c.id},           {"topic", c.topic},       {"encoding", "ros1"},
          {"schemaName", c.type}, {"schema", c.definition}, {"schemaEncoding", "ros1msg"}};
}

/// First supported protocol among those that a client offers; empty: none.
std::string chosenOf(const std::string& offered) {
  for (const char* protocol : PROTOCOLS)
    for (const auto& word : http::token_list(offered))
      if (word == protocol) return protocol;
  return {};
}

}  // namespace

// ---------------------------------------------------------------------------------------------- hub

json Hub::advertisement() const {
  json list = json::array();
  for (const auto& [id, entry] : channels_) list.push_back(advertised(entry.channel));
  return {{"op", "advertise"}, {"channels", list}};
}

void Hub::advertise(const Channel& channel) {
  channels_[channel.id].channel = channel;
  const json news = {{"op", "advertise"}, {"channels", json::array({advertised(channel)})}};
  for (const auto& client : clients_) client->text(news);
}

void Hub::publish(std::uint32_t id, std::uint64_t stamp, const Bytes& data, bool latched,
                  const std::string& key) {
  const auto entry = channels_.find(id);
  if (entry == channels_.end()) return;
  if (latched) entry->second.latched[key] = {stamp, data};
  if (entry->second.listeners == 0) return;
  for (const auto& client : clients_) {
    const auto found = client->subscriptions.find(id);
    if (found != client->subscriptions.end()) client->message(found->second, stamp, data);
  }
}

void Hub::sendTime(std::uint64_t now) {
  for (const auto& client : clients_) client->clock(now);
}

bool Hub::enter(const std::shared_ptr<Client>& client) {
  if (clients_.size() >= options.most_clients) return false;
  clients_.insert(client);
  clients = clients_.size();
  return true;
}

void Hub::leave(const std::shared_ptr<Client>& client) {
  if (clients_.erase(client) == 0) return;
  clients = clients_.size();
  for (const auto& [channel, subscription] : client->subscriptions) unsubscribe(channel);
}

bool Hub::subscribe(Client& client, std::uint32_t id, std::uint32_t subscription) {
  const auto entry = channels_.find(id);
  if (entry == channels_.end()) return false;
  const bool again = client.subscriptions.count(id) > 0;
  client.subscriptions[id] = subscription;
  for (const auto& [key, message] : entry->second.latched)
    client.message(subscription, message.stamp, message.data);
  if (!again && entry->second.listeners++ == 0) handlers.wanted(id, true);
  return true;
}

void Hub::unsubscribe(std::uint32_t id) {
  if (--channels_.at(id).listeners == 0) handlers.wanted(id, false);
}

void Hub::closeAll() {
  const auto all = std::move(clients_);
  clients_.clear();
  for (const auto& client : all) client->close();
}

// ---------------------------------------------------------------------------------------------- client

void Client::start(const http::request<http::string_body>& request) {
  const auto offered = request[http::field::sec_websocket_protocol];
  const std::string chosen = chosenOf(std::string(offered));
  if (chosen.empty()) {
    ++hub_.refused;
    return;  // closes the connection
  }
  stream_.set_option(websocket::stream_base::timeout::suggested(beast::role_type::server));
  stream_.set_option(websocket::stream_base::decorator([chosen](websocket::response_type& response) {
    response.set(http::field::sec_websocket_protocol, chosen);
  }));
  stream_.read_message_max(LONGEST_REQUEST);
  const auto held = std::make_shared<http::request<http::string_body>>(request);
  stream_.async_accept(*held, [self = shared_from_this(), held](beast::error_code failed) {
    if (!failed) self->open();
  });
}

void Client::open() {
  beast::error_code ignored;
  beast::get_lowest_layer(stream_).socket().set_option(asio::ip::tcp::no_delay(true), ignored);
  if (!hub_.enter(shared_from_this())) {
    ++hub_.refused;
    return;
  }
  // Clients are read-only: no clientPublish, parameters or services among the capabilities.
  text({{"op", "serverInfo"},
        {"name", hub_.options.name},
        {"capabilities", json::array({"time"})},
        {"metadata", {{"ROS_DISTRO", "noetic"}}},
        {"sessionId", "smartmill"}});
  text(hub_.advertisement());
  read();
}

void Client::text(const json& json) {
  send({false, {}, std::make_shared<std::string>(json.dump())});
}

void Client::message(std::uint32_t subscription, std::uint64_t stamp, const Bytes& data) {
  send({true, static_cast<char>(MESSAGE) + littleEndian(subscription, 4) + littleEndian(stamp, 8), data});
}

void Client::clock(std::uint64_t now) {
  static const Bytes nothing = std::make_shared<std::string>();
  send({true, static_cast<char>(TIME) + littleEndian(now, 8), nothing});
}

void Client::send(Frame frame) {
  if (closing_) return;
  if (waiting_ + frame.size() > hub_.options.queue) {
    ++hub_.dropped;
    if (!frame.binary) {
      close();  // its list of channels would be wrong
    } else if (!drop_reported_) {
      drop_reported_ = true;
      // Exceeds the full queue by this one message.
      const json line = {{"op", "status"},
                         {"level", WARNING},
                         {"message", "messages are dropped: the client reads too slowly"}};
      queue_.push_back({false, {}, std::make_shared<std::string>(line.dump())});
      waiting_ += queue_.back().size();
    }
    return;
  }
  waiting_ += frame.size();
  queue_.push_back(std::move(frame));
  if (queue_.size() == 1) write();
}

void Client::write() {
  const Frame& frame = queue_.front();
  stream_.binary(frame.binary);
  const std::array<asio::const_buffer, 2> buffers{asio::buffer(frame.head), asio::buffer(*frame.body)};
  stream_.async_write(buffers, [self = shared_from_this()](beast::error_code failed, std::size_t size) {
    if (failed) {
      self->end();
      return;
    }
    ++self->hub_.sent;
    self->hub_.bytes += size;
    self->waiting_ -= self->queue_.front().size();
    self->queue_.pop_front();
    if (self->queue_.empty()) {
      self->drop_reported_ = false;
    } else {
      self->write();
    }
  });
}

void Client::close() {
  closing_ = true;
  beast::error_code ignored;
  beast::get_lowest_layer(stream_).socket().close(ignored);
  end();
}

// Deferred, since the hub may be iterating over its clients.
void Client::end() {
  closing_ = true;
  asio::post(stream_.get_executor(), [self = shared_from_this()] { self->hub_.leave(self); });
}

void Client::read() {
  stream_.async_read(buffer_, [self = shared_from_this()](beast::error_code failed, std::size_t) {
    if (failed) {
      self->end();
      return;
    }
    if (self->stream_.got_text()) {
      self->handle(beast::buffers_to_string(self->buffer_.data()));
    } else {
      self->status(FAULT, "read-only: binary messages are refused");
    }
    self->buffer_.consume(self->buffer_.size());
    if (!self->closing_) self->read();
  });
}

void Client::handle(const std::string& text) {
  const json request = json::parse(text, nullptr, false);
  if (!request.is_object()) return status(FAULT, "not a JSON object");
  try {
    const std::string op = request.value("op", "");
    if (op == "subscribe") {
      handleSubscribe(request);
    } else if (op == "unsubscribe") {
      handleUnsubscribe(request);
    } else {
      ++hub_.refused;
      status(FAULT, "read-only: '" + op.substr(0, 40) + "' is refused");
    }
  } catch (const json::exception&) {
    status(FAULT, "malformed request");
  }
}

void Client::handleSubscribe(const json& request) {
  for (const json& one : request.at("subscriptions")) {
    const auto channel = one.at("channelId").get<std::uint32_t>();
    if (!hub_.subscribe(*this, channel, one.at("id").get<std::uint32_t>()))
      status(FAULT, "no channel " + std::to_string(channel));
  }
}

void Client::handleUnsubscribe(const json& request) {
  for (const auto id : request.at("subscriptionIds").get<std::vector<std::uint32_t>>()) {
    for (auto it = subscriptions.begin(); it != subscriptions.end();) {
      if (it->second != id) {
        ++it;
        continue;
      }
      const std::uint32_t channel = it->first;
      it = subscriptions.erase(it);
      hub_.unsubscribe(channel);
    }
  }
}

void Client::status(int level, const std::string& line) {
  text({{"op", "status"}, {"level", level}, {"message", line}});
}

}  // namespace smartmill::panel
