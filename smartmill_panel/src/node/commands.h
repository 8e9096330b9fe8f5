#pragma once

#include <map>
#include <string>

#include <ros/node_handle.h>
#include <ros/publisher.h>

#include "smartmill_panel/server/server.h"

namespace smartmill::panel {

/// What the page may ask for where commands are allowed. Nothing here jogs or starts a spindle by itself:
/// what moves the machine are the actions of the other nodes, and they refuse unless the operator has armed
/// motion.
class Commands {
 public:
  explicit Commands(ros::NodeHandle nh);

  /// The gate has let it pass. Every one is logged with who and when.
  Answer run(const Question& command);

 private:
  std::string cancel();
  std::string disarm();
  std::string install(const std::string& file);
  std::string measure(const std::string& direction, const std::string& tool);
  std::string identify(const std::string& tool, const std::string& material);
  std::string mark(const std::string& text);

  ros::NodeHandle nh_;
  std::map<std::string, ros::Publisher> cancels_;
  ros::Publisher measure_, identify_, log_;
};

}  // namespace smartmill::panel
