// rosrun smartmill_launch record -o FILE PATTERN...

#include <atomic>
#include <string>
#include <vector>

#include "node/bag_recorder.h"
#include "node/shutdown_request.h"
#include "smartmill_core/program.h"
#include "smartmill_ros/master_watch.h"

namespace {

void run(const std::string& path, const std::vector<std::string>& patterns,
         const std::atomic<bool>& shutdown) {
  constexpr double SUBSCRIBE_PERIOD = 0.5, STEP = 0.1;  // [s] of wall time
  const ros::NodeHandle nh;
  smartmill::session::BagRecorder recorder(nh, path, patterns);
  const smartmill::MasterWatch master(nh);
  ros::WallTime subscribed;
  while (!shutdown && ros::ok()) {
    if ((ros::WallTime::now() - subscribed).toSec() > SUBSCRIBE_PERIOD) {
      recorder.subscribe();
      subscribed = ros::WallTime::now();
    }
    recorder.record(STEP);
  }
  recorder.finish();
}

}  // namespace

int main(int argc, char** argv) {
  // Messages that are queued when the shutdown is requested are still written.
  ros::init(argc, argv, "record", ros::init_options::NoSigintHandler);
  const std::atomic<bool>& shutdown = smartmill::session::catchShutdownRequest();
  std::string path;
  std::vector<std::string> patterns;
  smartmill::CommandLine line(
      "Records topics to a bag or an MCAP file without losing messages on a busy computer; Ctrl-C ends the "
      "recording.");
  line.option("-o,--out", path, "file to write, *.bag or *.mcap").required();
  line.option("patterns", patterns, "regular expressions that match full topic names").required();
  return smartmill::runProgram(line, argc, argv, [&] { run(path, patterns, shutdown); });
}
