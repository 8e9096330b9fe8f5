#include "smartmill_exchange/mtconnect/server.h"

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "smartmill_core/error.h"
#include "smartmill_exchange/items/catalogue.h"

namespace smartmill::exchange {
namespace {

using nlohmann::json;

double wallTime() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

/// Without a timeout: the test runner ends a hanging test.
template <class Condition>
void until(const Condition& condition) {
  while (!condition()) std::this_thread::sleep_for(std::chrono::milliseconds(2));
}

int connectTo(int port) {
  const int client = socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  EXPECT_EQ(connect(client, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  return client;
}

// A client of another hand (test/mtconnect/read_server.py): validity of the documents, no observation lost,
// equal values.
TEST(Server, AClientOfPythonReadsAgentAndAdapter) {
  ExchangeServer server({}, wallTime);
  const std::string command = "/usr/bin/python3 " SOURCE_FOLDER "/test/mtconnect/read_server.py " +
                              std::to_string(server.agentPort()) + " " + std::to_string(server.adapterPort());
  FILE* pipe = popen(command.c_str(), "r");
  ASSERT_NE(pipe, nullptr);
  char line[65536];
  ASSERT_NE(std::fgets(line, sizeof line, pipe), nullptr);
  ASSERT_EQ(std::string(line), "ready\n");
  json feed = json::array();
  for (int i = 0; i < 1000; ++i) {
    const double value = 1.0 / (i + 3.0);
    feed.push_back(numberText(value));
    server.observe({indexOf("feed"), wallTime(), value});
  }
  server.observe(
      {indexOf("alarms"), wallTime(), Activations{{true, "417", "<SERVO> & more"}, {false, "5", "warm"}}});
  server.observe({indexOf("force_peak_tooth"), wallTime(), DataSet{{"t1", 101.25}, {"t2", 99.5}}});
  Asset asset{"coefficients.a.b", "CuttingCoefficients", wallTime()};
  asset.labels = {{"tool", "a"}};
  asset.quantities = {{"ktc", "N/m2", 796.4e6, 4.2e6}, {"kte", "N/m", 27.7e3}};
  server.store(asset);
  server.observe({indexOf("program"), wallTime(), Text{"END"}});
  ASSERT_NE(std::fgets(line, sizeof line, pipe), nullptr);
  ASSERT_EQ(pclose(pipe), 0);
  const json found = json::parse(line);
  EXPECT_TRUE(found["consecutive"].get<bool>());
  EXPECT_EQ(found["feed"], feed);
  EXPECT_EQ(found["shdr_feed"], feed);
  EXPECT_EQ(found["alarms"],
            json::parse(R"([["Fault", "417", "<SERVO> & more"], ["Warning", "5", "warm"]])"));
  EXPECT_EQ(found["shdr_alarms"],
            json::parse(R"({"417": ["fault", "<SERVO> & more"], "5": ["warning", "warm"]})"));
  EXPECT_EQ(found["teeth"], json::parse(R"({"t1": 101.25, "t2": 99.5})"));
  EXPECT_EQ(found["shdr_teeth"], "t1=101.25 t2=99.5");
  EXPECT_EQ(found["asset"], json::parse(R"({"type": "CuttingCoefficients", "tool": "a",
    "quantities": {"ktc": [796400000.0, 4200000.0], "kte": [27700.0, null]}, "groups": []})"));
  EXPECT_EQ(found["shdr_assets"], json::parse(R"(["coefficients.a.b"])"));
  EXPECT_EQ(found["pongs"], json::parse("[10000]"));
  EXPECT_EQ(found["refused"],
            json::parse(
                R"([[405, "UNSUPPORTED"], [405, "UNSUPPORTED"], [400, "INVALID_REQUEST"], [404, "NO_DEVICE"],
                                              [404, "ASSET_NOT_FOUND"]])"));
  EXPECT_EQ(found["items"], catalogue().size());
}

TEST(Server, SilentConnectionsMakeSpaceForAnotherOne) {
  ServerOptions options;
  options.most_clients = 4;
  ExchangeServer server(options, wallTime);
  const auto answer = [](int port, const std::string& request) {
    const int client = connectTo(port);
    EXPECT_EQ(send(client, request.data(), request.size(), MSG_NOSIGNAL),
              static_cast<ssize_t>(request.size()));
    char first = 0;
    const ssize_t got = recv(client, &first, 1, 0);
    close(client);
    return got == 1 ? first : ' ';
  };
  std::vector<int> silent;
  for (int i = 0; i < 50; ++i) silent.push_back(connectTo(server.agentPort()));
  EXPECT_EQ(answer(server.agentPort(), "GET /probe HTTP/1.1\r\nHost: localhost\r\n\r\n"), 'H');
  for (int i = 0; i < 50; ++i) silent.push_back(connectTo(server.adapterPort()));
  EXPECT_EQ(answer(server.adapterPort(), "* PING\n"), '*');
  EXPECT_LE(server.statistics().adapter_clients, 5u);
  for (const int client : silent) close(client);
}

TEST(Server, ASlowClientOfTheAdapterIsDisconnectedAndOthersLoseNothing) {
  ServerOptions options;
  options.queue = 200000;
  ExchangeServer server(options, wallTime);
  const int slow = connectTo(server.adapterPort()), other = connectTo(server.adapterPort());
  until([&] { return server.statistics().adapter_clients == 2; });
  std::atomic<int> received{0};
  std::thread reader([&] {
    std::string rest;
    char part[65536];
    while (true) {
      const ssize_t n = recv(other, part, sizeof part, 0);
      if (n <= 0) return;
      rest.append(part, static_cast<std::size_t>(n));
      for (std::size_t end = rest.find('\n'); end != std::string::npos; end = rest.find('\n')) {
        if (rest.find("|line|a") < end) ++received;
        rest.erase(0, end + 1);
      }
    }
  });
  // At the pace of the reader, until the buffers of the other one are full.
  int sent = 0;
  while (server.statistics().dropped == 0) {
    for (int i = 0; i < 50; ++i) server.observe({indexOf("line"), wallTime(), Text{std::string(1000, 'a')}});
    sent += 50;
    until([&] { return received == sent; });
  }
  EXPECT_EQ(server.statistics().dropped, 1u);
  until([&] { return server.statistics().adapter_clients == 1; });
  shutdown(other, SHUT_RDWR);
  reader.join();
  close(slow);
  close(other);
}

TEST(Server, AClientThatStopsItsPingsIsDisconnected) {
  ServerOptions options;
  options.heartbeat = 0.05;
  ExchangeServer server(options, wallTime);
  const int client = connectTo(server.adapterPort()), silent = connectTo(server.adapterPort());
  until([&] { return server.statistics().adapter_clients == 2; });
  ASSERT_EQ(send(client, "* PING\n", 7, 0), 7);
  until([&] { return server.statistics().adapter_clients == 1; });  // one that has sent no PING stays
  close(client);
  close(silent);
}

TEST(Server, APortInUseAndABadAddressAreRefused) {
  ServerOptions options;
  ExchangeServer server(options, wallTime);
  options.agent_port = server.agentPort();
  EXPECT_THROW(ExchangeServer(options, wallTime), Error);
  options = {};
  options.adapter_address = "localhost";
  EXPECT_THROW(ExchangeServer(options, wallTime), Error);
  options = {};
  options.adapter_port = -1;
  EXPECT_EQ(ExchangeServer(options, wallTime).adapterPort(), -1);
}

}  // namespace
}  // namespace smartmill::exchange
