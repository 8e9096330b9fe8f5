#pragma once

#include <algorithm>
#include <sstream>
#include <string>
#include <vector>

#include "smartmill_core/error.h"
#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_sim/faults/stream_fault.h"

namespace smartmill::sim {

/// Parameters of fault_node.
struct FaultParameters {
  std::string topics = "daq/dynamometer daq/hammer spindle/angle";
  std::string faults;
  double input_timeout = 1.0;

  std::vector<std::string> topicList() const {
    std::vector<std::string> list;
    std::stringstream words(topics);
    for (std::string word; words >> word;) list.push_back(word);
    return list;
  }

  void declare(ParameterTable& table) {
    table.title(
        "Parameters of fault_node (package smartmill_sim): faults of sensor streams, in a simulation or a "
        "replay "
        "only.");
    table.text("topics", topics,
               "topics that pass through the node, separated by blanks: from sim/healthy/TOPIC to TOPIC");
    table.text(
        "faults", faults,
        "TOPIC FAULT BEGIN DURATION [VALUE]; ... with BEGIN [s] after the first stamp of the topic and "
        "DURATION [s], 0: without end; empty: none until the service sim/set_fault");
    table.number("input_timeout", input_timeout, "s", Range::positive(),
                 "time without messages after which the data have ended");
  }
  /// @throws Error naming key and value.
  void validate() const {
    checkBounds(*this);
    const std::vector<std::string> list = topicList();
    if (list.empty()) throw Error("topics: empty, expected at least one topic");
    for (const TopicFault& entry : readFaults(faults)) {
      if (std::find(list.begin(), list.end(), entry.topic) == list.end())
        throw Error("faults: topic " + entry.topic + " is not in topics: '" + topics + "'");
    }
  }
};

}  // namespace smartmill::sim
