// rosrun smartmill_launch record -o FILE PATTERN...

#include <cstdint>
#include <string>
#include <vector>

#include <ros/console.h>

#include "node/bag_recorder.h"
#include "smartmill_core/io/disk_space.h"
#include "smartmill_core/program.h"
#include "smartmill_core/stop_signal.h"
#include "smartmill_ros/master_watch.h"

namespace {

/// Logs that the disk becomes full. @return whether the recording must end, so that it can still be closed
bool isFull(const std::string& path) {
  constexpr double REPEAT = 60.0;  // [s] of ROS time
  const smartmill::DiskSpace space = smartmill::diskSpaceOf(path);
  if (space.isFull()) {
    ROS_ERROR("%s: the disk is full (%.0f MB are free): the recording ends here", path.c_str(),
              1e-6 * space.available);
    return true;
  }
  if (space.isLow())
    ROS_WARN_THROTTLE(REPEAT, "%s: %.1f %% of the disk are free (%.0f MB); the recording ends below %.0f MB",
                      path.c_str(), 100.0 * space.share(), 1e-6 * space.available,
                      1e-6 * smartmill::DiskSpace::RESERVE);
  return false;
}

void run(const std::string& path, const std::vector<std::string>& patterns, std::uint64_t split) {
  constexpr double SUBSCRIBE_PERIOD = 0.5, STEP = 0.1;  // [s] of wall time
  const ros::NodeHandle nh;
  smartmill::session::BagRecorder recorder(nh, path, patterns, split);
  const smartmill::MasterWatch master(nh);
  ros::SteadyTime subscribed;
  while (!smartmill::stopRequested() && ros::ok()) {
    if ((ros::SteadyTime::now() - subscribed).toSec() > SUBSCRIBE_PERIOD) {
      if (isFull(recorder.file())) return recorder.close();
      recorder.subscribe();
      subscribed = ros::SteadyTime::now();
    }
    recorder.record(STEP);
  }
  recorder.finish();
}

}  // namespace

int main(int argc, char** argv) {
  // Messages that are queued when the shutdown is requested are still written.
  ros::init(argc, argv, "record", ros::init_options::NoSigintHandler);
  smartmill::catchStopSignals();
  std::string path;
  std::vector<std::string> patterns;
  double split = 2048.0;
  smartmill::CommandLine line(
      "Records topics to a bag or an MCAP file without losing messages on a busy computer; Ctrl-C ends the "
      "recording.");
  line.option("-o,--out", path, "file to write, *.bag or *.mcap").required();
  line.option("--split-mb", split,
              "size at which the recording continues in NAME_1.bag, NAME_2.bag, ... [MB]")
      .within(1.0, 1e9)
      .showDefault();
  line.option("patterns", patterns, "regular expressions that match full topic names").required();
  return smartmill::runProgram(line, argc, argv,
                               [&] { run(path, patterns, static_cast<std::uint64_t>(1e6 * split)); });
}
