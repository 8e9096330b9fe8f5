#include "parameters_ros.h"

#include "smartmill_core/error.h"

namespace smartmill::sim {

NodeParameters readParameters(ParameterReader& reader) {
  NodeParameters p;
  int seed = 1;
  reader.require("model", p.model);
  reader.read("bind", p.bind);
  reader.read("port", p.port);
  reader.read("seed", seed);
  reader.read("substeps", p.world.substeps);
  reader.read("tap_peak", p.world.tap_peak);
  reader.read("tap_contact", p.world.tap_contact);
  reader.read("operator_delay", p.world.operator_delay);
  reader.read("force_scatter", p.world.force_scatter);
  reader.read("most_behind", p.most_behind);
  reader.finish();
  if (seed < 0) throw Error("seed: " + std::to_string(seed) + " is below 0");
  if (p.port < 0 || p.port > 65535) throw Error("port: " + std::to_string(p.port) + " is not in 0..65535");
  if (!(p.most_behind >= 0.05)) {
    throw Error("most_behind: " + std::to_string(p.most_behind) + " s is below 0.05 s");
  }
  p.world.seed = static_cast<std::uint64_t>(seed);
  p.world.validate();
  return p;
}

}  // namespace smartmill::sim
