#pragma once

#include <map>
#include <string>

#include <ros/node_handle.h>
#include <ros/publisher.h>

#include "smartmill_panel/server/server.h"

namespace smartmill::panel {

/// What people did and noted, on a topic.
class PanelLog {
 public:
  explicit PanelLog(ros::NodeHandle nh);
  /// @param what "mark: the note", "cancel REFUSED: why"
  void write(const std::string& who, const std::string& from, const std::string& what);

 private:
  ros::Publisher publisher_;
};

/// A note of somebody who looks: it commands nothing and needs no token. @throws Error without a text
Answer takeNote(const Question& question, PanelLog& log);

/// What the page may ask for where commands are allowed. Nothing here jogs or starts a spindle by itself:
/// what moves the machine are the actions of the other nodes, and they refuse unless the operator has armed
/// motion.
class Commands {
 public:
  Commands(ros::NodeHandle nh, PanelLog& log);

  /// The gate has let it pass. Every one is logged with who and when.
  Answer run(const Question& command);

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
