#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_cnc/nc_program.h"
#include "smartmill_core/signal/streams.h"

namespace smartmill::cnc {

struct BridgeParameters {
  std::string host = "127.0.0.1";  ///< controller
  int port = 8193;                 ///< [-] 1..65535
  double reply_timeout = 0.5;      ///< [s] for connecting and for every answer
  double reconnect_period = 1.0;   ///< [s] between two attempts
  int spindle = 1;                 ///< [-] 1-based
  int marker_macro = 100;          ///< [-] variable that tells the end of a piece of program
  int orient_macro = 1133;         ///< [-] variable that M119 reads the angle from
  double settle_time = 0.1;        ///< [s] of standstill that ends a motion
  double standstill_speed = 0.2;   ///< [rad/s] a spindle slower than this stands
  double stall_timeout = 60.0;     ///< [s] without any progress (feed hold excepted) end a motion
  double stop_timeout = 5.0;       ///< [s] a cancelled motion may take to stop
  double open_timeout = 3.0;       ///< [s] the controller may put off a new DNC session after a cancelled one
  double condition_lead = 0.3;     ///< [s] >= 0 by which a cutting condition is told before it begins or ends
  MotionLimits limits;

  /// @throws Error naming key and value.
  void validate() const;
};

/// Codes of the actions RunProgram, Jog, OrientSpindle.
enum class MotionCode : std::uint8_t {
  ok = 0,
  cancelled = 1,
  not_connected = 2,
  not_armed = 3,
  wrong_mode = 4,
  limit = 5,
  alarm = 6,
  lost = 7,
  busy = 8,
  bad_goal = 9
};
/// Codes of the service ArmMotion.
enum class ArmCode : std::uint8_t { ok = 0, not_connected = 1, wrong_mode = 2, alarm = 3 };
/// Codes of the service SetMacro.
enum class MacroCode : std::uint8_t { ok = 0, not_connected = 1, refused = 2 };

template <class Code>
struct Answer {
  Code code = Code::ok;
  std::string message;  ///< one line
};
using Outcome = Answer<MotionCode>;

/// A line for the log.
struct Note {
  enum class Level { info, warning, error };
  Level level = Level::info;
  std::string text;
};

struct Progress {
  std::size_t bytes_sent = 0, bytes_total = 0;
  std::string stage;            ///< opening, sending, running, stopping; empty when idle
  double distance_to_go = 0.0;  ///< [m] of the axis of a jog
};

/// The bridge to the controller: keeps the connection, reads the state, streams programs. One thread drives
/// it: fetch(now), then step(time at which the replies arrived), at a fixed period; the commands in between.
/// One motion at a time. Nothing here looks at a clock, except that waiting for an answer is bounded by
/// reply_timeout.
///
/// A program goes to the controller as a piece of one long DNC session: its text, then #marker=k; it has
/// ended when the controller has set the variable, no distance is left and nothing has moved for settle_time
/// (Dunwoody 6.2 and 7.1). The session is opened when motion is armed, ended when it is disarmed, and opened
/// anew after a cancel.
class Bridge {
 public:
  /// @throws Error of BridgeParameters::validate().
  explicit Bridge(const BridgeParameters& parameters);
  ~Bridge();
  Bridge(const Bridge&) = delete;
  Bridge& operator=(const Bridge&) = delete;

  /// Connects when it is time to, reads the controller. @param now [s] any steady time.
  void fetch(double now);
  /// Takes what fetch() read and goes on with the running motion. @param now [s] the stamp of what was read.
  void step(double now);

  /// Last values; connected tells whether they are current.
  const CncState& state() const;
  /// Read in the last step, nothing when not connected.
  const std::optional<LoadSample>& load() const;
  /// [m] Increment of the controller's positions.
  double positionIncrement() const;

  Answer<ArmCode> arm(bool on);
  Answer<MacroCode> setMacro(int number, double value);

  /// Starts a motion; an Outcome now is a refusal, nothing was sent.
  std::optional<Outcome> runProgram(const std::string& name, const std::string& program,
                                    const CuttingCondition& condition);
  /// @param distance [m]. @param feed [m/s], 0: rapid.
  std::optional<Outcome> jog(const std::string& axis, double distance, double feed);
  /// @param angle [rad]
  std::optional<Outcome> orient(double angle);
  /// Stops the running motion; its Outcome follows when it stands.
  void cancel();
  /// Stops and closes at once: the program ends.
  void shutdown();

  bool busy() const;
  Progress progress() const;
  /// How the last motion ended, once.
  std::optional<Outcome> takeOutcome();
  /// Cutting conditions that began or ended since the last call, with their stamps.
  std::vector<CuttingCondition> takeConditions();
  std::vector<Note> takeNotes();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace smartmill::cnc
