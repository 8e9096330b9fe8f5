// A converter of the Linux subsystem for industrial I/O, local or through iiod (libiio).
#include <iio.h>
#include <poll.h>

#include <cerrno>
#include <cmath>
#include <cstring>
#include <memory>

#include "smartmill_daq/drivers/driver.h"

namespace smartmill::daq {
namespace {

constexpr double FRAGMENT = 0.005;  // [s] of samples that come together
constexpr double MILLIVOLT = 1e-3;  // [V] the unit of scale in the kernel's interface (sysfs-bus-iio)

class IioDriver : public Driver {
 public:
  explicit IioDriver(const DriverSetup& setup)
      : rate_(setup.instrument.sample_rate),
        fragment_(static_cast<std::size_t>(std::ceil(FRAGMENT * rate_))) {
    if (!setup.options) throw Error("options: missing, expected uri and device");
    uri_ = setup.options->word("uri");
    device_name_ = setup.options->word("device");
    for (const Channel& channel : setup.channels) inputs_.push_back(channel.input);
  }
  ~IioDriver() override { closeAll(); }

  void open() override {
    closeAll();
    context_ = iio_create_context_from_uri(uri_.c_str());
    if (!context_) throw DeviceLost(uri_ + ": " + std::strerror(errno));
    iio_device* const device = iio_context_find_device(context_, device_name_.c_str());
    if (!device) throw DeviceLost(uri_ + ": no device " + device_name_);
    double rate = rate_;
    // Where the rate cannot be set, it has to be the described one.
    iio_device_attr_write_double(device, "sampling_frequency", rate_);
    if (iio_device_attr_read_double(device, "sampling_frequency", &rate) == 0 && rate > 0.0)
      stated_rate_ = rate;
    for (const std::string& input : inputs_) {
      iio_channel* const channel = iio_device_find_channel(device, input.c_str(), false);
      if (!channel || !iio_channel_is_scan_element(channel))
        throw Error(uri_ + ": " + device_name_ + " has no input " + input + " that is sampled");
      double scale = 1.0, offset = 0.0;
      if (iio_channel_attr_read_double(channel, "scale", &scale) != 0) scale = 1.0;
      if (iio_channel_attr_read_double(channel, "offset", &offset) != 0) offset = 0.0;
      iio_channel_enable(channel);
      channels_.push_back({channel, MILLIVOLT * scale, offset});
    }
    buffer_ = iio_device_create_buffer(device, fragment_, false);
    if (!buffer_) throw DeviceLost(uri_ + ": " + device_name_ + ": no buffer: " + std::strerror(errno));
  }

  bool read(RawBatch* batch, double timeout) override {
    if (const int descriptor = iio_buffer_get_poll_fd(buffer_); descriptor >= 0) {  // of local devices only
      pollfd wait{descriptor, POLLIN, 0};
      if (::poll(&wait, 1, static_cast<int>(1e3 * timeout)) <= 0) return false;
    }
    const ssize_t bytes = iio_buffer_refill(buffer_);
    if (bytes == -EAGAIN || bytes == -ETIMEDOUT) return false;
    if (bytes < 0) throw DeviceLost(uri_ + ": " + std::strerror(static_cast<int>(-bytes)));
    const ptrdiff_t step = iio_buffer_step(buffer_);
    if (step <= 0) throw MalformedData(uri_ + ": " + device_name_ + ": samples of no length");
    const auto* const end = static_cast<const char*>(iio_buffer_end(buffer_));
    const std::size_t inputs = channels_.size();
    for (std::size_t c = 0; c < inputs; ++c) {
      const ScaledChannel& scaled = channels_[c];
      std::size_t i = c;
      for (const char* at = static_cast<const char*>(iio_buffer_first(buffer_, scaled.channel)); at < end;
           at += step, i += inputs) {
        std::int64_t value = 0;
        convert(scaled.channel, at, &value);
        if (i >= batch->values.size()) batch->values.resize(i + inputs - c);
        batch->values[i] = scaled.scale * (static_cast<double>(value) + scaled.offset);
      }
    }
    batch->sample_rate = stated_rate_;
    return !batch->values.empty();
  }
  void close() override { closeAll(); }

 private:
  struct ScaledChannel {
    iio_channel* channel;
    double scale;   // [V]
    double offset;  // in codes, added before scaling
  };

  /// The code of a sample with its sign.
  static void convert(const iio_channel* channel, const char* from, std::int64_t* value) {
    const iio_data_format& format = *iio_channel_get_data_format(channel);
    switch (format.length) {
      case 8:
        *value = converted<std::int8_t, std::uint8_t>(channel, from, format.is_signed);
        break;
      case 16:
        *value = converted<std::int16_t, std::uint16_t>(channel, from, format.is_signed);
        break;
      case 32:
        *value = converted<std::int32_t, std::uint32_t>(channel, from, format.is_signed);
        break;
      default:
        *value = converted<std::int64_t, std::uint64_t>(channel, from, format.is_signed);
        break;
    }
  }
  template <class Signed, class Unsigned>
  static std::int64_t converted(const iio_channel* channel, const char* from, bool is_signed) {
    Signed value = 0;
    iio_channel_convert(channel, &value, from);
    return is_signed ? static_cast<std::int64_t>(value)
                     : static_cast<std::int64_t>(static_cast<Unsigned>(value));
  }

  void closeAll() {
    if (buffer_) iio_buffer_destroy(buffer_);
    if (context_) iio_context_destroy(context_);
    buffer_ = nullptr;
    context_ = nullptr;
    channels_.clear();
    stated_rate_.reset();
  }

  double rate_;
  std::size_t fragment_;
  std::string uri_, device_name_;
  std::vector<std::string> inputs_;
  std::vector<ScaledChannel> channels_;
  std::optional<double> stated_rate_;
  iio_context* context_ = nullptr;
  iio_buffer* buffer_ = nullptr;
};

}  // namespace

DriverKind iioDriver() {
  return {"iio",
          [](const DriverSetup& setup) { return std::make_unique<IioDriver>(setup); },
          {{"uri", "context, for example local: or ip:192.168.2.1"}, {"device", "name of the converter"}}};
}

}  // namespace smartmill::daq
