#include "fuzz/input_file.h"
#include "fuzz/targets.h"
#include "smartmill_core/campaign/record.h"

namespace smartmill::fuzz {

void dynoware(const std::uint8_t* data, std::size_t size) {
  const std::string& file = inputFile(data, size);
  told([&] { readDynoware(file, {}); });
  told([&] { readDynoware(file, {{"fx", "Fy"}, {"fz", "Fz"}}); });
  told([&] { readCsv(file); });
}

}  // namespace smartmill::fuzz
