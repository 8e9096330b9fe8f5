#include "fuzz/input_file.h"
#include "fuzz/targets.h"
#include "smartmill_core/model/machine_model.h"

namespace smartmill::fuzz {

void model(const std::uint8_t* data, std::size_t size) {
  const std::string& file = inputFile(data, size);
  readOrRefuse([&] { readMachineModel(file); });
}

}  // namespace smartmill::fuzz
