#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <set>
#include <string>
#include <thread>

#include <gtest/gtest.h>
#include <boost/asio.hpp>
#include <boost/beast.hpp>
#include <nlohmann/json.hpp>

#include "smartmill_core/error.h"
#include "smartmill_panel/server/command_gate.h"
#include "smartmill_panel/server/server.h"

namespace smartmill::panel {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using nlohmann::json;
using Tcp = asio::ip::tcp;

constexpr const char* PROTOCOL = "foxglove.websocket.v1";

struct Folder {
  Folder() {
    char name[] = "/tmp/smartmill_panel_XXXXXX";
    path = mkdtemp(name);
    std::filesystem::create_directory(path + "/page");
    write("page/index.html", "<p>here</p>");
    write("page/phone.html", "<p>phone</p>");
    write("page/secret.key", "no page");
    write("outside.html", "outside");
    std::filesystem::create_symlink("../outside.html", path + "/page/link.html");
  }
  ~Folder() { std::filesystem::remove_all(path); }
  void write(const std::string& name, const std::string& content) const {
    std::ofstream(path + "/" + name) << content;
  }
  std::string path;
};

class ServerTest : public ::testing::Test {
 protected:
  void start(std::size_t queue = 4u << 20, std::size_t most_clients = 64) {
    ServerOptions options;
    options.folder = folder_.path + "/page";
    options.queue = queue;
    options.most_clients = most_clients;
    options.origins = {"http://desktop.example:8080"};
    server_ = std::make_unique<Server>(
        options, Server::Handlers{[this](std::uint32_t channel, bool wanted) {
                                    const std::lock_guard<std::mutex> lock(mutex_);
                                    wanted ? (void)wanted_.insert(channel) : (void)wanted_.erase(channel);
                                  },
                                  [](ApiRequest request, const Server::Respond& respond) {
                                    respond({200, json({{"path", request.path},
                                                        {"query", request.query},
                                                        {"post", request.post},
                                                        {"body", request.body},
                                                        {"token", request.token},
                                                        {"from", request.from}})
                                                      .dump()});
                                  }});
    server_->advertise({1, "/smartmill/cnc/state", "smartmill_msgs/CncState", "bool connected"});
    server_->advertise({2, "/smartmill/stability/chart", "smartmill_msgs/StabilityChart", "float64 x"});
  }

  std::set<std::uint32_t> wanted() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return wanted_;
  }
  // Without a timeout: the test runner ends a hanging test.
  template <class Condition>
  static void until(const Condition& condition) {
    while (!condition()) std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }

  http::response<http::string_body> request(http::verb verb, const std::string& target,
                                            const std::string& host = "localhost",
                                            const std::string& origin = {}, const std::string& body = {},
                                            bool upgrade = false) {
    asio::io_context io;
    beast::tcp_stream stream(io);
    stream.connect({asio::ip::make_address("127.0.0.1"), static_cast<unsigned short>(server_->port())});
    http::request<http::string_body> request{verb, target, 11};
    request.set(http::field::host, host);
    if (!origin.empty()) request.set(http::field::origin, origin);
    request.set("X-SmartMill-Token", "abc");
    request.body() = body;
    request.keep_alive(false);
    request.prepare_payload();
    if (upgrade) {
      request.set(http::field::connection, "Upgrade");
      request.set(http::field::upgrade, "websocket");
      request.set(http::field::sec_websocket_version, "13");
      request.set(http::field::sec_websocket_key, "AAAAAAAAAAAAAAAAAAAAAA==");
      request.set(http::field::sec_websocket_protocol, PROTOCOL);
    }
    http::write(stream, request);
    beast::flat_buffer buffer;
    http::response<http::string_body> response;
    http::read(stream, buffer, response);
    return response;
  }

  Folder folder_;
  std::mutex mutex_;
  std::set<std::uint32_t> wanted_;
  std::unique_ptr<Server> server_;
};

// A client with blocking calls.
class TestClient {
 public:
  explicit TestClient(int port, const std::string& origin = {}, const std::string& protocol = PROTOCOL,
                      const std::string& host = {})
      : stream_(io_) {
    const Tcp::endpoint place(asio::ip::make_address("127.0.0.1"), static_cast<unsigned short>(port));
    stream_.next_layer().connect(place);
    stream_.set_option(websocket::stream_base::decorator([=](websocket::request_type& request) {
      if (!origin.empty()) request.set(http::field::origin, origin);
      if (!protocol.empty()) request.set(http::field::sec_websocket_protocol, protocol);
    }));
    websocket::response_type response;
    stream_.read_message_max(0);
    stream_.handshake(response, host.empty() ? "127.0.0.1:" + std::to_string(port) : host, "/", failed_);
    chosen_ = std::string(response[http::field::sec_websocket_protocol]);
  }
  bool connected() const { return !failed_; }
  const std::string& chosen() const { return chosen_; }
  void send(const json& request) { sendText(request.dump()); }
  // The server may close the connection during a write; the next read reports it.
  void sendText(const std::string& text) {
    stream_.text(true);
    stream_.write(asio::buffer(text), failed_);
  }
  void sendBinary(const std::string& bytes) {
    stream_.binary(true);
    stream_.write(asio::buffer(bytes), failed_);
  }
  void subscribe(std::uint32_t channel, std::uint32_t id) {
    send({{"op", "subscribe"}, {"subscriptions", {{{"id", id}, {"channelId", channel}}}}});
  }
  struct Frame {
    bool binary;
    std::string data;
  };
  Frame read() {
    beast::flat_buffer buffer;
    stream_.read(buffer, failed_);
    return {stream_.got_binary(), failed_ ? "" : beast::buffers_to_string(buffer.data())};
  }
  json readText() {
    for (;;) {
      const Frame frame = read();
      if (!frame.binary) return json::parse(frame.data);
    }
  }
  std::string readMessage(std::uint32_t id) {
    for (;;) {
      const Frame frame = read();
      if (!connected()) return "closed";
      if (!frame.binary || frame.data.at(0) != 1) continue;
      std::uint32_t got = 0;
      for (std::size_t i = 0; i < 4; ++i)
        got |= static_cast<std::uint32_t>(static_cast<unsigned char>(frame.data[1 + i])) << (8 * i);
      if (got == id) return frame.data.substr(13);
    }
  }
  void greet() {
    EXPECT_EQ(readText().at("op"), "serverInfo");
    EXPECT_EQ(readText().at("op"), "advertise");
  }

 private:
  asio::io_context io_;
  websocket::stream<Tcp::socket> stream_;
  beast::error_code failed_;
  std::string chosen_;
};

TEST_F(ServerTest, GreetsAsTheProtocolRequires) {
  start();
  for (const char* protocol : {"foxglove.websocket.v1", "foxglove.sdk.v1"}) {
    TestClient client(server_->port(), "", protocol);
    ASSERT_TRUE(client.connected());
    EXPECT_EQ(client.chosen(), protocol);
    const json info = client.readText();
    EXPECT_EQ(info.at("op"), "serverInfo");
    EXPECT_EQ(info.at("capabilities"), json::array({"time"}));
    const json channels = client.readText().at("channels");
    ASSERT_EQ(channels.size(), 2u);
    EXPECT_EQ(channels[0].at("topic"), "/smartmill/cnc/state");
    EXPECT_EQ(channels[0].at("encoding"), "ros1");
    EXPECT_EQ(channels[0].at("schemaEncoding"), "ros1msg");
    EXPECT_EQ(channels[0].at("schema"), "bool connected");
  }
  EXPECT_FALSE(TestClient(server_->port(), "", "chat").connected());
  EXPECT_FALSE(TestClient(server_->port(), "", "").connected());
}

TEST_F(ServerTest, SendsSubscribedAndLatchedMessages) {
  start();
  server_->publish(2, 7, "old chart", true);
  server_->publish(2, 8, "chart", true);
  server_->publish(2, 9, "chart in y", true, "y");
  TestClient client(server_->port());
  client.greet();
  client.subscribe(2, 70);
  EXPECT_EQ(client.readMessage(70), "chart");
  EXPECT_EQ(client.readMessage(70), "chart in y");
  until([&] { return wanted() == std::set<std::uint32_t>{2}; });
  client.subscribe(1, 71);
  until([&] { return wanted().count(1) == 1; });
  server_->publish(1, 1234567890123456789u, "state");
  const TestClient::Frame frame = client.read();
  ASSERT_TRUE(frame.binary);
  // 0x01, id and time little-endian, payload.
  EXPECT_EQ(frame.data, std::string("\x01\x47\0\0\0\x15\x81\xe9\x7d\xf4\x10\x22\x11", 13) + "state");
  client.send({{"op", "unsubscribe"}, {"subscriptionIds", {71}}});
  until([&] { return wanted() == std::set<std::uint32_t>{2}; });
  server_->publish(1, 2, "not for you");
  server_->publish(2, 3, "new chart");
  EXPECT_EQ(client.readMessage(70), "new chart");
}

TEST_F(ServerTest, ALostClientIsUnsubscribed) {
  start();
  {
    TestClient client(server_->port());
    client.greet();
    client.subscribe(1, 1);
    until([&] { return wanted().count(1) == 1; });
  }
  until([&] { return wanted().empty(); });
  until([&] { return server_->statistics().clients == 0; });
}

TEST_F(ServerTest, IsReadOnlyAndToleratesInvalidRequests) {
  start();
  TestClient client(server_->port());
  client.greet();
  for (const char* op : {"advertise", "publish", "setParameters", "callServiceRequest", ""}) {
    client.send({{"op", op}});
    const json status = client.readText();
    EXPECT_EQ(status.at("op"), "status") << op;
    EXPECT_EQ(status.at("level"), 2);
  }
  for (const char* nonsense : {"", "{", "[]", "7", R"({"op":7})", R"({"op":"subscribe"})",
                               R"({"op":"subscribe","subscriptions":[{}]})",
                               R"({"op":"subscribe","subscriptions":[{"id":-1,"channelId":"x"}]})",
                               R"({"op":"subscribe","subscriptions":[{"id":1,"channelId":99}]})",
                               R"({"op":"unsubscribe","subscriptionIds":"all"})"}) {
    client.sendText(nonsense);
    EXPECT_EQ(client.readText().at("op"), "status") << nonsense;
  }
  client.sendBinary("\x01publish");
  EXPECT_EQ(client.readText().at("level"), 2);
  client.subscribe(1, 5);
  until([&] { return wanted().count(1) == 1; });
  server_->publish(1, 1, "still there");
  EXPECT_EQ(client.readMessage(5), "still there");
  client.sendText(std::string(100000, ' '));  // longer than a permitted request
  EXPECT_EQ(client.readMessage(5), "closed");
}

TEST_F(ServerTest, AClientThatStopsReadingDoesNotAffectOthers) {
  constexpr std::size_t QUEUE = 256u << 10;
  start(QUEUE);
  TestClient asleep(server_->port());
  asleep.greet();
  asleep.subscribe(1, 1);
  until([&] { return wanted().count(1) == 1; });
  constexpr int MESSAGES = 1000;
  std::vector<std::unique_ptr<TestClient>> others;
  std::vector<std::thread> readers;
  std::array<std::atomic<int>, 9> received{};
  std::atomic<int> in_order{0};
  for (int k = 0; k < 9; ++k) {
    others.push_back(std::make_unique<TestClient>(server_->port()));
    others.back()->greet();
    others.back()->subscribe(1, 1);
    server_->publish(2, 1, "x", true);
    others.back()->subscribe(2, 2);  // its latched message confirms that the first subscription is active
    EXPECT_EQ(others.back()->readMessage(2), "x");
  }
  for (std::size_t c = 0; c < others.size(); ++c) {
    readers.emplace_back([&client = *others[c], &received = received[c], &in_order] {
      for (int k = 0; k < MESSAGES; ++k) {
        const std::string data = client.readMessage(1);
        ++received;
        if (std::atoi(data.c_str()) == k) ++in_order;
      }
    });
  }
  // 20 kB each, no faster than the slowest of the nine clients reads.
  for (int k = 0; k < MESSAGES; ++k) {
    until([&] {
      return std::all_of(received.begin(), received.end(), [&](const auto& of) { return of > k - 5; });
    });
    std::string data = std::to_string(k);
    data.resize(20000, ' ');
    server_->publish(1, 1, data);
  }
  for (std::thread& reader : readers) reader.join();
  EXPECT_EQ(in_order, 9 * MESSAGES);
  const ServerStatistics statistics = server_->statistics();
  EXPECT_GT(statistics.dropped, 0u);
  EXPECT_EQ(statistics.clients, 10u);
  // The stopped client reads again: the queued messages arrive, then the status of the dropped ones.
  bool dropped = false;
  while (!dropped) {
    const TestClient::Frame frame = asleep.read();
    ASSERT_TRUE(asleep.connected());
    dropped = !frame.binary && json::parse(frame.data).at("op") == "status";
  }
  EXPECT_TRUE(dropped);
}

TEST_F(ServerTest, TooManyClientsAreRefused) {
  start(4u << 20, 2);
  TestClient a(server_->port()), b(server_->port());
  a.greet();
  b.greet();
  TestClient c(server_->port());
  EXPECT_EQ(c.readMessage(1), "closed");
}

TEST_F(ServerTest, RefusesHostileOrigins) {
  start();
  const std::string own = "127.0.0.1:" + std::to_string(server_->port());
  EXPECT_TRUE(TestClient(server_->port(), "http://" + own).connected());
  EXPECT_TRUE(TestClient(server_->port(), "http://desktop.example:8080").connected());
  for (const char* origin :
       {"http://evil.example", "null", "http://127.0.0.1", "https://localhost", "file://"}) {
    EXPECT_FALSE(TestClient(server_->port(), origin).connected()) << origin;
    EXPECT_EQ(request(http::verb::get, "/", own, origin, "", true).result_int(), 403u) << origin;
  }
  // DNS rebinding, a foreign name that resolves to this computer: origin and host agree but are not
  // permitted.
  TestClient rebound(server_->port(), "http://evil.example:8090", PROTOCOL, "evil.example:8090");
  EXPECT_FALSE(rebound.connected());
  EXPECT_EQ(request(http::verb::get, "/", "evil.example").result_int(), 403u);
  EXPECT_EQ(request(http::verb::post, "/api/command", "localhost", "http://evil.example").result_int(), 403u);
  EXPECT_GE(server_->statistics().refused, 6u);
}

TEST_F(ServerTest, ServesThePageAndNothingElse) {
  start();
  const auto page = request(http::verb::get, "/");
  EXPECT_EQ(page.result_int(), 200u);
  EXPECT_EQ(page.body(), "<p>here</p>");
  EXPECT_NE(std::string(page["Content-Security-Policy"]).find("default-src 'self'"), std::string::npos);
  EXPECT_EQ(request(http::verb::get, "/index.html?x=1").body(), "<p>here</p>");
  EXPECT_EQ(request(http::verb::get, "/phone").body(), "<p>phone</p>");
  for (const char* target : {"/../outside.html", "/%2e%2e/outside.html", "/..%2foutside.html", "//etc/passwd",
                             "/etc/passwd", "/link.html", "/secret.key", "/missing.html", "/.hidden.html",
                             "/index.html/../../outside.html", "/index.html\\..\\x.html"})
    EXPECT_EQ(request(http::verb::get, target).result_int(), 404u) << target;
  EXPECT_EQ(request(http::verb::put, "/index.html", "localhost", "", "x").result_int(), 405u);
  EXPECT_EQ(request(http::verb::post, "/index.html").result_int(), 405u);
}

TEST_F(ServerTest, ForwardsRequests) {
  start();
  const auto answer = request(http::verb::get, "/api/what_if?teeth=4&text=a%20b%2Fc+d&empty");
  EXPECT_EQ(answer.result_int(), 200u);
  const json forwarded = json::parse(answer.body());
  EXPECT_EQ(forwarded.at("path"), "what_if");
  EXPECT_EQ(forwarded.at("query").at("teeth"), "4");
  EXPECT_EQ(forwarded.at("query").at("text"), "a b/c d");
  EXPECT_EQ(forwarded.at("query").at("empty"), "");
  const json posted = json::parse(request(http::verb::post, "/api/command", "localhost", "", "body").body());
  EXPECT_TRUE(posted.at("post"));
  EXPECT_EQ(posted.at("body"), "body");
  EXPECT_EQ(posted.at("token"), "abc");
  EXPECT_EQ(posted.at("from"), "127.0.0.1");
}

TEST_F(ServerTest, BoundsRequests) {
  start();
  const auto tooLong = [&](const std::string& target, const std::string& body) {
    try {
      return request(http::verb::post, target, "localhost", "", body).result_int() != 200u;
    } catch (const boost::system::system_error&) {
      return true;  // the server closes the connection
    }
  };
  EXPECT_TRUE(tooLong("/api/command", std::string(1u << 20, 'x')));
  EXPECT_TRUE(tooLong("/api/" + std::string(20000, 'x'), ""));
  EXPECT_FALSE(tooLong("/api/command", "short"));
}

TEST_F(ServerTest, SilentConnectionsMakeSpaceForAnotherOne) {
  start(4u << 20, 4);
  asio::io_context io;
  std::vector<Tcp::socket> silent;
  for (int i = 0; i < 50; ++i) {
    silent.emplace_back(io);
    silent.back().connect(
        {asio::ip::make_address("127.0.0.1"), static_cast<unsigned short>(server_->port())});
  }
  EXPECT_EQ(request(http::verb::get, "/api/any").result_int(), 200u);
}

TEST_F(ServerTest, ReportsWhyItCannotStart) {
  start();
  ServerOptions options;
  options.folder = folder_.path + "/page";
  options.port = server_->port();
  try {
    Server second(options, {});
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("127.0.0.1:" + std::to_string(options.port)), std::string::npos);
  }
  options.port = 0;
  options.folder = folder_.path + "/none";
  EXPECT_THROW(Server(options, {}), Error);
}

TEST_F(ServerTest, WorksWithAnIndependentClient) {
  if (std::system("/usr/bin/python3 -c 'import websockets' 2>/dev/null") != 0)
    GTEST_SKIP() << "python3-websockets is not installed";
  start();
  std::string all;
  for (int c = 0; c < 256; ++c) all.push_back(static_cast<char>(c));
  const std::string large(100000, '\x7f');  // a frame with a length of 64 bits
  server_->publish(2, 1234567890123456789u, all, true, "a");
  server_->publish(2, 5, "", true, "b");
  server_->publish(2, 6, large, true, "c");
  const std::string command = std::string("/usr/bin/python3 ") + INDEPENDENT_CLIENT + " " +
                              std::to_string(server_->port()) + " /smartmill/stability/chart 3";
  FILE* pipe = popen(command.c_str(), "r");
  ASSERT_NE(pipe, nullptr);
  std::string output;
  char part[65536];
  for (std::size_t n = 0; (n = fread(part, 1, sizeof part, pipe)) > 0;) output.append(part, n);
  ASSERT_EQ(pclose(pipe), 0);
  const json received = json::parse(output);
  EXPECT_EQ(received.at("subprotocol"), PROTOCOL);
  EXPECT_EQ(received.at("info").at("name"), "SmartMill");
  EXPECT_EQ(received.at("channel").at("schemaName"), "smartmill_msgs/StabilityChart");
  ASSERT_EQ(received.at("payloads").size(), 3u);
  EXPECT_EQ(received["payloads"][0][0], 1234567890123456789u);
  std::string hex;
  for (const unsigned char c : all) {
    char two[3];
    std::snprintf(two, sizeof two, "%02x", c);
    hex += two;
  }
  EXPECT_EQ(received["payloads"][0][1], hex);
  EXPECT_EQ(received["payloads"][1][1], "");
  EXPECT_EQ(received["payloads"][2][1].get<std::string>().size(), 2 * large.size());
  EXPECT_EQ(received.at("status").at("level"), 2);
}

TEST(CommandGate, RequiresTheToken) {
  ApiRequest command;
  command.post = true;
  command.token = "0123456789abcdef";
  const CommandGate closed;
  EXPECT_FALSE(closed.open());
  EXPECT_EQ(closed.refusal(command)->status, 403);

  const Folder folder;
  const std::string file = folder.path + "/token";
  folder.write("token", "0123456789abcdef\n");
  chmod(file.c_str(), 0644);
  EXPECT_THROW(CommandGate{file}, Error);
  chmod(file.c_str(), 0600);
  const CommandGate gate(file);
  EXPECT_FALSE(gate.refusal(command));
  for (const char* wrong : {"", "0123456789abcdeF", "0123456789abcde", "0123456789abcdef0"}) {
    command.token = wrong;
    EXPECT_EQ(gate.refusal(command)->status, 401) << wrong;
  }
  command.token = "0123456789abcdef";
  command.post = false;
  EXPECT_EQ(gate.refusal(command)->status, 405);
  folder.write("token", "short\n");
  EXPECT_THROW(CommandGate{file}, Error);
  EXPECT_THROW(CommandGate{folder.path + "/none"}, Error);
}

}  // namespace
}  // namespace smartmill::panel
