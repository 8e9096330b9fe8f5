#pragma once

#include <algorithm>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "smartmill_focas/server.h"

namespace smartmill::focas {

/// A controller with settable values and a DNC buffer that is emptied by the test only.
class TestController : public StateInterface,
                       public AxesInterface,
                       public MacroInterface,
                       public DataInterface,
                       public ProgramsInterface,
                       public DncInterface {
 public:
  ControllerInterface calls() { return {*this, *this, *this, *this, *this, *this}; }

  mutable std::mutex mutex;
  SysInfo info;
  Status state;
  std::vector<double> machine{-1.5, 2.25, 300.125}, absolute{10.5, -20.25, 30.0}, relative{1.0, 2.0, 3.0},
      distance{0.0, 0.001, -4.5};
  double feed = 1234.0;
  std::vector<double> speed{5000.0}, load{12.34}, servo{5.5, 6.25, -7.75};
  std::map<int, std::optional<double>> macros{
      {100, std::nullopt}, {500, 2.5}, {501, std::nullopt}, {502, -7.0}};
  std::uint32_t alarm_bits = 0;
  DateTime clock{2026, 5, 14, 13, 37, 59};
  Bytes pmc = Bytes(200, 0);
  std::string stored;  ///< last download
  std::vector<AlarmMessage> alarms;
  bool session = false;
  std::size_t free_space = 1 << 30;  ///< [byte] of the buffer
  std::string text;                  ///< all accepted text
  int starts = 0, ends = 0, cancels = 0, disconnects = 0, cancel_result = 0;
  EwCode abort_code = EW_OK;
  EwCode refuse_start = EW_OK;

  SysInfo sysInfo() const override { return info; }
  Status status() const override { return locked(state); }
  std::vector<double> machinePosition() const override { return locked(machine); }
  std::vector<double> absolutePosition() const override { return locked(absolute); }
  std::vector<double> relativePosition() const override { return locked(relative); }
  std::vector<double> distanceToGo() const override { return locked(distance); }
  double actualFeed() const override { return locked(feed); }
  std::vector<double> spindleSpeed() const override { return locked(speed); }
  std::vector<double> spindleLoad() const override { return locked(load); }
  std::vector<double> spindleMaxSpeed() const override { return {12000.0}; }
  std::vector<double> servoLoad() const override { return locked(servo); }
  EwCode readMacro(int number, std::optional<double>* value) const override {
    const std::lock_guard<std::mutex> lock(mutex);
    const auto found = macros.find(number);
    if (found == macros.end()) {
      return EW_NUMBER;
    }
    *value = found->second;
    return EW_OK;
  }
  EwCode writeMacro(int number, std::optional<double> value) override {
    const std::lock_guard<std::mutex> lock(mutex);
    if (macros.count(number) == 0) {
      return EW_NUMBER;
    }
    macros[number] = value;
    return EW_OK;
  }
  std::uint32_t alarmBits() const override { return locked(alarm_bits); }
  std::vector<AlarmMessage> alarmMessages() const override { return locked(alarms); }
  int runningProgram() const override { return 1234; }
  int mainProgram() const override { return 4321; }
  int sequenceNumber() const override { return 77; }
  int blockCount() const override { return 88; }
  std::string programPath() const override { return "//CNC_MEM/USER/O4321"; }
  std::string executingBlock() const override { return "N77 G1 X10 F600"; }
  std::vector<double> servoCurrent() const override { return {1.5, -0.25, 0.0}; }
  std::vector<NumberedValue> parameters(int first, int last) const override {
    return between({{1020, NumberedType::byte, {88, 89, 90}, true, 0},
                    {1320, NumberedType::real, {250.0, 200.5, -0.001}, true, 3},
                    {3741, NumberedType::double_word, {20000.0}, false, 0}},
                   first, last);
  }
  std::vector<NumberedValue> diagnoses(int first, int last) const override {
    return between({{308, NumberedType::byte, {28, 28, 44}, true, 0}}, first, last);
  }
  std::optional<DateTime> dateTime() const override { return locked(clock); }
  EwCode setDateTime(const DateTime& at) override {
    const std::lock_guard<std::mutex> lock(mutex);
    clock = at;
    return EW_OK;
  }
  EwCode readPmc(PmcArea area, int first, int last, Bytes* bytes) const override {
    if (area != PmcArea::d || last >= 200) {
      return EW_NUMBER;
    }
    const std::lock_guard<std::mutex> lock(mutex);
    bytes->assign(pmc.begin() + first, pmc.begin() + last + 1);
    return EW_OK;
  }
  EwCode writePmc(PmcArea, int first, const Bytes& bytes) override {
    const std::lock_guard<std::mutex> lock(mutex);
    std::copy(bytes.begin(), bytes.end(), pmc.begin() + first);
    return EW_OK;
  }
  std::vector<StoredProgram> programs() const override {
    return {{1, "O0001", "(PARK)", 40, {2026, 5, 14, 8, 30, 1}}, {1234, "O1234", "(SLOT)", 100, {}}};
  }
  EwCode selectProgram(int number) override { return number == 1234 ? EW_OK : EW_DATA; }
  EwCode deleteProgram(int number) override { return number == 1234 ? EW_OK : EW_DATA; }
  EwCode rewindProgram() override { return EW_OK; }
  EwCode storePrograms(const std::string& program) override {
    const std::lock_guard<std::mutex> lock(mutex);
    stored = program;
    return program.find('O') == std::string::npos ? EW_DATA : EW_OK;
  }
  EwCode fetchPrograms(int first, int last, std::string* program) const override {
    if (first > 1234 || last < 1234) {
      return EW_DATA;
    }
    *program = "%\nO1234\n" + std::string(3000, 'X') + "\n%\n";
    return EW_OK;
  }
  EwCode dncStart() override {
    const std::lock_guard<std::mutex> lock(mutex);
    if (refuse_start != EW_OK) {
      return refuse_start;
    }
    if (state.aut != AUT_REMOTE) {
      return EW_MODE;
    }
    if (session) {
      return EW_BUSY;
    }
    session = true;
    abort_code = EW_OK;
    ++starts;
    return EW_OK;
  }
  std::size_t dncData(const char* data, std::size_t size) override {
    const std::lock_guard<std::mutex> lock(mutex);
    const std::size_t taken = std::min(size, free_space);
    free_space -= taken;
    text.append(data, taken);
    return taken;
  }
  EwCode dncEnd() override {
    const std::lock_guard<std::mutex> lock(mutex);
    session = false;
    ++ends;
    return EW_OK;
  }
  void dncCancel(int result) override {
    const std::lock_guard<std::mutex> lock(mutex);
    session = false;
    ++cancels;
    cancel_result = result;
  }
  void dncDisconnected() override {
    const std::lock_guard<std::mutex> lock(mutex);
    session = false;
    ++disconnects;
  }
  EwCode dncAbort() override {
    const std::lock_guard<std::mutex> lock(mutex);
    if (abort_code != EW_OK) {
      session = false;
    }
    return abort_code;
  }

  static std::vector<NumberedValue> between(std::vector<NumberedValue> all, int first, int last) {
    all.erase(std::remove_if(all.begin(), all.end(),
                             [&](const NumberedValue& n) { return n.number < first || n.number > last; }),
              all.end());
    return all;
  }

  template <class T>
  T locked(const T& value) const {
    const std::lock_guard<std::mutex> lock(mutex);
    return value;
  }
  template <class F>
  void change(F&& f) {
    const std::lock_guard<std::mutex> lock(mutex);
    f(*this);
  }
};

}  // namespace smartmill::focas
