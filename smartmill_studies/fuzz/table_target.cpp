#include "fuzz/input_file.h"
#include "fuzz/targets.h"
#include "smartmill_core/campaign/record.h"

namespace smartmill::fuzz {

void dynoware(const std::uint8_t* data, std::size_t size) {
  const std::string& file = inputFile(data, size);
  readOrRefuse([&] { readDynoware(file, {}); });
  readOrRefuse([&] { readDynoware(file, {{"fx", "Fy"}, {"fz", "Fz"}}); });
  readOrRefuse([&] { readCsv(file); });
}

}  // namespace smartmill::fuzz
