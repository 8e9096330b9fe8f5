// Analogue channels of a device of libsigrok.
#include <libsigrok/libsigrok.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstring>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <thread>

#include "smartmill_daq/drivers/driver.h"

namespace smartmill::daq {
namespace {

/// Collects the packets of the session's thread; some devices send each channel in packets of its own.
class PacketQueue {
 public:
  explicit PacketQueue(std::size_t channels) : waiting_(channels) {}

  void add(std::size_t channel, float value) { waiting_[channel].push_back(value); }
  void locked(const std::function<void()>& action) {
    const std::lock_guard<std::mutex> lock(mutex_);
    action();
    changed_.notify_one();
  }
  void end() {
    locked([this] { ended_ = true; });
  }
  bool ended() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return ended_;
  }
  /// Samples that all channels have. @return their number
  std::size_t take(double timeout, std::vector<double>* values) {
    std::unique_lock<std::mutex> lock(mutex_);
    const auto complete = [this] {
      std::size_t least = waiting_.front().size();
      for (const auto& channel : waiting_) least = std::min(least, channel.size());
      return least;
    };
    changed_.wait_for(lock, std::chrono::duration<double>(timeout), [&] { return complete() > 0 || ended_; });
    const std::size_t samples = complete();
    values->resize(samples * waiting_.size());
    for (std::size_t c = 0; c < waiting_.size(); ++c) {
      for (std::size_t i = 0; i < samples; ++i) (*values)[i * waiting_.size() + c] = waiting_[c][i];
      waiting_[c].erase(waiting_[c].begin(), waiting_[c].begin() + static_cast<std::ptrdiff_t>(samples));
    }
    return samples;
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<std::deque<float>> waiting_;  // by channel
  bool ended_ = false;
};

class SigrokDriver : public Driver {
 public:
  explicit SigrokDriver(const DriverSetup& setup) : rate_(setup.instrument.sample_rate) {
    if (!setup.options) throw Error("options: missing, expected the device, a driver of libsigrok");
    device_name_ = setup.options->word("device");
    for (const Channel& channel : setup.channels) inputs_.push_back(channel.input);
  }
  ~SigrokDriver() override { closeAll(); }

  void open() override {
    closeAll();
    queue_ = std::make_unique<PacketQueue>(inputs_.size());
    if (sr_init(&context_) != SR_OK) throw Error("libsigrok does not start");
    sr_dev_inst* const device = findDevice();
    if (const int code = sr_dev_open(device); code != SR_OK)
      throw DeviceLost(device_name_ + ": cannot be opened: " + sr_strerror(code));
    device_ = device;
    chooseChannels();
    if (sr_config_set(device_, nullptr, SR_CONF_SAMPLERATE,
                      g_variant_new_uint64(static_cast<std::uint64_t>(rate_))) != SR_OK)
      throw Error(device_name_ + ": does not take a sample_rate of " + std::to_string(rate_) + " Hz");
    sr_session_new(context_, &session_);
    sr_session_dev_add(session_, device_);
    sr_session_datafeed_callback_add(session_, &SigrokDriver::takePacket, this);
    if (const int code = sr_session_start(session_); code != SR_OK)
      throw DeviceLost(device_name_ + ": does not start: " + sr_strerror(code));
    thread_ = std::thread([this] {
      sr_session_run(session_);
      queue_->end();
    });
  }

  bool read(RawBatch* batch, double timeout) override {
    if (queue_->take(timeout, &batch->values) > 0) return true;
    if (queue_->ended()) throw DeviceLost(device_name_ + ": the device has stopped");
    return false;
  }
  void close() override { closeAll(); }

 private:
  sr_dev_inst* findDevice() {
    for (sr_dev_driver** driver = sr_driver_list(context_); driver && *driver; ++driver) {
      if (device_name_ != (*driver)->name) continue;
      if (sr_driver_init(context_, *driver) != SR_OK)
        throw Error(device_name_ + ": its driver does not start");
      GSList* const found = sr_driver_scan(*driver, nullptr);
      auto* const first = found ? static_cast<sr_dev_inst*>(found->data) : nullptr;
      g_slist_free(found);
      if (!first) throw DeviceLost(device_name_ + ": no device found");
      return first;
    }
    throw Error("options.device: libsigrok has no driver '" + device_name_ + "'");
  }

  void chooseChannels() {
    std::string names;
    channels_.clear();
    for (GSList* item = sr_dev_inst_channels_get(device_); item; item = item->next) {
      auto* const channel = static_cast<sr_channel*>(item->data);
      const auto input = std::find(inputs_.begin(), inputs_.end(), channel->name);
      const bool wanted = channel->type == SR_CHANNEL_ANALOG && input != inputs_.end();
      if (channel->type == SR_CHANNEL_ANALOG)
        names += (names.empty() ? "" : ", ") + std::string(channel->name);
      sr_dev_channel_enable(channel, wanted ? TRUE : FALSE);
      if (wanted) channels_[channel] = static_cast<std::size_t>(input - inputs_.begin());
    }
    if (channels_.size() != inputs_.size())
      throw Error(device_name_ + ": an input is not there, expected of " + names);
  }

  /// In the session's thread.
  static void takePacket(const sr_dev_inst* /*device*/, const sr_datafeed_packet* packet, void* data) {
    auto& self = *static_cast<SigrokDriver*>(data);
    if (packet->type == SR_DF_END) self.queue_->end();
    if (packet->type != SR_DF_ANALOG) return;
    const auto* const analog = static_cast<const sr_datafeed_analog*>(packet->payload);
    const std::size_t channels = g_slist_length(analog->meaning->channels);
    std::vector<float> values(analog->num_samples * channels);
    if (sr_analog_to_float(analog, values.data()) != SR_OK) return;
    self.queue_->locked([&] {
      std::size_t c = 0;
      for (GSList* item = analog->meaning->channels; item; item = item->next, ++c) {
        const auto wanted = self.channels_.find(static_cast<const sr_channel*>(item->data));
        if (wanted == self.channels_.end()) continue;
        for (std::size_t i = 0; i < analog->num_samples; ++i)
          self.queue_->add(wanted->second, values[i * channels + c]);
      }
    });
  }

  void closeAll() {
    if (thread_.joinable()) {
      sr_session_stop(session_);
      thread_.join();
    }
    if (session_) sr_session_destroy(session_);
    if (device_) sr_dev_close(device_);
    if (context_) sr_exit(context_);
    session_ = nullptr;
    device_ = nullptr;
    context_ = nullptr;
  }

  double rate_;
  std::string device_name_;
  std::vector<std::string> inputs_;
  std::map<const sr_channel*, std::size_t> channels_;
  std::unique_ptr<PacketQueue> queue_;
  sr_context* context_ = nullptr;
  sr_dev_inst* device_ = nullptr;
  sr_session* session_ = nullptr;
  std::thread thread_;
};

}  // namespace

DriverKind sigrokDriver() {
  return {"sigrok",
          [](const DriverSetup& setup) { return std::make_unique<SigrokDriver>(setup); },
          {{"device", "driver of libsigrok, for example demo"}}};
}

}  // namespace smartmill::daq
