#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <thread>

#include <mqtt/async_client.h>

#include "smartmill_core/io/secret_file.h"
#include "smartmill_exchange/items/catalogue.h"
#include "smartmill_exchange/items/json.h"
#include "smartmill_exchange/mqtt/publisher.h"
#include "smartmill_exchange/mqtt/retained_state.h"

namespace smartmill::exchange {
namespace {

using namespace std::chrono_literals;

constexpr int QOS = 1;             // at least once
constexpr std::size_t BATCH = 64;  // [1] messages that wait for their confirmation together
constexpr auto CONFIRMATION = 5s;  // timeout of a confirmation, then the connection counts as lost
constexpr auto CONNECTING = 5s;
constexpr std::chrono::milliseconds LEAST_PAUSE(500), LONGEST_PAUSE(10000);  // before the next attempt
constexpr auto POLL = 100ms;    // how often a silent connection is checked
constexpr auto FAREWELL = 1s;   // for what waits at the end
constexpr int KEEP_ALIVE = 10;  // [s]
constexpr const char* SYSTEM_CERTIFICATES = "/etc/ssl/certs/ca-certificates.crt";

mqtt::message_ptr retained(const std::string& topic, const std::string& payload) {
  return mqtt::make_message(topic, payload, QOS, true);
}

}  // namespace

class MqttPublisher::Impl {
 public:
  explicit Impl(const MqttOptions& options)
      : options_(options),
        status_(options.prefix + "/status"),
        client_(uriOf(options.broker), options.client, nullptr) {
    connection_ = connectOptions();
    state_.set(options.prefix + "/catalogue", catalogueJson());
    state_.set(options.prefix + "/schema", observationSchema());
    // A retained value of an earlier run is not valid now.
    for (std::size_t i = 0; i < catalogue().size(); ++i)
      state_.set(itemTopic(i), observationJson({i, startTime(), Unavailable{}}));
    thread_ = std::thread([this] { run(); });
  }

  ~Impl() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      stopping_ = true;
    }
    changed_.notify_all();
    thread_.join();
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  void observe(const Observation& observation) {
    set(itemTopic(observation.item), observationJson(observation));
  }
  void store(const Asset& asset) { set(options_.prefix + "/assets/" + asset.id, assetJson(asset)); }

  MqttStatistics statistics() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return {connected_, published_, state_.replaced(), connections_, state_.waiting(), problem_};
  }

 private:
  static std::string uriOf(const std::string& broker) {
    const bool tls = broker.rfind("mqtts:", 0) == 0;
    return (tls ? "ssl" : "tcp") + broker.substr(broker.find(':'));
  }

  static double startTime() {
    return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
  }

  std::string itemTopic(std::size_t item) const { return options_.prefix + "/items/" + catalogue()[item].id; }

  mqtt::connect_options connectOptions() const {
    mqtt::connect_options_builder builder;
    builder.clean_session(true)
        .keep_alive_interval(std::chrono::seconds(KEEP_ALIVE))
        .connect_timeout(CONNECTING);
    builder.will(mqtt::message(status_, std::string("offline"), QOS, true));
    if (!options_.user.empty()) builder.user_name(options_.user);
    if (!options_.password_file.empty())
      builder.password(readSecret("mqtt_password_file", options_.password_file));
    if (options_.broker.rfind("mqtts:", 0) == 0) {
      builder.ssl(mqtt::ssl_options_builder()
                      .trust_store(options_.ca_file.empty() ? SYSTEM_CERTIFICATES : options_.ca_file)
                      .enable_server_cert_auth(true)
                      .verify(true)
                      .finalize());
    }
    return builder.finalize();
  }

  void set(const std::string& topic, const std::string& payload) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      state_.set(topic, payload);
    }
    changed_.notify_all();
  }

  void run() {
    std::chrono::milliseconds pause = LEAST_PAUSE;
    while (!stopping()) {
      if (connect()) {
        pause = LEAST_PAUSE;
        publish();
      } else {
        std::unique_lock<std::mutex> lock(mutex_);
        changed_.wait_for(lock, pause, [this] { return stopping_; });
        pause = std::min(2 * pause, LONGEST_PAUSE);
      }
    }
    leave();
  }

  bool stopping() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return stopping_;
  }

  bool connect() {
    std::string problem;
    try {
      if (client_.connect(connection_)->wait_for(CONNECTING + 1s)) {
        client_.publish(retained(status_, "online"));
        const std::lock_guard<std::mutex> lock(mutex_);
        state_.repeatAll();
        connected_ = true;
        ++connections_;
        problem_.clear();
        return true;
      }
      problem = "no answer";
    } catch (const mqtt::exception& error) {
      problem = error.what();
    }
    const std::lock_guard<std::mutex> lock(mutex_);
    problem_ = options_.broker + ": " + problem;
    return false;
  }

  /// Until the connection is lost or the end.
  void publish() {
    while (client_.is_connected() && sendBatch()) {
      std::unique_lock<std::mutex> lock(mutex_);
      changed_.wait_for(lock, POLL, [this] { return stopping_ || state_.waiting() > 0; });
      if (stopping_) return;
    }
    try {
      if (client_.is_connected()) client_.disconnect()->wait_for(CONFIRMATION);
    } catch (const mqtt::exception&) {
      // It is connected again below.
    }
    const std::lock_guard<std::mutex> lock(mutex_);
    connected_ = false;
    problem_ = options_.broker + ": connection lost";
  }

  /// @return false when a message was not confirmed
  bool sendBatch() {
    std::vector<RetainedState::Message> batch;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      batch = state_.take(BATCH);
    }
    std::vector<std::pair<std::string, mqtt::delivery_token_ptr>> sent;
    bool good = true;
    for (const auto& [topic, payload] : batch) {
      mqtt::delivery_token_ptr token;
      try {
        if (good) token = client_.publish(retained(topic, payload));
      } catch (const mqtt::exception&) {
        good = false;
      }
      sent.emplace_back(topic, token);
    }
    for (const auto& [topic, token] : sent) {
      bool confirmed = false;
      try {
        confirmed = token && good && token->wait_for(CONFIRMATION);
      } catch (const mqtt::exception&) {
        // Not confirmed.
      }
      const std::lock_guard<std::mutex> lock(mutex_);
      if (confirmed) {
        ++published_;
      } else {
        good = false;
        state_.repeat(topic);
      }
    }
    return good;
  }

  void leave() {
    const auto end = std::chrono::steady_clock::now() + FAREWELL;
    while (client_.is_connected() && statistics().waiting > 0 && std::chrono::steady_clock::now() < end &&
           sendBatch()) {
    }
    try {
      if (!client_.is_connected()) return;
      client_.publish(retained(status_, "offline"))->wait_for(FAREWELL);
      client_.disconnect()->wait_for(FAREWELL);
    } catch (const mqtt::exception&) {
      // The broker then publishes the last will.
    }
  }

  MqttOptions options_;
  std::string status_;
  mqtt::async_client client_;
  mqtt::connect_options connection_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  RetainedState state_;
  bool stopping_ = false, connected_ = false;
  std::uint64_t published_ = 0, connections_ = 0;
  std::string problem_;
  std::thread thread_;
};

MqttPublisher::MqttPublisher(const MqttOptions& options) {
  check(options);
  impl_ = std::make_unique<Impl>(options);
}

MqttPublisher::~MqttPublisher() = default;

void MqttPublisher::observe(const Observation& observation) {
  impl_->observe(observation);
}

void MqttPublisher::store(const Asset& asset) {
  impl_->store(asset);
}

MqttStatistics MqttPublisher::statistics() const {
  return impl_->statistics();
}

}  // namespace smartmill::exchange
