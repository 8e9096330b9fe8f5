// A sound card, or a source of a PulseAudio server: 24-bit interfaces with IEPE supply and USB.
#include <pulse/pulseaudio.h>

#include <chrono>
#include <cmath>
#include <deque>
#include <memory>
#include <numeric>

#include "smartmill_daq/drivers/driver.h"

namespace smartmill::daq {
namespace {

constexpr double FRAGMENT = 0.005;    // [s] of samples that come together
constexpr double OPEN_TIMEOUT = 2.0;  // [s]
constexpr double BUFFER = 2.0;        // [s] that the server keeps for a computer that is busy
constexpr unsigned MOST_CHANNELS = PA_CHANNELS_MAX;

using Clock = std::chrono::steady_clock;

/// Samples of a fragment that is no multiple of the frames of USB: its arrivals then scan them (docs/daq.md).
std::size_t fragmentOf(double sample_rate) {
  const auto frame = static_cast<std::size_t>(std::lround(sample_rate / 1000.0));
  auto samples = static_cast<std::size_t>(std::lround(FRAGMENT * sample_rate)) + 1;
  while (std::gcd(samples, std::max<std::size_t>(frame, 1)) != 1) ++samples;
  return samples;
}

class SoundDriver : public Driver {
 public:
  explicit SoundDriver(const DriverSetup& setup)
      : inputs_(inputNumbers(setup.channels, MOST_CHANNELS)),
        rate_(setup.instrument.sample_rate),
        fragment_(fragmentOf(rate_)) {
    if (rate_ != std::floor(rate_) || rate_ > PA_RATE_MAX)
      throw Error("sample_rate: " + std::to_string(rate_) +
                  ", expected an integer up to 384000 of a sound card");
    if (!setup.options) throw Error("options: missing, expected source and channels of the sound card");
    source_ = setup.options->word("source");
    channels_ = static_cast<std::size_t>(setup.options->integer("channels", 1, MOST_CHANNELS));
    if (setup.options->has("server")) server_ = setup.options->word("server");
    inputNumbers(setup.channels, channels_);
  }
  ~SoundDriver() override { closeAll(); }

  void open() override {
    closeAll();
    deadline_ = Clock::now() + std::chrono::milliseconds(static_cast<int>(1e3 * OPEN_TIMEOUT));
    loop_ = pa_mainloop_new();
    context_ = pa_context_new(pa_mainloop_get_api(loop_), "smartmill");
    if (pa_context_connect(context_, server_.empty() ? nullptr : server_.c_str(), PA_CONTEXT_NOAUTOSPAWN,
                           nullptr) < 0)
      lose("no sound server");
    while (pa_context_get_state(context_) != PA_CONTEXT_READY) {
      if (!PA_CONTEXT_IS_GOOD(pa_context_get_state(context_))) lose("no sound server");
      iterateUntilDeadline();
    }
    checkSource();
    connectStream();
  }

  bool read(RawBatch* batch, double timeout) override {
    if (!readPiece(batch)) {
      const auto end =
          Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(timeout));
      do {
        iterate(std::chrono::duration<double>(end - Clock::now()).count());
        if (pa_stream_get_state(stream_) != PA_STREAM_READY) lose("the source is gone");
      } while (pa_stream_readable_size(stream_) == 0 && Clock::now() < end);
      if (!readPiece(batch)) return false;
    }
    return true;
  }
  void close() override { closeAll(); }
  bool shareOfRange() const override { return true; }

 private:
  struct SourceInfo {
    bool found = false, done = false;
    unsigned rate = 0, channels = 0;
  };

  [[noreturn]] void lose(const std::string& what) const {
    const int error = context_ ? pa_context_errno(context_) : 0;
    throw DeviceLost("source " + source_ + ": " + what +
                     (error ? std::string(", ") + pa_strerror(error) : ""));
  }

  void iterate(double seconds) {
    constexpr double MICROSECONDS = 1e6;
    if (pa_mainloop_prepare(loop_, static_cast<int>(MICROSECONDS * std::max(0.0, seconds))) < 0 ||
        pa_mainloop_poll(loop_) < 0 || pa_mainloop_dispatch(loop_) < 0)
      lose("connection to the sound server ended");
  }
  void iterateUntilDeadline() {
    if (Clock::now() > deadline_) lose("no answer of the sound server");
    iterate(0.05);
  }

  /// A server that resamples would hide the converter's clock.
  void checkSource() {
    SourceInfo info;
    pa_operation* operation = pa_context_get_source_info_by_name(
        context_, source_.c_str(),
        [](pa_context*, const pa_source_info* source, int end, void* to) {
          auto& result = *static_cast<SourceInfo*>(to);
          if (source) {
            result.found = true;
            result.rate = source->sample_spec.rate;
            result.channels = source->sample_spec.channels;
          }
          if (end != 0) result.done = true;
        },
        &info);
    while (!info.done) iterateUntilDeadline();
    pa_operation_unref(operation);
    if (!info.found) lose("not there");
    if (info.rate != static_cast<unsigned>(rate_))
      throw Error("source " + source_ + ": runs at " + std::to_string(info.rate) + " Hz, sample_rate " +
                  std::to_string(static_cast<unsigned>(rate_)) +
                  " expected; set default-sample-rate of the sound server or sample_rate");
    if (info.channels != channels_)
      throw Error("source " + source_ + ": has " + std::to_string(info.channels) +
                  " channels, options.channels " + std::to_string(channels_) + " expected");
  }

  void connectStream() {
    pa_sample_spec spec{};
    spec.format = PA_SAMPLE_FLOAT32NE;  // 24 bit fit
    spec.rate = static_cast<std::uint32_t>(rate_);
    spec.channels = static_cast<std::uint8_t>(channels_);
    pa_channel_map map;
    pa_channel_map_init_extend(&map, spec.channels, PA_CHANNEL_MAP_AUX);
    stream_ = pa_stream_new(context_, "instrument", &spec, &map);
    if (!stream_) lose("no stream");
    pa_stream_set_overflow_callback(
        stream_, [](pa_stream*, void* self) { static_cast<SoundDriver*>(self)->overrun_ = true; }, this);
    pa_buffer_attr attributes{};
    const auto bytes = static_cast<std::uint32_t>(fragment_ * channels_ * sizeof(float));
    attributes.maxlength =
        static_cast<std::uint32_t>(BUFFER * rate_) * static_cast<std::uint32_t>(channels_ * sizeof(float));
    attributes.fragsize = bytes;
    // The channels as they are, of this source only, without a volume.
    const int flags = PA_STREAM_ADJUST_LATENCY | PA_STREAM_DONT_MOVE | PA_STREAM_NO_REMAP_CHANNELS |
                      PA_STREAM_NO_REMIX_CHANNELS;
    if (pa_stream_connect_record(stream_, source_.c_str(), &attributes,
                                 static_cast<pa_stream_flags_t>(flags)) < 0)
      lose("no stream");
    while (pa_stream_get_state(stream_) != PA_STREAM_READY) {
      if (!PA_STREAM_IS_GOOD(pa_stream_get_state(stream_))) lose("no stream");
      iterateUntilDeadline();
    }
  }

  bool readPiece(RawBatch* batch) {
    bool any = false;
    while (pa_stream_readable_size(stream_) > 0) {
      const void* data = nullptr;
      std::size_t bytes = 0;
      if (pa_stream_peek(stream_, &data, &bytes) < 0) lose("cannot be read");
      if (bytes == 0) break;
      const std::size_t samples = bytes / (channels_ * sizeof(float));
      if (!data) {
        // A hole: the server knows how much is missing. What came before it is passed on first.
        if (any) return true;
        batch->lost += samples;
      } else {
        const float* value = static_cast<const float*>(data);
        for (std::size_t i = 0; i < samples; ++i, value += channels_) {
          for (const std::size_t input : inputs_) batch->values.push_back(value[input]);
        }
        any = true;
      }
      pa_stream_drop(stream_);
    }
    if (any && overrun_) batch->interrupted = true;
    if (any) overrun_ = false;
    return any;
  }

  void closeAll() {
    if (stream_) {
      pa_stream_disconnect(stream_);
      pa_stream_unref(stream_);
    }
    if (context_) {
      pa_context_disconnect(context_);
      pa_context_unref(context_);
    }
    if (loop_) pa_mainloop_free(loop_);
    stream_ = nullptr;
    context_ = nullptr;
    loop_ = nullptr;
    overrun_ = false;
  }

  std::vector<std::size_t> inputs_;
  double rate_;
  std::size_t fragment_, channels_ = 0;
  std::string source_, server_;
  Clock::time_point deadline_;
  pa_mainloop* loop_ = nullptr;
  pa_context* context_ = nullptr;
  pa_stream* stream_ = nullptr;
  bool overrun_ = false;
};

}  // namespace

DriverKind soundDriver() {
  return {"sound",
          [](const DriverSetup& setup) { return std::make_unique<SoundDriver>(setup); },
          {{"source", "name of the source, see pactl list short sources"},
           {"channels", "number of channels of the source"},
           {"server", "sound server; default: that of the user"}}};
}

}  // namespace smartmill::daq
