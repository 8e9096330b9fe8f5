#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "smartmill_focas/server.h"

namespace smartmill::sim {

/// Present signals of the control and its panel to the PMC.
struct PmcSignals {
  int mode = focas::AUT_MDI;
  bool operating = false, started = false, held = false, alarm = false, emergency = false;
  bool at_speed = false, at_rest = true, oriented = false;
  int m_code = 0;
  int s_code = 0;              ///< [rpm] commanded
  double spindle_speed = 0.0;  ///< [rpm] actual
  double feed_override = 1.0, spindle_override = 1.0;
};

/// Address in the data table: percentage on the feed override, next address: on the spindle override; 0: no
/// effect.
constexpr int OVERRIDE_DATA = 500;

/// Memory of the PMC of a 30i (area sizes of its first path). The PMC program overwrites signals of the
/// control (F) and of the panel (G, X) at once.
class PmcMemory {
 public:
  PmcMemory();
  /// Updates the bytes of the signals.
  void update(const PmcSignals& signals);
  focas::EwCode read(focas::PmcArea area, int first, int last, focas::Bytes* bytes) const;
  focas::EwCode write(focas::PmcArea area, int first, const focas::Bytes& bytes);

 private:
  std::uint8_t& at(focas::PmcArea area, std::size_t address);
  void put(focas::PmcArea area, std::size_t address, std::uint32_t value, std::size_t bytes);

  std::array<std::vector<std::uint8_t>, 10> areas_;
};

}  // namespace smartmill::sim
