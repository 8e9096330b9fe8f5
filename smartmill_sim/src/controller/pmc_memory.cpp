#include "controller/pmc_memory.h"

#include <algorithm>
#include <cmath>

namespace smartmill::sim {
namespace {

using focas::PmcArea;

// Bytes of G F Y X A R T K C D.
constexpr std::array<std::size_t, 10> SIZES{768, 768, 128, 128, 250, 8000, 500, 100, 400, 10000};

// Signals of the 30i's connection manual (function): address and bit.
constexpr std::size_t F_OPERATION = 0, F_ALARM = 1, F_MODE = 3, F_MODE_REFERENCE = 4, F_M_CODE = 10,
                      F_S_CODE = 22, F_SPINDLE_SPEED = 40, F_SPINDLE = 45;
constexpr std::uint8_t OP = 0x80, SA = 0x40, STL = 0x20, SPL = 0x10;  // F0
constexpr std::uint8_t AL = 0x01, MA = 0x80;                          // F1
constexpr std::uint8_t SST = 0x02, SAR = 0x08, ORAR = 0x80;           // F45
constexpr std::size_t G_STOP = 8, G_FEED_OVERRIDE = 12, G_SPINDLE_OVERRIDE = 30, X_EMERGENCY = 8;
constexpr std::uint8_t NOT_ESP = 0x10, NOT_SP = 0x20;  // G8, X8

std::uint8_t modeBits(int mode) {
  switch (mode) {
    case focas::AUT_INC:
      return 0x01;  // MINC
    case focas::AUT_HANDLE:
      return 0x02;  // MH
    case focas::AUT_JOG:
      return 0x04;  // MJ
    case focas::AUT_MDI:
      return 0x08;  // MMDI
    case focas::AUT_REMOTE:
      return 0x10;  // MRMT
    case focas::AUT_MEM:
      return 0x20;  // MMEM
    case focas::AUT_EDIT:
      return 0x40;  // MEDT
    default:
      return 0;
  }
}

std::uint8_t percent(double share) {
  return static_cast<std::uint8_t>(std::clamp(std::lround(100.0 * share), 0L, 254L));
}

}  // namespace

PmcMemory::PmcMemory() {
  for (std::size_t i = 0; i < areas_.size(); ++i) areas_[i].assign(SIZES[i], 0);
  update(PmcSignals{});
}

std::uint8_t& PmcMemory::at(PmcArea area, std::size_t address) {
  return areas_[static_cast<std::size_t>(area)][address];
}

/// Little-endian.
void PmcMemory::put(PmcArea area, std::size_t address, std::uint32_t value, std::size_t bytes) {
  for (std::size_t i = 0; i < bytes; ++i) at(area, address + i) = static_cast<std::uint8_t>(value >> (8 * i));
}

void PmcMemory::update(const PmcSignals& s) {
  const auto bit = [](bool on, std::uint8_t mask) { return static_cast<std::uint8_t>(on ? mask : 0); };
  at(PmcArea::f, F_OPERATION) =
      bit(s.operating, OP) | bit(!s.emergency, SA) | bit(s.started, STL) | bit(s.held, SPL);
  at(PmcArea::f, F_ALARM) = bit(s.alarm, AL) | MA;
  at(PmcArea::f, F_MODE) = modeBits(s.mode);
  at(PmcArea::f, F_MODE_REFERENCE) = bit(s.mode == focas::AUT_REF, 0x20);
  put(PmcArea::f, F_M_CODE, static_cast<std::uint32_t>(s.m_code), 4);
  put(PmcArea::f, F_S_CODE, static_cast<std::uint32_t>(s.s_code), 4);
  const double speed = std::clamp(std::abs(s.spindle_speed), 0.0, 65535.0);
  put(PmcArea::f, F_SPINDLE_SPEED, static_cast<std::uint32_t>(std::lround(speed)), 2);
  at(PmcArea::f, F_SPINDLE) = bit(s.at_rest, SST) | bit(s.at_speed, SAR) | bit(s.oriented, ORAR);
  at(PmcArea::g, G_STOP) = bit(!s.emergency, NOT_ESP) | bit(!s.held, NOT_SP);
  at(PmcArea::x, X_EMERGENCY) = bit(!s.emergency, NOT_ESP);
  // The feed override's bits are inverted on a 30i.
  at(PmcArea::g, G_FEED_OVERRIDE) = static_cast<std::uint8_t>(~percent(s.feed_override));
  at(PmcArea::g, G_SPINDLE_OVERRIDE) = percent(s.spindle_override);
}

focas::EwCode PmcMemory::read(PmcArea area, int first, int last, focas::Bytes* bytes) const {
  const std::vector<std::uint8_t>& memory = areas_[static_cast<std::size_t>(area)];
  if (first < 0 || last < first || static_cast<std::size_t>(last) >= memory.size()) return focas::EW_NUMBER;
  bytes->assign(memory.begin() + first, memory.begin() + last + 1);
  return focas::EW_OK;
}

focas::EwCode PmcMemory::write(PmcArea area, int first, const focas::Bytes& bytes) {
  std::vector<std::uint8_t>& memory = areas_[static_cast<std::size_t>(area)];
  if (first < 0 || static_cast<std::size_t>(first) + bytes.size() > memory.size()) return focas::EW_NUMBER;
  std::copy(bytes.begin(), bytes.end(), memory.begin() + first);
  return focas::EW_OK;
}

}  // namespace smartmill::sim
