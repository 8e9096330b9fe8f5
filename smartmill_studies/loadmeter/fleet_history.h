#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "smartmill_loadmeter/database/database.h"

namespace smartmill::studies {

/// Line of a client's log about its pushes: records [first, last) of its machine were sent, or were
/// acknowledged. Sent records that were not acknowledged may be stored or not.
struct PushEvent {
  enum class Kind : std::uint8_t { attempted, acknowledged };
  Kind kind = Kind::attempted;
  std::size_t first = 0, last = 0;  ///< by number in the machine's file
};
/// In the order of each machine.
using PushHistory = std::map<std::string, std::vector<PushEvent>>;

/// Record `number` of a machine, the same at each call; machine and number are in its `bag`.
loadmeter::CoefficientRecord recordOf(const std::string& machine, std::size_t number);

/// Reads the lines "attempted FIRST LAST" and "acknowledged FIRST LAST" of a client's log; a last line that
/// was cut off by a kill is left out. @throws Error naming another line.
std::vector<PushEvent> readPushEvents(const std::string& file);

/// Compares the server's records with the logs of the clients. @return a line for each acknowledged record
/// that is not there, record that is there twice, that no client has sent, or with another content
std::vector<std::string> violationsOf(const PushHistory& history,
                                      const std::vector<loadmeter::CoefficientRecord>& server);

/// [1] records that were attempted and not acknowledged: of these in the server, and not
struct UnknownRecords {
  std::size_t stored = 0, absent = 0;
};
UnknownRecords unknownOf(const PushHistory& history, const std::vector<loadmeter::CoefficientRecord>& server);

}  // namespace smartmill::studies
