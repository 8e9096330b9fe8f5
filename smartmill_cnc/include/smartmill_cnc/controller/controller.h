#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "smartmill_cnc/motion/nc_program.h"
#include "smartmill_core/signal/machine_temperature.h"
#include "smartmill_core/signal/streams.h"

namespace smartmill::cnc {

/// Why a controller did not carry out a request.
struct Failure {
  enum class Kind {
    lost,        ///< connection lost; recover with connect()
    alarm,       ///< alarm or emergency stop
    wrong_mode,  ///< its mode does not accept remote programs
    not_yet,     ///< busy or not ready: a retry may succeed
    refused      ///< any other refusal
  };
  Kind kind = Kind::refused;
  std::string message;  ///< one line
};

/// Success, or the reason of the failure.
class [[nodiscard]] Status {
 public:
  Status() = default;
  Status(Failure failure) : failure_(std::move(failure)) {}
  explicit operator bool() const { return !failure_; }
  const Failure& failure() const { return *failure_; }  ///< precondition: not successful
  bool lost() const { return failure_ && failure_->kind == Failure::Kind::lost; }

 private:
  std::optional<Failure> failure_;
};

/// A value, or the reason of its absence.
template <class Value>
class [[nodiscard]] Result {
 public:
  Result(Value value) : content_(std::move(value)) {}
  Result(Failure failure) : content_(std::move(failure)) {}
  explicit operator bool() const { return content_.index() == 0; }
  const Value& operator*() const { return std::get<0>(content_); }
  const Value* operator->() const { return &std::get<0>(content_); }
  const Failure& failure() const { return std::get<1>(content_); }  ///< precondition: no value

 private:
  std::variant<Value, Failure> content_;
};

/// An alarm of the controller.
struct ControllerAlarm {
  int number = 0;
  int type = 0;  ///< the controller's alarm type
  int axis = 0;  ///< 1-based, 0: none
  std::string text;
};

inline bool operator==(const ControllerAlarm& a, const ControllerAlarm& b) {
  return a.number == b.number && a.type == b.type && a.axis == b.axis && a.text == b.text;
}

/// State of a controller at one moment.
struct Reading {
  CncState state;                  ///< without stamp, connected and armed, which the bridge sets
  std::optional<LoadSample> load;  ///< without stamp; empty if the controller reports no load
  std::vector<ControllerAlarm> alarms;
  std::vector<double> absolute;  ///< [m] positions in workpiece coordinates, order of state.axes
  bool at_rest = true;           ///< neither axes move nor a dwell runs
  bool program_done = false;     ///< every block of the last program has been executed
};

/// Factors on the programmed values.
struct Overrides {
  double feed = 1.0, spindle = 1.0;  ///< [1]
};

/// Progress of the transfer of a program to the controller.
struct Transfer {
  std::size_t sent = 0, total = 0;  ///< [byte]
  bool complete = false;            ///< nothing is left to send
};

/// Interface of a machine's controller, independent of the protocol: its state, its variables, one program at
/// a time. Expected errors are returned, not thrown. No call waits longer than the reply timeout of the
/// implementation. Used by one thread.
class Controller {
 public:
  virtual ~Controller() = default;

  /// Name for log lines, for example "controller 127.0.0.1:8193".
  virtual std::string name() const = 0;

  /// @return the controller's description of itself.
  virtual Result<std::string> connect() = 0;
  virtual bool connected() const = 0;
  /// Ends the session and closes the connection.
  virtual void close() = 0;

  /// Every failure is Failure::Kind::lost: a machine without known state is not moved.
  virtual Result<Reading> read() = 0;

  /// [s] Period of readTemperature(); 0: it is not called.
  virtual double temperaturePeriod() const { return 0.0; }
  /// Temperatures of the motors, without stamp. What the controller does not offer is NaN and stated in
  /// `refused`, in one line. Not lost: a failure of the call means that it offers none.
  virtual Result<MachineTemperature> readTemperature(std::string& /*refused*/) {
    return Failure{Failure::Kind::refused, name() + " reports no temperatures"};
  }

  /// Writes a variable of the controller's programs.
  virtual Status setVariable(int number, double value) = 0;

  /// Requirements of the controller's dialect; the decimals are those of the last reading.
  virtual DialectOptions dialect() const = 0;
  /// @return a program that orients the spindle. @param angle [rad] of tooth 1
  virtual std::string orientProgram(double angle) const = 0;

  /// Makes the controller accept programs until closePrograms() or abort().
  virtual Status openPrograms() = 0;
  virtual bool programsOpen() const = 0;
  /// Whether it still accepts programs. After a failure it does not.
  virtual Status checkPrograms() = 0;
  /// Ends the acceptance of programs after the last block.
  virtual Status closePrograms() = 0;
  /// Ends it at once; blocks not yet executed are discarded.
  virtual Status abandonPrograms() = 0;

  /// Sets the next program, accepted by checkProgram(); nothing moves before send().
  virtual void begin(const std::string& program) = 0;
  /// Sends as much of the program as the controller accepts now.
  virtual Status send() = 0;
  virtual Transfer transfer() const = 0;
  /// Stops the axes at once, then abandonPrograms().
  virtual Status abort() = 0;
  /// Whether it accepts overrides over its interface.
  virtual bool takesOverrides() const { return false; }
  /// @return the accepted values, possibly rounded or limited.
  virtual Result<Overrides> setOverrides(const Overrides& /*wanted*/) {
    return Failure{Failure::Kind::refused, name() + " takes no overrides from outside"};
  }
  /// Feed hold: stops the axes; released at the machine's panel. Not every interface supports it.
  virtual Status hold() {
    return Failure{Failure::Kind::refused, name() + " takes no feed hold from outside: use its own key"};
  }
};

}  // namespace smartmill::cnc
