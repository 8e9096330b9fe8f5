#include <cstdlib>
#include <string>

#include "fuzz/targets.h"
#include "smartmill_exchange/items/catalogue.h"
#include "smartmill_exchange/mtconnect/agent.h"
#include "smartmill_exchange/mtconnect/shdr.h"

namespace smartmill::fuzz {
namespace {

constexpr double NOW = 1.7e9;  // [s]

const exchange::Agent& filledAgent() {
  static const exchange::Agent AGENT = [] {
    exchange::AgentOptions options;
    options.buffer = 128;  // the oldest observations have left it
    exchange::Agent agent(options, NOW);
    for (int i = 0; i < 100; ++i) agent.observe({exchange::indexOf("feed"), NOW + i, 1.0 * i});
    agent.observe(
        {exchange::indexOf("alarms"), NOW, exchange::Activations{{true, "1", "a"}, {false, "2", "b"}}});
    agent.store({"modes.a", "ToolModes", NOW});
    return agent;
  }();
  return AGENT;
}

}  // namespace

/// Every target gets one well-formed document with a status, and a stream continues.
void agent(const std::uint8_t* data, std::size_t size) {
  const exchange::Agent& agent = filledAgent();
  exchange::AgentAnswer answer = agent.answer(std::string(reinterpret_cast<const char*>(data), size), NOW);
  const std::string end = answer.document.substr(answer.document.rfind("</"));
  const bool refused = end == "</MTConnectError>\n";
  if (answer.document.find("<?xml") != 0 || refused != (answer.status != 200)) std::abort();
  if (answer.stream) agent.next(*answer.stream, NOW + 1e5);
}

/// However the bytes are divided, the same pings are found.
void shdr(const std::uint8_t* data, std::size_t size) {
  const char* bytes = reinterpret_cast<const char*>(data);
  exchange::ShdrCommands whole, pieces;
  int pings = 0;
  for (std::size_t at = 0; at < size;) {
    const std::size_t piece = std::min<std::size_t>(size - at, 1 + data[at] % 16);
    pings += pieces.push(bytes + at, piece);
    at += piece;
  }
  if (whole.push(bytes, size) != pings) std::abort();
}

}  // namespace smartmill::fuzz
