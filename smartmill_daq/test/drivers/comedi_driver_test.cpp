// The driver against a fake of comedilib's C interface: a card of 16 bit whose samples come through a pipe.
#include <comedilib.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_daq_testing/listening.h"

namespace {

/// What the fake card does.
struct Card {
  int pipe[2] = {-1, -1};
  comedi_range range{-5.0, 5.0, UNIT_volt};
  unsigned period = 100000;  // [ns] that it can
  std::vector<unsigned> list;
  int tests = 0, started = 0, cancelled = 0;
  bool can_stream = true;
} card;

comedi_t* handle() {
  return reinterpret_cast<comedi_t*>(&card);
}

}  // namespace

extern "C" {
comedi_t* comedi_open(const char* file) {
  return std::strcmp(file, "/dev/comedi0") == 0 ? handle() : nullptr;
}
int comedi_close(comedi_t*) {
  return 0;
}
int comedi_errno() {
  return 0;
}
const char* comedi_strerror(int) {
  return "No such device or address";
}
int comedi_fileno(comedi_t*) {
  return card.pipe[0];
}
enum comedi_oor_behavior comedi_set_global_oor_behavior(enum comedi_oor_behavior) {
  return COMEDI_OOR_NAN;
}
int comedi_find_subdevice_by_type(comedi_t*, int type, unsigned int) {
  return type == COMEDI_SUBD_AI ? 0 : -1;
}
int comedi_get_subdevice_flags(comedi_t*, unsigned int) {
  return 0;
}
int comedi_get_n_channels(comedi_t*, unsigned int) {
  return 8;
}
lsampl_t comedi_get_maxdata(comedi_t*, unsigned int, unsigned int) {
  return 65535;
}
comedi_range* comedi_get_range(comedi_t*, unsigned int, unsigned int, unsigned int) {
  return &card.range;
}
int comedi_find_range(comedi_t*, unsigned int, unsigned int, unsigned int, double low, double high) {
  return low >= -5.0 && high <= 5.0 ? 3 : -1;
}
double comedi_to_phys(lsampl_t code, comedi_range* range, lsampl_t largest) {
  return range->min + (range->max - range->min) * code / largest;
}
int comedi_get_cmd_generic_timed(comedi_t*, unsigned int, comedi_cmd* command, unsigned int,
                                 unsigned int period) {
  *command = {};
  command->scan_begin_src = TRIG_TIMER;
  command->scan_begin_arg = period;
  return card.can_stream ? 0 : -1;
}
int comedi_command_test(comedi_t*, comedi_cmd* command) {
  ++card.tests;
  if (command->scan_begin_arg == card.period) return 0;
  command->scan_begin_arg = card.period;
  return 4;  // an argument was adjusted
}
int comedi_command(comedi_t*, comedi_cmd* command) {
  ++card.started;
  card.list.assign(command->chanlist, command->chanlist + command->chanlist_len);
  return 0;
}
int comedi_cancel(comedi_t*, unsigned int) {
  ++card.cancelled;
  return 0;
}
}

namespace smartmill::daq {
namespace {

using ::testing::HasSubstr;
using testing::Listening;

std::string description(const std::string& range, const std::string& file = "/dev/comedi0") {
  return "format: smartmill-instrument/1\nname: card\ndriver: comedi\nsample_rate: 10000.0\noptions: "
         "{device: " +
         file +
         ", reference: differential}\nstreams:\n  - topic: daq/dynamometer\n    channels:\n"
         "      - {input: 3, name: fx, unit: N, sensitivity: 0.01, range: " +
         range + "}\n      - {input: 1, name: fy, unit: N, sensitivity: 0.01, range: 5.0}\n";
}

class ComediDriver : public ::testing::Test {
 protected:
  void SetUp() override {
    card = Card();
    ASSERT_EQ(::pipe(card.pipe), 0);
  }
  void TearDown() override {
    ::close(card.pipe[0]);
    if (card.pipe[1] >= 0) ::close(card.pipe[1]);
  }
  TemporaryFolder folder_;
};

TEST_F(ComediDriver, scansBecomeForcesAndTheEndOfTheCommandIsAnnounced) {
  Listening listening(folder_.file("card.yaml"), description("5.0"));
  std::vector<sampl_t> codes;
  for (int i = 0; i < 500; ++i) {
    codes.push_back(static_cast<sampl_t>(20000 + i));
    codes.push_back(i == 77 ? 65535 : static_cast<sampl_t>(30000 - i));
  }
  const auto* const bytes = reinterpret_cast<const char*>(codes.data());
  const std::size_t all = codes.size() * sizeof(sampl_t), cut = 1001;  // within a sample
  ASSERT_EQ(::write(card.pipe[1], bytes, cut), static_cast<ssize_t>(cut));
  ASSERT_TRUE(listening.until([&] { return !listening.blocks.empty(); }));
  ASSERT_EQ(::write(card.pipe[1], bytes + cut, all - cut), static_cast<ssize_t>(all - cut));
  ::close(std::exchange(card.pipe[1], -1));
  ASSERT_TRUE(listening.until([&] { return listening.faults.size() >= 2; }));
  EXPECT_EQ(listening.faults[0].kind, FaultKind::clipping);
  EXPECT_EQ(listening.faults[0].index, 77u);
  EXPECT_EQ(listening.faults[1].kind, FaultKind::unplugged);
  EXPECT_THAT(listening.faults[1].text, HasSubstr("/dev/comedi0: the command has ended"));
  int i = 0;
  for (const SampleBlock& block : listening.blocks) {
    for (std::size_t s = 0; s < block.size(); ++s, ++i) {
      // 10 V over 65535 codes
      ASSERT_NEAR(block.at(s, 0), 100.0 * (-5.0 + 10.0 * (20000 + i) / 65535.0), 1e-9);
      if (i == 77) {
        ASSERT_TRUE(std::isnan(block.at(s, 1)));
      } else {
        ASSERT_NEAR(block.at(s, 1), 100.0 * (-5.0 + 10.0 * (30000 - i) / 65535.0), 1e-9);
      }
    }
  }
  EXPECT_EQ(i, 500);
  EXPECT_EQ(card.list, (std::vector<unsigned>{CR_PACK(2, 3, AREF_DIFF), CR_PACK(0, 3, AREF_DIFF)}));
  EXPECT_GE(card.cancelled, 1);
}

TEST_F(ComediDriver, aRateThatTheCardAdjustsIsAnnounced) {
  card.period = 125000;
  Listening listening(folder_.file("card.yaml"), description("5.0"));
  const std::vector<sampl_t> codes(2000, 30000);
  ASSERT_GT(::write(card.pipe[1], codes.data(), codes.size() * sizeof(sampl_t)), 0);
  ASSERT_TRUE(listening.until([&] { return !listening.faults.empty(); }));
  EXPECT_THAT(listening.faults[0].text, HasSubstr("8000 samples per second, expected 10000"));
  EXPECT_TRUE(listening.blocks.empty());
}

TEST_F(ComediDriver, whatTheCardCannotIsSaid) {
  const auto problem = [&](const std::string& text) {
    Listening listening(folder_.file("card.yaml"), text);
    return errorOf([&] { listening.until([] { return false; }); });
  };
  EXPECT_THAT(problem(description("10.0")), HasSubstr("input 3 has no range of 10"));
  card.can_stream = false;
  EXPECT_THAT(problem(description("5.0")), HasSubstr("its inputs have no streaming command"));
  Listening absent(folder_.file("absent.yaml"), description("5.0", "/dev/comedi7"));
  ASSERT_TRUE(absent.until([&] { return !absent.faults.empty(); }));
  EXPECT_THAT(absent.faults[0].text, HasSubstr("/dev/comedi7: No such device or address"));
}

}  // namespace
}  // namespace smartmill::daq
