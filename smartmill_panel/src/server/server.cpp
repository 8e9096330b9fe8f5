#include "smartmill_panel/server/server.h"

#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>
#include <thread>
#include <utility>

#include "server/hub.h"
#include "server/media_types.h"
#include "smartmill_core/error.h"
#include "smartmill_core/io/recency_list.h"

namespace smartmill::panel {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using Tcp = asio::ip::tcp;

constexpr std::size_t LONGEST_BODY = 16u << 10, LONGEST_HEAD = 8u << 10;  // [bytes] of a request
constexpr std::chrono::seconds PATIENCE(30);  // timeout of a slow or silent browser
constexpr const char* API = "/api/";

/// One HTTP connection; an upgrade hands its socket to a WebSocket client.
class HttpConnection : public std::enable_shared_from_this<HttpConnection> {
 public:
  using Open = RecencyList<HttpConnection>;
  HttpConnection(Tcp::socket socket, Hub& hub, Open& open)
      : stream_(std::move(socket)), hub_(hub), place_(open, this) {}
  HttpConnection(const HttpConnection&) = delete;
  HttpConnection& operator=(const HttpConnection&) = delete;

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
  void close() {
    place_.leave();
    beast::error_code ignored;
    stream_.socket().close(ignored);
  }

 private:
  void answer() {
    request_ = parser_->release();
    const auto word = [this](http::field field) { return std::string(request_[field]); };
    const std::string target(request_.target());
    if (!originAllowed(word(http::field::origin), word(http::field::host), hub_.options))
      return refuse(http::status::forbidden);
    if (beast::websocket::is_upgrade(request_)) {
      stream_.expires_never();
      std::make_shared<Client>(stream_.release_socket(), hub_)->start(request_);
      return;
    }
    if (target.rfind(API, 0) == 0) return ask(target);
    if (request_.method() != http::verb::get && request_.method() != http::verb::head)
      return refuse(http::status::method_not_allowed);
    const std::string file = fileOf(hub_.options.folder, target);
    std::ifstream in;
    if (!file.empty()) in.open(file, std::ios::binary);
    if (!in.is_open()) return refuse(http::status::not_found);
    std::ostringstream content;
    content << in.rdbuf();
    respond(http::status::ok, mediaTypeOf(file), content.str());
  }

  void ask(const std::string& target) {
    const bool post = request_.method() == http::verb::post;
    if (!post && request_.method() != http::verb::get) return refuse(http::status::method_not_allowed);
    ApiRequest request;
    const std::size_t begin = std::string(API).size();
    request.path = target.substr(begin, target.find_first_of("?#") - begin);
    request.query = queryOf(target);
    request.post = post;
    request.body = request_.body();
    request.token = std::string(request_["X-SmartMill-Token"]);
    beast::error_code failed;
    const auto from = stream_.socket().remote_endpoint(failed);
    request.from = failed ? "unknown" : from.address().to_string();
    stream_.expires_after(PATIENCE);
    hub_.handlers.request(std::move(request), [self = shared_from_this()](ApiResponse answer) {
      asio::post(self->stream_.get_executor(), [self, answer = std::move(answer)]() mutable {
        self->respond(static_cast<http::status>(answer.status), "application/json", std::move(answer.body));
      });
    });
  }

  void refuse(http::status status) {
    ++hub_.refused;
    respond(status, "text/plain", std::string(http::obsolete_reason(status)) + "\n");
  }

  void respond(http::status status, const std::string& type, std::string body) {
    std::string connect = "'self'";
    for (const std::string& other : hub_.options.others) {
      connect += " " + other;
      if (other.rfind("http://", 0) == 0) connect += " ws" + other.substr(4);
    }
    response_ = {};
    response_.version(request_.version());
    response_.keep_alive(request_.keep_alive());
    response_.result(status);
    response_.set(http::field::content_type, type);
    response_.set(http::field::cache_control, "no-cache");
    response_.set("X-Content-Type-Options", "nosniff");
    response_.set("Referrer-Policy", "no-referrer");
    response_.set("Content-Security-Policy",
                  "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: "
                  "blob:; frame-ancestors 'none'; connect-src " +
                      connect);
    response_.body() = std::move(body);
    response_.prepare_payload();
    if (request_.method() == http::verb::head) response_.body().clear();
    http::async_write(stream_, response_, [self = shared_from_this()](beast::error_code failed, std::size_t) {
      if (failed) return;
      if (self->response_.keep_alive()) {
        self->read();
      } else {
        self->stream_.socket().shutdown(Tcp::socket::shutdown_send, failed);
      }
    });
  }

  beast::tcp_stream stream_;
  Hub& hub_;
  Open::Place place_;
  beast::flat_buffer buffer_;
  std::optional<http::request_parser<http::string_body>> parser_;
  http::request<http::string_body> request_;
  http::response<http::string_body> response_;
};

}  // namespace

class Server::Impl {
 public:
  Impl(ServerOptions options, Handlers handlers)
      : hub_(std::move(options), std::move(handlers)), acceptor_(io_) {
    if (!std::filesystem::is_directory(hub_.options.folder))
      throw Error(hub_.options.folder + ": expected the folder of the page");
    const std::string name = hub_.options.address + ":" + std::to_string(hub_.options.port);
    beast::error_code failed;
    const auto address = asio::ip::make_address(hub_.options.address, failed);
    if (failed) throw Error(hub_.options.address + ": expected an IP address");
    const Tcp::endpoint endpoint(address, static_cast<unsigned short>(hub_.options.port));
    acceptor_.open(endpoint.protocol(), failed);
    if (!failed) acceptor_.set_option(asio::socket_base::reuse_address(true), failed);
    if (!failed) acceptor_.bind(endpoint, failed);
    if (!failed) acceptor_.listen(asio::socket_base::max_listen_connections, failed);
    if (failed) throw Error(name + ": cannot listen: " + failed.message());
    port_ = acceptor_.local_endpoint().port();
    accept();
    thread_ = std::thread([this] { io_.run(); });
  }

  ~Impl() {
    asio::post(io_, [this] {
      beast::error_code ignored;
      acceptor_.close(ignored);
      hub_.closeAll();
      io_.stop();
    });
    thread_.join();
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  template <class Work>
  void post(Work work) {
    asio::post(io_, std::move(work));
  }

  int port() const { return port_; }
  Hub& hub() { return hub_; }
  const Hub& hub() const { return hub_; }

 private:
  void accept() {
    acceptor_.async_accept([this](beast::error_code failed, Tcp::socket socket) {
      if (!acceptor_.is_open()) return;
      // At most two connections per client; the quietest makes space for another one.
      if (!failed && open_.size() >= 2 * hub_.options.most_clients) open_.quietest()->close();
      if (!failed) std::make_shared<HttpConnection>(std::move(socket), hub_, open_)->read();
      accept();
    });
  }

  Hub hub_;
  HttpConnection::Open open_;
  asio::io_context io_{1};  // its handlers own clients and connections, which refer to the hub
  Tcp::acceptor acceptor_;
  int port_ = 0;
  std::thread thread_;
};

Server::Server(ServerOptions options, Handlers handlers)
    : impl_(std::make_unique<Impl>(std::move(options), std::move(handlers))) {
}

Server::~Server() = default;

int Server::port() const {
  return impl_->port();
}

void Server::advertise(const Channel& channel) {
  impl_->post([impl = impl_.get(), channel] { impl->hub().advertise(channel); });
}

void Server::publish(std::uint32_t channel, std::uint64_t stamp, std::string data, bool latched,
                     const std::string& key) {
  const Bytes bytes = std::make_shared<const std::string>(std::move(data));
  impl_->post([impl = impl_.get(), channel, stamp, bytes, latched, key] {
    impl->hub().publish(channel, stamp, bytes, latched, key);
  });
}

void Server::sendTime(std::uint64_t now) {
  impl_->post([impl = impl_.get(), now] { impl->hub().sendTime(now); });
}

ServerStatistics Server::statistics() const {
  const Hub& hub = impl_->hub();
  return {hub.clients, hub.sent, hub.dropped, hub.bytes, hub.refused};
}

}  // namespace smartmill::panel
