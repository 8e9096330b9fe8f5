#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <deque>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "smartmill_focas/server.h"

namespace smartmill::cnc {

/// A minimal simulated machine: runs the dialect at constant speeds in time steps of the test.
class TestMachine : public focas::StateInterface,
                    public focas::AxesInterface,
                    public focas::MacroInterface,
                    public focas::DataInterface,
                    public focas::ProgramsInterface,
                    public focas::DncInterface {
 public:
  focas::SysInfo info;
  focas::Status state;
  std::array<double, 3> position{{0, 0, 0}}, offset{{0, 0, 0}};  // [mm]; absolute = machine - offset
  double speed = 0.0, load = 12.34;                              // [rpm], [percent]
  std::uint32_t alarm_bits = 0;
  std::vector<focas::AlarmMessage> alarms;
  std::size_t buffer_size = 512;  // [byte]
  bool reset_works = true;
  std::string all_text;
  int starts = 0, ends = 0, cancels = 0, disconnects = 0, resets = 0;
  focas::EwCode refuse_start = focas::EW_OK;
  std::map<int, double> macros;
  std::map<int, int> data_table;                   ///< of the PMC
  std::vector<focas::NumberedValue> temperatures;  ///< diagnosis numbers

  TestMachine() { state.aut = focas::AUT_REMOTE; }
  focas::ControllerInterface calls() { return {*this, *this, *this, *this, *this, *this}; }

  template <class F>
  void change(F&& f) {
    const std::lock_guard<std::mutex> lock(mutex_);
    f(*this);
  }
  template <class T>
  T get(const T& value) const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return value;
  }

  /// The RESET key of the panel.
  void resetKey() {
    const std::lock_guard<std::mutex> lock(mutex_);
    halt();
    if (session_) {
      session_ = false;
      abort_ = focas::EW_RESET;
    }
  }

  /// Runs the machine for dt [s].
  void advance(double dt) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (alarm_bits != 0) {
      halt();
      return;
    }
    while (dt > 0.0) {
      if (!moving_ && dwell_ <= 0.0 && !nextBlock()) {
        break;
      }
      if (dwell_ > 0.0) {
        const double part = std::min(dt, dwell_);
        dwell_ -= part;
        dt -= part;
      } else if (moving_) {
        dt = moveOn(dt);
      }
    }
    state.motion = moving_ ? focas::MOTION_MOVES : dwell_ > 0.0 ? focas::MOTION_DWELL : focas::MOTION_NONE;
    state.run = session_ || !text_.empty() || moving_ ? focas::RUN_START : focas::RUN_RESET;
  }

  focas::SysInfo sysInfo() const override { return info; }
  focas::Status status() const override { return get(state); }
  std::vector<double> machinePosition() const override {
    const std::lock_guard<std::mutex> lock(mutex_);
    return {position.begin(), position.end()};
  }
  std::vector<double> absolutePosition() const override {
    const std::lock_guard<std::mutex> lock(mutex_);
    return {position[0] - offset[0], position[1] - offset[1], position[2] - offset[2]};
  }
  std::vector<double> relativePosition() const override { return absolutePosition(); }
  std::vector<double> distanceToGo() const override {
    const std::lock_guard<std::mutex> lock(mutex_);
    std::vector<double> left(3, 0.0);
    for (std::size_t i = 0; moving_ && i < 3; ++i) {
      left[i] = target_[i] - position[i];
    }
    return left;
  }
  double actualFeed() const override { return get(moving_) ? get(feed_) : 0.0; }
  std::vector<double> spindleSpeed() const override { return {get(speed)}; }
  std::vector<double> spindleLoad() const override { return {get(load)}; }
  std::vector<double> spindleMaxSpeed() const override { return {12000.0}; }
  std::vector<double> servoLoad() const override { return {1.5, 2.5, 3.5}; }
  focas::EwCode readMacro(int number, std::optional<double>* value) const override {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto found = macros.find(number);
    if (found != macros.end()) {
      *value = found->second;
    }
    return number > 9999 ? focas::EW_NUMBER : focas::EW_OK;
  }
  focas::EwCode writePmc(focas::PmcArea area, int first, const focas::Bytes& bytes) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (area != focas::PmcArea::d) {
      return focas::EW_NUMBER;
    }
    for (std::size_t i = 0; i < bytes.size(); ++i) {
      data_table[first + static_cast<int>(i)] = bytes[i];
    }
    return focas::EW_OK;
  }
  focas::EwCode writeMacro(int number, std::optional<double> value) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (number > 9999) {
      return focas::EW_NUMBER;
    }
    macros[number] = value.value_or(0.0);
    return focas::EW_OK;
  }
  std::vector<focas::NumberedValue> diagnoses(int first, int last) const override {
    const std::lock_guard<std::mutex> lock(mutex_);
    std::vector<focas::NumberedValue> found;
    for (const focas::NumberedValue& value : temperatures) {
      if (value.number >= first && value.number <= last) {
        found.push_back(value);
      }
    }
    return found;
  }
  std::uint32_t alarmBits() const override { return get(alarm_bits); }
  std::vector<focas::AlarmMessage> alarmMessages() const override { return get(alarms); }
  int runningProgram() const override { return 7; }
  int mainProgram() const override { return 7; }
  int sequenceNumber() const override { return get(sequence_); }
  int blockCount() const override { return 0; }
  std::string programPath() const override { return ""; }
  std::string executingBlock() const override { return ""; }
  focas::EwCode reset() override {
    if (!get(reset_works)) {
      return focas::EW_FUNC;
    }
    resetKey();
    change([](TestMachine& m) { ++m.resets; });
    return focas::EW_OK;
  }
  focas::EwCode dncStart() override {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (refuse_start != focas::EW_OK) {
      return refuse_start;
    }
    if (state.aut != focas::AUT_REMOTE) {
      return focas::EW_MODE;
    }
    session_ = true;
    abort_ = focas::EW_OK;
    ++starts;
    return focas::EW_OK;
  }
  std::size_t dncData(const char* data, std::size_t size) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    const std::size_t taken = std::min(size, buffer_size - std::min(buffer_size, text_.size()));
    text_.append(data, taken);
    all_text.append(data, taken);
    return taken;
  }
  focas::EwCode dncEnd() override {
    const std::lock_guard<std::mutex> lock(mutex_);
    session_ = false;
    ++ends;
    return focas::EW_OK;
  }
  void dncCancel(int) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    ++cancels;
    session_ = false;
    halt();
  }
  void dncDisconnected() override {
    const std::lock_guard<std::mutex> lock(mutex_);
    ++disconnects;
    session_ = false;
    halt();
  }
  focas::EwCode dncAbort() override { return get(abort_); }
  /// Whether a program is being sent.
  bool streaming() const { return get(session_); }

 private:
  void halt() {
    text_.clear();
    moving_ = false;
    dwell_ = 0.0;
    speed = 0.0;
    state.motion = focas::MOTION_NONE;
  }

  bool nextBlock() {
    const std::size_t end = text_.find('\n');
    if (end == std::string::npos) {
      return false;
    }
    const std::string line = text_.substr(0, end);
    text_.erase(0, end + 1);
    if (!line.empty() && line[0] == '#') {
      macros[std::atoi(line.c_str() + 1)] = std::atof(line.c_str() + line.find('=') + 1);
      return true;
    }
    target_ = position;
    bool dwell = false;
    const char* p = line.c_str();
    while (*p != '\0') {
      const char letter = *p++;
      if (letter == ' ' || letter == '%') {
        continue;
      }
      char* after = nullptr;
      const double value = std::strtod(p, &after);
      p = after;
      word(letter, value, dwell);
    }
    moving_ = target_ != position;
    return true;
  }

  void word(char letter, double value, bool& dwell) {
    const int code = static_cast<int>(value);
    if (letter == 'N') {
      sequence_ = code;
    } else if (letter == 'G') {
      dwell = dwell || code == 4;
      rapid_ = code == 0 ? true : code == 1 ? false : rapid_;
      relative_ = code == 91 ? true : code == 90 ? false : relative_;
    } else if (dwell && (letter == 'X' || letter == 'P')) {
      dwell_ = letter == 'P' ? value * 1e-3 : value;
    } else if (letter >= 'X' && letter <= 'Z') {
      const std::size_t axis = static_cast<std::size_t>(letter - 'X');
      target_[axis] = relative_ ? position[axis] + value : value + offset[axis];
    } else if (letter == 'F') {
      feed_ = value;
    } else if (letter == 'S') {
      commanded_ = value;
    } else if (letter == 'M') {
      speed = code == 3 ? commanded_ : 0.0;
    }
  }

  double moveOn(double dt) {
    double length = 0.0;
    for (std::size_t i = 0; i < 3; ++i) {
      length = std::hypot(length, target_[i] - position[i]);
    }
    const double rate = (rapid_ ? 30000.0 : feed_) / 60.0;  // [mm/s]
    if (rate * dt >= length) {
      position = target_;
      moving_ = false;
      return dt - length / rate;
    }
    for (std::size_t i = 0; i < 3; ++i) {
      position[i] += (target_[i] - position[i]) * rate * dt / length;
    }
    return 0.0;
  }

  mutable std::mutex mutex_;
  std::string text_;
  bool session_ = false, moving_ = false, relative_ = false, rapid_ = true;
  double dwell_ = 0.0, feed_ = 1.0, commanded_ = 0.0;
  int sequence_ = 0;
  std::array<double, 3> target_{{0, 0, 0}};
  focas::EwCode abort_ = focas::EW_OK;
};

}  // namespace smartmill::cnc
