#pragma once

#include <map>
#include <string>

#include <ros/node_handle.h>
#include <ros/publisher.h>

#include "smartmill_panel/server/server.h"

namespace smartmill::panel {

/// Publishes commands and notes of users on a topic.
class PanelLog {
 public:
  explicit PanelLog(ros::NodeHandle nh);
  /// @param what "mark: the note", "cancel REFUSED: why"
  void write(const std::string& who, const std::string& from, const std::string& what);

 private:
  ros::Publisher publisher_;
};

/// Logs a note of a user; requires no token.
ApiResponse takeNote(const ApiRequest& request, PanelLog& log);

/// Commands of the page, if they are allowed. None jogs or starts a spindle directly: the machine is moved
/// only by actions of other nodes, which refuse unless the operator has armed motion.
class Commands {
 public:
  Commands(ros::NodeHandle nh, PanelLog& log);

  /// Executes an authorised command and logs it with name and time.
  ApiResponse run(const ApiRequest& command);

 private:
  std::string cancel();
  std::string disarm();
  std::string hold();
  std::string install(const std::string& file);
  std::string measure(const std::string& direction, const std::string& tool);
  std::string identify(const std::string& tool, const std::string& material);

  ros::NodeHandle nh_;
  std::map<std::string, ros::Publisher> cancels_;
  ros::Publisher measure_, identify_;
  PanelLog& log_;
};

}  // namespace smartmill::panel
