#pragma once

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_cnc/controller/controller.h"

namespace smartmill::cnc {

/// A controller without a connection whose replies a test sets.
class ScriptedController : public Controller {
 public:
  Reading reading;  ///< of the next read()
  std::optional<Failure> connecting, opening, checking, sending, closing, writing, aborting;
  bool is_connected = false, is_open = false;
  std::size_t taken_at_once = 1000;  ///< [byte] of a program by one send()
  std::string program;               ///< last begun
  std::vector<std::string> calls;    ///< in order, without read()

  ScriptedController() {
    reading.state.axes = {"X", "Y", "Z"};
    reading.state.position = reading.state.distance_to_go = reading.absolute = {0.0, 0.0, 0.0};
    reading.state.mode = CncMode::dnc;
  }

  std::string name() const override { return "scripted controller"; }
  Result<std::string> connect() override {
    calls.push_back("connect");
    if (connecting) {
      return *connecting;
    }
    is_connected = true;
    return std::string("type S");
  }
  bool connected() const override { return is_connected; }
  void close() override {
    calls.push_back("close");
    is_connected = false;
  }
  Result<Reading> read() override {
    if (!is_connected) {
      return Failure{Failure::Kind::lost, "no wire"};
    }
    return reading;
  }
  Status setVariable(int, double) override { return resultOf(writing); }
  DialectOptions dialect() const override { return {}; }
  std::string orientProgram(double) const override { return "M119\n"; }
  Status openPrograms() override {
    calls.push_back("open");
    is_open = !opening;
    return resultOf(opening);
  }
  bool programsOpen() const override { return is_open; }
  Status checkPrograms() override {
    is_open = is_open && !checking;
    return resultOf(checking);
  }
  Status closePrograms() override {
    calls.push_back("close programs");
    is_open = false;
    return resultOf(closing);
  }
  Status abandonPrograms() override {
    calls.push_back("abandon");
    is_open = false;
    return resultOf(aborting);
  }
  void begin(const std::string& text) override {
    calls.push_back("begin");
    program = text;
    sent_ = 0;
  }
  Status send() override {
    calls.push_back("send");
    is_open = is_open && !sending;
    if (!sending) {
      sent_ = std::min(program.size(), sent_ + taken_at_once);
    }
    return resultOf(sending);
  }
  Transfer transfer() const override { return {sent_, program.size(), sent_ == program.size()}; }
  Status abort() override {
    calls.push_back("abort");
    is_open = false;
    return resultOf(aborting);
  }

  std::size_t count(const std::string& call) const {
    return static_cast<std::size_t>(std::count(calls.begin(), calls.end(), call));
  }

 private:
  Status resultOf(const std::optional<Failure>& failure) {
    if (failure && failure->kind == Failure::Kind::lost) {
      is_connected = is_open = false;
    }
    return failure ? Status(*failure) : Status();
  }

  std::size_t sent_ = 0;
};

}  // namespace smartmill::cnc
