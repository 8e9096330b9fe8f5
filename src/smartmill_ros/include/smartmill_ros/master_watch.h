#pragma once

#include <chrono>
#include <condition_variable>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include <ros/node_handle.h>

namespace smartmill {

/// Registers the node again when the ROS master was replaced by a new one at the same address, which has
/// neither nodes nor parameters; roscpp itself registers once. Connections between nodes outlive the master,
/// so that no data are lost.
/// Topics are those that the node has at that time, services and parameters those that the former master had.
class MasterWatch {
 public:
  /// Starts a thread that looks once a second.
  /// @param nh of the namespace whose kept results this node restores, with its own parameters
  explicit MasterWatch(const ros::NodeHandle& nh);
  ~MasterWatch();
  MasterWatch(const MasterWatch&) = delete;
  MasterWatch& operator=(const MasterWatch&) = delete;

 private:
  void watch();
  bool stopsWithin(std::chrono::seconds time);
  bool callSelf(const std::string& method, const XmlRpc::XmlRpcValue& arguments, XmlRpc::XmlRpcValue& result);
  void look();
  void remember(XmlRpc::XmlRpcValue& services);
  void rememberParameters();
  void registerPublications();
  void registerSubscriptions();

  bool is_known_ = false, is_gone_ = false;      // this node to the master, the master
  int looks_ = 0;                                // [1] at which the node was known
  int to_subscribe_ = 0;                         // [1] looks until the subscriptions are registered
  std::map<std::string, std::string> services_;  // address by name
  std::vector<std::string> names_;               // of the parameters
  std::map<std::string, XmlRpc::XmlRpcValue> parameters_;

  std::mutex mutex_;  // guards stops_
  std::condition_variable stopped_;
  bool stops_ = false;
  std::thread thread_;
};

}  // namespace smartmill
