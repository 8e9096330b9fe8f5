#include "smartmill_exchange/mqtt/publisher.h"

#include <arpa/inet.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "smartmill_core/error.h"
#include "smartmill_core/testing/free_port.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_exchange/items/catalogue.h"
#include "smartmill_exchange/mqtt/retained_state.h"

namespace smartmill::exchange {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

bool installed(const std::string& programs) {
  return std::system(
             ("PATH=/usr/sbin:$PATH; for p in " + programs + "; do command -v $p >/dev/null || exit 1; done")
                 .c_str()) == 0;
}

/// Without a timeout: the test runner ends a hanging test.
template <class Condition>
void until(const Condition& condition) {
  while (!condition()) std::this_thread::sleep_for(std::chrono::milliseconds(10));
}

/// A broker on loopback, whose files are in a folder of its own.
class Broker {
 public:
  Broker() : port_(freePort()) {}
  ~Broker() { stop(); }
  void start(const std::string& rules = "allow_anonymous true\n") {
    write("mosquitto.conf", "listener " + std::to_string(port_) + " 127.0.0.1\n" + rules);
    process_ = fork();
    if (process_ == 0) {
      const std::string configuration = file("mosquitto.conf"), log = file("log");
      if (!std::freopen(log.c_str(), "a", stderr) || !std::freopen(log.c_str(), "a", stdout)) _exit(1);
      setenv("PATH", "/usr/sbin:/usr/bin:/bin", 1);
      execlp("mosquitto", "mosquitto", "-c", configuration.c_str(), nullptr);
      _exit(1);
    }
    until([this] { return answers(); });
  }
  void stop() {
    if (process_ <= 0) return;
    kill(process_, SIGKILL);
    waitpid(process_, nullptr, 0);
    process_ = -1;
  }
  void write(const std::string& name, const std::string& text) const {
    std::filesystem::permissions(folder_.write(name, text),
                                 std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
  }
  std::string file(const std::string& name) const { return folder_.file(name); }
  int port() const { return port_; }
  std::string address(const std::string& scheme = "mqtt") const {
    return scheme + "://" + (scheme == "mqtt" ? "127.0.0.1:" : "localhost:") + std::to_string(port_);
  }

  /// What a client of another hand has received (test/clients/mqtt.py).
  json received(const std::string& topic, const std::string& text, const std::string& more = "") const {
    const std::string out = file("received.json");
    const std::string command = "/usr/bin/python3 " SOURCE_FOLDER "/test/clients/mqtt.py " +
                                std::to_string(port_) + " mill '" + topic + "' '" + text + "' " + more +
                                " >" + out;
    EXPECT_EQ(std::system(command.c_str()), 0);
    std::ifstream in(out);
    return json::parse(in, nullptr, false);
  }

 private:
  bool answers() const {
    const int client = socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(port_));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    const bool good = connect(client, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0;
    close(client);
    return good;
  }

  int port_;
  TemporaryFolder folder_;
  pid_t process_ = -1;
};

/// The value of an item's payload, as text.
std::string valueOf(const json& received, const std::string& topic) {
  const auto payload = received.find(topic);
  if (payload == received.end() || !payload->is_string()) return "no message in " + received.dump();
  return json::parse(payload->get<std::string>()).at("value").dump();
}

MqttOptions optionsOf(const std::string& broker) {
  MqttOptions options;
  options.broker = broker;
  options.prefix = "mill";
  return options;
}

TEST(MqttOptions, ABrokerOnAnotherComputerRequiresTlsAndUser) {
  EXPECT_NO_THROW(check(optionsOf("mqtt://127.0.0.1:1883")));
  EXPECT_NO_THROW(check(optionsOf("mqtt://localhost:1883")));
  EXPECT_NO_THROW(check(optionsOf("mqtt://[::1]:1883")));
  const auto messageOf = [](const MqttOptions& options) -> std::string {
    try {
      check(options);
    } catch (const Error& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_THAT(messageOf(optionsOf("mqtt://broker.shop:1883")), HasSubstr("expected TLS"));
  EXPECT_THAT(messageOf(optionsOf("mqtt://127.0.0.1.evil.example:1883")), HasSubstr("expected TLS"));
  EXPECT_THAT(messageOf(optionsOf("mqtts://broker.shop:8883")),
              HasSubstr("expected mqtt_user and mqtt_password_file"));
  MqttOptions good = optionsOf("mqtts://broker.shop:8883");
  good.user = "mill";
  EXPECT_THAT(messageOf(good), HasSubstr("expected mqtt_user and mqtt_password_file"));
  good.password_file = "file";
  EXPECT_EQ(messageOf(good), "accepted");
  for (const char* broker : {"localhost", "localhost:1883", "http://localhost:1883", "mqtt://localhost",
                             "mqtt://localhost:port", "mqtt://:1883", "mqtt://user@localhost:1883"})
    EXPECT_THAT(messageOf(optionsOf(broker)), HasSubstr("expected mqtt://HOST:PORT")) << broker;
  MqttOptions wild = optionsOf("mqtt://localhost:1883");
  wild.prefix = "mill/#";
  EXPECT_THAT(messageOf(wild), HasSubstr("mqtt_prefix"));
}

TEST(RetainedState, KeepsTheLastPayloadOfEachTopic) {
  RetainedState state;
  state.set("a", "1");
  state.set("b", "1");
  state.set("a", "2");
  EXPECT_EQ(state.replaced(), 1u);
  EXPECT_EQ(state.take(1), (std::vector<RetainedState::Message>{{"a", "2"}}));
  state.set("a", "3");
  EXPECT_EQ(state.take(9), (std::vector<RetainedState::Message>{{"b", "1"}, {"a", "3"}}));
  EXPECT_EQ(state.waiting(), 0u);
  state.repeat("a");
  state.repeatAll();
  EXPECT_EQ(state.take(9), (std::vector<RetainedState::Message>{{"a", "3"}, {"b", "1"}}));
}

class MqttTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!installed("mosquitto mosquitto_passwd") ||
        std::system("/usr/bin/python3 -c 'import paho.mqtt.client, jsonschema' 2>/dev/null") != 0)
      GTEST_SKIP() << "mosquitto, python3-paho-mqtt or python3-jsonschema is not installed";
    try {
      MqttPublisher(optionsOf("mqtt://127.0.0.1:1"));
    } catch (const Error& error) {
      GTEST_SKIP() << error.what();
    }
  }
  Broker broker_;
  /// Items, catalogue and schema: what is retained before a client counts as complete. A client that
  /// subscribes earlier receives the status once, as a message and not as a retained one, and waits for the
  /// second in vain.
  const std::uint64_t own_topics = catalogue().size() + 2;
};

TEST_F(MqttTest, ItemsAreRetainedAndComeAgainAfterALostBroker) {
  broker_.start();
  MqttPublisher publisher(optionsOf(broker_.address()));
  publisher.observe({indexOf("feed"), 1.7e9, 12.5});
  Asset asset{"modes.a", "ToolModes", 1.7e9};
  publisher.store(asset);
  publisher.observe({indexOf("program"), 1.7e9, Text{"first"}});
  const std::uint64_t topics = own_topics + 1;  // asset
  until([&] { return publisher.statistics().published >= topics; });
  const json first = broker_.received("items/program", "first");
  EXPECT_EQ(valueOf(first, "items/feed"), json(12.5).dump());
  EXPECT_EQ(first.at("status"), "online");
  EXPECT_EQ(json::parse(first.at("assets/modes.a").get<std::string>()).at("type"), "ToolModes");
  EXPECT_EQ(json::parse(first.at("catalogue").get<std::string>()).size(), catalogue().size());
  EXPECT_EQ(publisher.statistics().connections, 1u);

  // A broker that has lost everything: the values of the time without it, and all others, are published
  // again.
  broker_.stop();
  until([&] { return !publisher.statistics().connected; });
  publisher.observe({indexOf("feed"), 1.7e9 + 1.0, 20.0});
  publisher.observe({indexOf("feed"), 1.7e9 + 2.0, 21.0});
  const std::uint64_t before = publisher.statistics().published;
  broker_.start();
  until([&] { return publisher.statistics().published >= before + topics; });
  const json second = broker_.received("items/program", "first");
  EXPECT_EQ(second.at("status"), "online");
  EXPECT_EQ(valueOf(second, "items/feed"), json(21.0).dump());
  EXPECT_EQ(publisher.statistics().connections, 2u);
}

TEST_F(MqttTest, AnEndIsPublished) {
  broker_.start();
  {
    MqttPublisher publisher(optionsOf(broker_.address()));
    until([&] { return publisher.statistics().connected; });
    publisher.observe({indexOf("program"), 1.7e9, Text{"last"}});
  }
  broker_.received("status", "offline");
  EXPECT_THAT(broker_.received("items/program", "last").at("items/program").get<std::string>(),
              HasSubstr("last"));
}

TEST_F(MqttTest, UserAndPassword) {
  broker_.write("passwords", "");
  ASSERT_EQ(
      std::system(("mosquitto_passwd -b " + broker_.file("passwords") + " mill secret 2>/dev/null").c_str()),
      0);
  // A broker that is started by root reads as another user.
  std::filesystem::permissions(broker_.file("passwords"), std::filesystem::perms::others_read,
                               std::filesystem::perm_options::add);
  std::filesystem::permissions(broker_.file(""), std::filesystem::perms::others_exec,
                               std::filesystem::perm_options::add);
  broker_.start("allow_anonymous false\npassword_file " + broker_.file("passwords") + "\n");
  broker_.write("wrong", "guess\n");
  broker_.write("right", "secret\n");
  MqttOptions options = optionsOf(broker_.address());
  options.user = "mill";
  options.password_file = broker_.file("wrong");
  {
    MqttPublisher refused(options);
    until([&] { return !refused.statistics().problem.empty(); });
    EXPECT_FALSE(refused.statistics().connected);
  }
  options.password_file = broker_.file("right");
  MqttPublisher publisher(options);
  publisher.observe({indexOf("feed"), 1.7e9, 5.5});
  until([&] { return publisher.statistics().published >= own_topics; });
  const json found = broker_.received("items/feed", "5.5", "--user mill --password secret");
  EXPECT_EQ(found.at("status"), "online");
  std::filesystem::permissions(broker_.file("right"), std::filesystem::perms::others_read,
                               std::filesystem::perm_options::add);
  EXPECT_THROW(MqttPublisher{options}, Error);  // others can read the password
}

TEST_F(MqttTest, Tls) {
  if (!installed("openssl")) GTEST_SKIP() << "openssl is not installed";
  // A certification authority, a certificate of the broker for localhost, and another authority.
  const std::string make =
      "cd " + broker_.file("") +
      " && for a in ca other; do openssl req -x509 -newkey rsa:2048 -nodes -days 2 -subj /CN=$a -keyout "
      "$a.key -out $a.crt; done"
      " && openssl req -newkey rsa:2048 -nodes -subj /CN=localhost -keyout broker.key -out broker.csr"
      " && printf 'subjectAltName=DNS:localhost' >names && openssl x509 -req -in broker.csr -CA ca.crt "
      "-CAkey ca.key -CAcreateserial -days 2"
      " -extfile names -out broker.crt && chmod a+rx . && chmod a+r broker.key";
  ASSERT_EQ(std::system(("{ " + make + "; } >/dev/null 2>&1").c_str()), 0);
  broker_.start("allow_anonymous true\ncafile " + broker_.file("ca.crt") + "\ncertfile " +
                broker_.file("broker.crt") + "\nkeyfile " + broker_.file("broker.key") + "\n");
  MqttOptions options = optionsOf(broker_.address("mqtts"));
  options.ca_file = broker_.file("other.crt");
  {
    MqttPublisher refused(options);
    until([&] { return !refused.statistics().problem.empty(); });
    EXPECT_FALSE(refused.statistics().connected);
  }
  options.ca_file = broker_.file("ca.crt");
  MqttPublisher publisher(options);
  publisher.observe({indexOf("feed"), 1.7e9, 6.5});
  until([&] { return publisher.statistics().published >= own_topics; });
  EXPECT_EQ(broker_.received("items/feed", "6.5", "--ca " + broker_.file("ca.crt")).at("status"), "online");
}

}  // namespace
}  // namespace smartmill::exchange
