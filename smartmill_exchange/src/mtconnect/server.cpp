#include "smartmill_exchange/mtconnect/server.h"

#include <atomic>
#include <chrono>
#include <deque>
#include <optional>
#include <set>
#include <thread>

#include <boost/asio.hpp>
#include <boost/beast.hpp>

#include "listen.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/recency_list.h"
#include "smartmill_exchange/mtconnect/shdr.h"

namespace smartmill::exchange {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using Tcp = asio::ip::tcp;

constexpr std::size_t LONGEST_BODY = 1024, LONGEST_HEAD = 8192;  // [byte] of a request
constexpr std::chrono::seconds PATIENCE(30);                     // of a client that neither reads nor writes
constexpr std::chrono::milliseconds TICK(20);                    // resolution of intervals and heartbeats
constexpr const char* BOUNDARY = "smartmill-mtconnect";
constexpr const char* XML = "text/xml;charset=UTF-8";

class AgentConnection;
class AdapterClient;

/// Used in the server's thread only, except for the counters.
struct Hub {
  Hub(const ServerOptions& server_options, std::function<double()> now)
      : options(server_options),
        clock(std::move(now)),
        agent(options.agent, clock()),
        writer(options.agent.uuid) {}

  ServerOptions options;
  std::function<double()> clock;
  Agent agent;
  ShdrWriter writer;
  RecencyList<AgentConnection> requesting;  // connections without a stream
  RecencyList<AdapterClient> silent;        // adapters' clients that have sent no PING
  std::set<std::shared_ptr<AgentConnection>> streams;
  std::set<std::shared_ptr<AdapterClient>> adapters;
  std::size_t connections = 0;
  std::atomic<std::size_t> agent_clients{0}, adapter_clients{0};
  std::atomic<std::uint64_t> requests{0}, refused{0}, dropped{0}, sequence{0}, late{0};
};

/// One HTTP connection of the agent.
class AgentConnection : public std::enable_shared_from_this<AgentConnection> {
 public:
  AgentConnection(Tcp::socket socket, Hub& hub)
      : stream_(std::move(socket)), hub_(hub), place_(hub.requesting, this) {
    hub_.agent_clients = ++hub_.connections;
  }
  ~AgentConnection() { hub_.agent_clients = --hub_.connections; }
  AgentConnection(const AgentConnection&) = delete;
  AgentConnection& operator=(const AgentConnection&) = delete;

  void read() {
    parser_.emplace();
    parser_->body_limit(LONGEST_BODY);
    parser_->header_limit(LONGEST_HEAD);
    stream_.expires_after(PATIENCE);
    http::async_read(stream_, buffer_, *parser_,
                     [self = shared_from_this()](beast::error_code failed, std::size_t) {
                       self->place_.touch();
                       if (!failed) self->answer();
                     });
  }

  /// Sends the next document of a stream if one is ready.
  void pump() {
    if (writing_ || !running_) return;
    std::string document;
    bool last = false;
    try {
      document = hub_.agent.next(*running_, hub_.clock());
    } catch (const AgentError& error) {
      ++hub_.late;
      document = hub_.agent.refuse(error, hub_.clock()).document;
      last = true;
    }
    if (!document.empty()) send(part(document), last);
  }

  void close() {
    place_.leave();
    beast::error_code ignored;
    stream_.socket().close(ignored);
  }

 private:
  void answer() {
    const http::request<http::string_body> request = parser_->release();
    ++hub_.requests;
    version_ = request.version();
    const bool head = request.method() == http::verb::head;
    AgentAnswer found;
    if (request.method() == http::verb::get || head) {
      found = hub_.agent.answer(std::string(request.target()), hub_.clock());
    } else {
      found = hub_.agent.refuse({"UNSUPPORTED", "this agent is read-only: expected GET", 405}, hub_.clock());
    }
    if (found.status != 200) ++hub_.refused;
    if (found.stream && !head) {
      begin(found);
      return;
    }
    response_ = {};
    response_.version(version_);
    response_.keep_alive(request.keep_alive());
    response_.result(static_cast<unsigned>(found.status));
    response_.set(http::field::content_type, XML);
    response_.set(http::field::cache_control, "no-store");
    response_.body() = std::move(found.document);
    response_.prepare_payload();
    if (head) response_.body().clear();
    http::async_write(stream_, response_, [self = shared_from_this()](beast::error_code failed, std::size_t) {
      if (failed) return;
      if (self->response_.keep_alive()) {
        self->read();
      } else {
        self->stream_.socket().shutdown(Tcp::socket::shutdown_send, failed);
      }
    });
  }

  void begin(const AgentAnswer& first) {
    running_ = first.stream;
    place_.leave();
    hub_.streams.insert(shared_from_this());
    const std::string head = formatted(
        "HTTP/1.1 200 OK\r\nContent-Type: multipart/mixed;boundary=%s\r\nCache-Control: "
        "no-store\r\nConnection: close\r\n"
        "Transfer-Encoding: chunked\r\n\r\n",
        BOUNDARY);
    send(head + part(first.document), false);
    // The client sends nothing more; reading finds out when it leaves.
    stream_.socket().async_read_some(
        asio::buffer(ignored_), [self = shared_from_this()](beast::error_code, std::size_t) { self->end(); });
  }

  static std::string part(const std::string& document) {
    const std::string body = formatted("--%s\r\nContent-type: text/xml\r\nContent-length: %zu\r\n\r\n",
                                       BOUNDARY, document.size()) +
                             document + "\r\n";
    return formatted("%zx\r\n", body.size()) + body + "\r\n";
  }

  void send(std::string bytes, bool last) {
    writing_ = true;
    out_ = std::move(bytes);
    if (last) out_ += formatted("%zx\r\n--%s--\r\n\r\n0\r\n\r\n", std::string(BOUNDARY).size() + 6, BOUNDARY);
    stream_.expires_after(PATIENCE);
    asio::async_write(stream_, asio::buffer(out_),
                      [self = shared_from_this(), last](beast::error_code failed, std::size_t) {
                        self->writing_ = false;
                        self->stream_.expires_never();
                        if (failed || last) {
                          self->end();
                        } else {
                          self->pump();
                        }
                      });
  }

  // Deferred, since the server may be iterating over its streams.
  void end() {
    running_.reset();
    asio::post(stream_.get_executor(), [self = shared_from_this()] {
      self->hub_.streams.erase(self);
      self->close();
    });
  }

  beast::tcp_stream stream_;
  Hub& hub_;
  RecencyList<AgentConnection>::Place place_;  // a stream has left it
  beast::flat_buffer buffer_;
  std::optional<http::request_parser<http::string_body>> parser_;
  http::response<http::string_body> response_;
  unsigned version_ = 11;
  std::optional<AgentStream> running_;
  bool writing_ = false;
  std::string out_;
  std::array<char, 256> ignored_{};
};

/// One client of the SHDR adapter.
class AdapterClient : public std::enable_shared_from_this<AdapterClient> {
 public:
  AdapterClient(Tcp::socket socket, Hub& hub)
      : socket_(std::move(socket)), hub_(hub), place_(hub.silent, this) {}

  void start() {
    beast::error_code ignored;
    socket_.set_option(Tcp::no_delay(true), ignored);
    send(hub_.writer.greeting(hub_.clock()));
    read();
  }

  /// A client that stops reading is disconnected: after it has connected again it gets every value.
  void send(const std::string& lines) {
    if (closed_ || lines.empty()) return;
    if (waiting_.size() + lines.size() > hub_.options.queue) {
      ++hub_.dropped;
      end();
      return;
    }
    waiting_ += lines;
    if (!writing_) write();
  }

  /// A client that has sent a PING must send another one within two heartbeats.
  void check(double now) {
    if (pinged_ && now - *pinged_ > 2.0 * hub_.options.heartbeat) end();
  }

  // Deferred, since the server may be iterating over its clients.
  void end() {
    close();
    asio::post(socket_.get_executor(), [self = shared_from_this()] {
      self->hub_.adapters.erase(self);
      self->hub_.adapter_clients = self->hub_.adapters.size();
    });
  }

  void close() {
    closed_ = true;
    place_.leave();
    beast::error_code ignored;
    socket_.close(ignored);
  }

 private:
  void read() {
    socket_.async_read_some(asio::buffer(in_),
                            [self = shared_from_this()](beast::error_code failed, std::size_t size) {
                              if (failed) {
                                self->end();
                                return;
                              }
                              const int pings = self->commands_.push(self->in_.data(), size);
                              if (pings > 0) {
                                self->pinged_ = self->hub_.clock();
                                self->place_.leave();
                              }
                              for (int i = 0; i < pings; ++i)
                                self->send(formatted("* PONG %.0f\n", 1e3 * self->hub_.options.heartbeat));
                              if (!self->closed_) self->read();
                            });
  }

  void write() {
    writing_ = true;
    out_.swap(waiting_);
    waiting_.clear();
    asio::async_write(socket_, asio::buffer(out_),
                      [self = shared_from_this()](beast::error_code failed, std::size_t) {
                        self->writing_ = false;
                        if (failed) {
                          self->end();
                        } else if (!self->waiting_.empty() && !self->closed_) {
                          self->write();
                        }
                      });
  }

  Tcp::socket socket_;
  Hub& hub_;
  RecencyList<AdapterClient>::Place place_;  // one that has sent a PING has left it
  ShdrCommands commands_;
  std::array<char, 1024> in_{};
  std::string out_, waiting_;
  bool writing_ = false, closed_ = false;
  std::optional<double> pinged_;  // [s]
};

}  // namespace

class ExchangeServer::Impl {
 public:
  Impl(const ServerOptions& options, std::function<double()> clock)
      : hub_(options, std::move(clock)), agent_(io_), adapter_(io_), timer_(io_) {
    agent_port_ = listen(agent_, options.agent_address, options.agent_port, "agent_address");
    adapter_port_ = listen(adapter_, options.adapter_address, options.adapter_port, "adapter_address");
    hub_.sequence = hub_.agent.buffer().last();
    if (agent_port_ >= 0) acceptAgent();
    if (adapter_port_ >= 0) acceptAdapter();
    tick();
    thread_ = std::thread([this] { io_.run(); });
  }

  ~Impl() {
    asio::post(io_, [this] {
      beast::error_code ignored;
      agent_.close(ignored);
      adapter_.close(ignored);
      for (const auto& stream : hub_.streams) stream->close();
      for (const auto& client : hub_.adapters) client->close();
      hub_.streams.clear();
      hub_.adapters.clear();
      io_.stop();
    });
    thread_.join();
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  void observe(const Observation& observation) {
    asio::post(io_, [this, observation] {
      hub_.agent.observe(observation);
      hub_.sequence = hub_.agent.buffer().last();
      broadcast(hub_.writer.observe(observation));
      for (const auto& stream : hub_.streams) stream->pump();
    });
  }

  void store(const Asset& asset) {
    asio::post(io_, [this, asset] {
      hub_.agent.store(asset);
      broadcast(hub_.writer.store(asset));
    });
  }

  int agentPort() const { return agent_port_; }
  int adapterPort() const { return adapter_port_; }
  ServerStatistics statistics() const {
    return {hub_.agent_clients, hub_.adapter_clients, hub_.requests, hub_.refused,
            hub_.dropped,       hub_.sequence,        hub_.late};
  }

 private:
  static int listen(Tcp::acceptor& acceptor, const std::string& address, int port, const char* key) {
    if (port < 0) return -1;
    return listenAt(acceptor, address, port, key);
  }

  /// Space for one more client: where there is none, the quietest of those that may be closed makes it.
  template <class Client, class Close>
  bool hasSpace(std::size_t clients, const RecencyList<Client>& quiet, Close close) {
    if (clients < hub_.options.most_clients) return true;
    if (quiet.size() == 0) return false;
    close(*quiet.quietest());
    return true;
  }

  void acceptAgent() {
    agent_.async_accept([this](beast::error_code failed, Tcp::socket socket) {
      if (!agent_.is_open()) return;
      if (!failed && hasSpace(hub_.connections, hub_.requesting, [](auto& quiet) { quiet.close(); }))
        std::make_shared<AgentConnection>(std::move(socket), hub_)->read();
      acceptAgent();
    });
  }

  void acceptAdapter() {
    adapter_.async_accept([this](beast::error_code failed, Tcp::socket socket) {
      if (!adapter_.is_open()) return;
      if (!failed && hasSpace(hub_.adapters.size(), hub_.silent, [](auto& quiet) { quiet.end(); })) {
        const auto client = std::make_shared<AdapterClient>(std::move(socket), hub_);
        hub_.adapters.insert(client);
        hub_.adapter_clients = hub_.adapters.size();
        client->start();
      }
      acceptAdapter();
    });
  }

  void broadcast(const std::string& lines) {
    for (const auto& client : hub_.adapters) client->send(lines);
  }

  void tick() {
    timer_.expires_after(TICK);
    timer_.async_wait([this](beast::error_code failed) {
      if (failed) return;
      for (const auto& stream : hub_.streams) stream->pump();
      const double now = hub_.clock();
      for (const auto& client : hub_.adapters) client->check(now);
      tick();
    });
  }

  Hub hub_;
  asio::io_context io_{1};  // its handlers own connections, which refer to the hub
  Tcp::acceptor agent_, adapter_;
  asio::steady_timer timer_;
  int agent_port_ = -1, adapter_port_ = -1;
  std::thread thread_;
};

ExchangeServer::ExchangeServer(const ServerOptions& options, std::function<double()> clock)
    : impl_(std::make_unique<Impl>(options, std::move(clock))) {
}

ExchangeServer::~ExchangeServer() = default;

void ExchangeServer::observe(const Observation& observation) {
  impl_->observe(observation);
}

void ExchangeServer::store(const Asset& asset) {
  impl_->store(asset);
}

int ExchangeServer::agentPort() const {
  return impl_->agentPort();
}

int ExchangeServer::adapterPort() const {
  return impl_->adapterPort();
}

ServerStatistics ExchangeServer::statistics() const {
  return impl_->statistics();
}

}  // namespace smartmill::exchange
