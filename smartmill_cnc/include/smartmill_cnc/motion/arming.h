#pragma once

#include <mutex>
#include <optional>
#include <string>
#include <vector>

namespace smartmill::cnc {

/// The client for which motion is armed. ROS 1 does not authenticate clients: this prevents mistakes, not
/// attacks.
struct ArmHolder {
  std::string client;  ///< name of a node, or the name under which it armed motion
  double since = 0.0;  ///< [s]
};

/// Why another client cannot arm motion; empty: it can.
std::string armRefusal(const std::optional<ArmHolder>& holder, const std::string& client);

/// Why a client cannot move the machine; empty: it can, as motion is disarmed (which is refused elsewhere) or
/// armed for it, or as it is one of the nodes that move on behalf of the holder.
/// @param helpers full names of those nodes
std::string motionRefusal(const std::optional<ArmHolder>& holder, const std::string& client,
                          const std::vector<std::string>& helpers);

/// Name of the client of a goal. Clients of actionlib begin the id with the name of their node and a hyphen,
/// which a name cannot contain. @return empty: unknown
std::string clientOfGoal(const std::string& goal_id);

/// Date and time of day. @param time [s] since 1970 @return "2026-11-27 21:20:03 UTC"
std::string utcText(double time);

/// Append-only record of who armed, disarmed and moved the machine: one line each, with the time. Lines that
/// cannot be written (full disk) are kept, up to 1 MB, and written before the next one.
class MotionLog {
 public:
  /// Creates the file and its folder if they do not exist. @param file empty: no record
  /// @throws Error naming the file
  explicit MotionLog(std::string file);

  /// @param time [s] since 1970 @throws Error naming the file
  void write(double time, const std::string& client, const std::string& what);
  /// Tries again to write the lines that are kept. @throws Error naming the file
  void writeKept();
  const std::string& file() const { return file_; }

 private:
  void writeAll();

  std::string file_;
  std::mutex mutex_;
  std::string kept_;
};

}  // namespace smartmill::cnc
