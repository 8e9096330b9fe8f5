// rosrun smartmill_launch play FILE --topics TOPIC... --nodes NODE...

#include <string>
#include <vector>

#include "node/bag_player.h"
#include "smartmill_core/program.h"

int main(int argc, char** argv) {
  ros::init(argc, argv, "play");
  std::string path;
  std::vector<std::string> topics, nodes;
  double rate = 1.0, step = 0.1;
  bool stay = false;
  smartmill::CommandLine line(
      "Plays topics of a recording, with its clock, to nodes of SmartMill. It waits for slow nodes, so that "
      "no message is lost on a busy computer, and announces the end.");
  line.option("recording", path, "bag or MCAP file").required();
  line.option("--topics", topics, "full names").required();
  line.option("--nodes", nodes, "full names of the receiving nodes").required();
  line.option("--rate", rate, "multiple of real time; 0: as fast as the nodes process the data")
      .showDefault()
      .notNegative();
  line.option(
          "--step", step,
          "time of the recording after which the nodes have processed all data and report missing streams "
          "[s]; 0: never")
      .showDefault()
      .notNegative();
  line.flag("--stay", stay, "wait at the end for a jump back (service replay/control)");
  return smartmill::runProgram(line, argc, argv, [&] {
    smartmill::session::BagPlayer(ros::NodeHandle(), path, topics, nodes).run(rate, step, stay);
  });
}
