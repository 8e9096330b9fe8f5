// rosrun smartmill_launch play FILE --topics TOPIC... --nodes NODE...

#include <string>
#include <vector>

#include "node/bag_player.h"
#include "smartmill_core/program.h"

int main(int argc, char** argv) {
  ros::init(argc, argv, "play");
  std::string path;
  std::vector<std::string> topics, nodes;
  double rate = 1.0;
  bool stay = false;
  smartmill::CommandLine line(
      "Plays topics of a recording, with its clock, to nodes of SmartMill: it waits for them, so that "
      "nothing "
      "is lost on a busy computer, and tells them the end.");
  line.option("recording", path, "bag or MCAP file").required();
  line.option("--topics", topics, "full names").required();
  line.option("--nodes", nodes, "full names of the nodes that follow").required();
  line.option("--rate", rate, "times real time; 0: as fast as the nodes follow").showDefault().notNegative();
  line.flag("--stay", stay, "at the end: for who wants to jump back (service replay/control)");
  return smartmill::runProgram(line, argc, argv, [&] {
    smartmill::session::BagPlayer(ros::NodeHandle(), path, topics, nodes).run(rate, stay);
  });
}
