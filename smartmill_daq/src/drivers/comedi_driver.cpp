// A data acquisition card of Linux's comedi: streaming command of one scan per sample.
#include <comedilib.h>
#include <poll.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <memory>

#include "smartmill_daq/drivers/driver.h"

namespace smartmill::daq {
namespace {

constexpr double NANOSECONDS = 1e9;  // in a second
constexpr int TESTS = 4;             // of a command that comedi corrects: its documentation requires two

class ComediDriver : public Driver {
 public:
  explicit ComediDriver(const DriverSetup& setup)
      : rate_(setup.instrument.sample_rate),
        channels_(setup.channels),
        inputs_(inputNumbers(setup.channels, 1024)) {
    if (!setup.options) throw Error("options: missing, expected the device file");
    file_ = setup.options->word("device");
    const std::string reference = setup.options->has("reference")
                                      ? setup.options->oneOf("reference", {"ground", "differential"})
                                      : "ground";
    reference_ = reference == "differential" ? AREF_DIFF : AREF_GROUND;
  }
  ~ComediDriver() override { closeAll(); }

  void open() override {
    closeAll();
    device_ = comedi_open(file_.c_str());
    if (!device_) throw DeviceLost(file_ + ": " + comedi_strerror(comedi_errno()));
    comedi_set_global_oor_behavior(
        COMEDI_OOR_NUMBER);  // codes at the ends stay numbers, BlockMaker marks them
    const int found = comedi_find_subdevice_by_type(device_, COMEDI_SUBD_AI, 0);
    if (found < 0) throw Error(file_ + ": has no analogue inputs");
    subdevice_ = static_cast<unsigned>(found);
    wide_ = (comedi_get_subdevice_flags(device_, subdevice_) & SDF_LSAMPL) != 0;
    chooseRanges();
    startCommand();
  }

  bool read(RawBatch* batch, double timeout) override {
    pollfd wait{comedi_fileno(device_), POLLIN, 0};
    if (::poll(&wait, 1, static_cast<int>(1e3 * timeout)) <= 0) return false;
    std::array<char, 1U << 16U> buffer;  // NOLINT(cppcoreguidelines-pro-type-member-init): read fills it
    const ssize_t got = ::read(comedi_fileno(device_), buffer.data(), buffer.size());
    if (got < 0 && (errno == EAGAIN || errno == EINTR)) return false;
    // The kernel ends a command whose buffer has run over.
    if (got < 0 && errno == EPIPE) throw DeviceLost(file_ + ": overrun, the computer has read too late");
    if (got <= 0) throw DeviceLost(file_ + ": " + (got < 0 ? std::strerror(errno) : "the command has ended"));
    bytes_.append(buffer.data(), static_cast<std::size_t>(got));
    const std::size_t width = wide_ ? sizeof(lsampl_t) : sizeof(sampl_t);
    const std::size_t scan = width * inputs_.size(), scans = bytes_.size() / scan;
    batch->values.reserve(scans * inputs_.size());
    for (std::size_t i = 0; i < scans * inputs_.size(); ++i) {
      const InputRange& range = ranges_[i % inputs_.size()];
      batch->values.push_back(comedi_to_phys(code(bytes_.data() + i * width), range.range, range.largest));
    }
    bytes_.erase(0, scans * scan);
    batch->sample_rate = stated_rate_;
    return scans > 0;
  }
  void close() override { closeAll(); }

 private:
  struct InputRange {
    comedi_range* range;
    lsampl_t largest;
  };

  lsampl_t code(const char* from) const {
    if (wide_) {
      lsampl_t value = 0;
      std::memcpy(&value, from, sizeof value);
      return value;
    }
    sampl_t value = 0;
    std::memcpy(&value, from, sizeof value);
    return value;
  }

  void chooseRanges() {
    const int there = comedi_get_n_channels(device_, subdevice_);
    ranges_.clear();
    list_.clear();
    for (std::size_t c = 0; c < inputs_.size(); ++c) {
      const auto number = static_cast<unsigned>(inputs_[c]);
      if (static_cast<int>(number) >= there)
        throw Error(file_ + ": has " + std::to_string(there) + " inputs, input " + channels_[c].input +
                    " expected");
      const double volts = channels_[c].range;
      const int range = comedi_find_range(device_, subdevice_, number, UNIT_volt, -volts, volts);
      if (range < 0)
        throw Error(file_ + ": input " + channels_[c].input + " has no range of " + std::to_string(volts) +
                    " V");
      const auto chosen = static_cast<unsigned>(range);
      ranges_.push_back({comedi_get_range(device_, subdevice_, number, chosen),
                         comedi_get_maxdata(device_, subdevice_, number)});
      list_.push_back(CR_PACK(number, chosen, reference_));
    }
  }

  void startCommand() {
    comedi_cmd command{};
    const auto period = static_cast<unsigned>(std::lround(NANOSECONDS / rate_));
    if (comedi_get_cmd_generic_timed(device_, subdevice_, &command, static_cast<unsigned>(inputs_.size()),
                                     period) < 0)
      throw Error(file_ + ": its inputs have no streaming command");
    command.chanlist = list_.data();
    command.chanlist_len = static_cast<unsigned>(list_.size());
    command.scan_end_arg = command.chanlist_len;
    command.stop_src = TRIG_NONE;
    command.stop_arg = 0;
    int result = 1;
    for (int i = 0; i < TESTS && result > 0; ++i) result = comedi_command_test(device_, &command);
    if (result != 0) throw Error(file_ + ": the card refuses the command, test " + std::to_string(result));
    if (command.scan_begin_src == TRIG_TIMER && command.scan_begin_arg > 0)
      stated_rate_ = NANOSECONDS / command.scan_begin_arg;
    if (comedi_command(device_, &command) < 0)
      throw DeviceLost(file_ + ": " + comedi_strerror(comedi_errno()));
  }

  void closeAll() {
    if (device_) {
      comedi_cancel(device_, subdevice_);
      comedi_close(device_);
    }
    device_ = nullptr;
    bytes_.clear();
    stated_rate_.reset();
  }

  double rate_;
  std::vector<Channel> channels_;
  std::vector<std::size_t> inputs_;
  std::string file_, bytes_;
  unsigned reference_ = AREF_GROUND, subdevice_ = 0;
  bool wide_ = false;
  std::vector<InputRange> ranges_;
  std::vector<unsigned> list_;
  std::optional<double> stated_rate_;
  comedi_t* device_ = nullptr;
};

}  // namespace

DriverKind comediDriver() {
  return {"comedi",
          [](const DriverSetup& setup) { return std::make_unique<ComediDriver>(setup); },
          {{"device", "file of the card, for example /dev/comedi0"},
           {"reference", "ground (default) or differential"}}};
}

}  // namespace smartmill::daq
