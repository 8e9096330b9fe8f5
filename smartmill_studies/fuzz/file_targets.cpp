#include "fuzz/scratch_file.h"
#include "fuzz/targets.h"
#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/campaign/record.h"
#include "smartmill_core/error.h"
#include "smartmill_core/io/uff.h"
#include "smartmill_core/model/machine_model.h"

namespace smartmill::fuzz {
namespace {

/// A reader may refuse with a line, and with nothing else.
template <class Read>
void told(const Read& read) {
  try {
    read();
  } catch (const Error&) {
    // Names what and where.
  }
}

}  // namespace

void model(const std::uint8_t* data, std::size_t size) {
  told([&] { readMachineModel(scratchFile(data, size)); });
}

void campaign(const std::uint8_t* data, std::size_t size) {
  told([&] { readCampaign(scratchFile(data, size)); });
}

void dynoware(const std::uint8_t* data, std::size_t size) {
  told([&] { readDynoware(scratchFile(data, size), {}); });
  told([&] { readDynoware(scratchFile(data, size), {{"fx", "Fy"}, {"fz", "Fz"}}); });
  told([&] { readCsv(scratchFile(data, size)); });
}

void uff(const std::uint8_t* data, std::size_t size) {
  told([&] { readUff(scratchFile(data, size)); });
}

}  // namespace smartmill::fuzz
