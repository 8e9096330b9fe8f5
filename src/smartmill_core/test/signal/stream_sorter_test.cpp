#include "smartmill_core/signal/stream_sorter.h"

#include <algorithm>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/signal/streams.h"

namespace smartmill {
namespace {

TEST(StreamSorter, holdsBackUntilEveryRegularStreamHasPassed) {
  StreamSorter sorter(0.05);
  const auto a = sorter.addRegular("a"), b = sorter.addRegular("b");
  std::string got;
  sorter.push(a, 1.00, [&] { got += "a"; });
  sorter.push(a, 1.10, [&] { got += "A"; });
  EXPECT_EQ(got, "");
  EXPECT_EQ(sorter.waitingFor(), "b");
  sorter.push(b, 1.04, [&] { got += "b"; });
  EXPECT_EQ(got, "");  // b has not passed 1.00 + 0.05
  sorter.push(b, 1.08, [&] { got += "B"; });
  EXPECT_EQ(got, "a");
  sorter.flush();
  EXPECT_EQ(got, "abBA");
  EXPECT_EQ(sorter.waitingFor(), "");
  EXPECT_EQ(sorter.late(), 0u);
}

TEST(StreamSorter, equalStampsAreOrderedByStreamThenByArrival) {
  StreamSorter sorter(0.0);
  const auto a = sorter.addRegular("a"), b = sorter.addRegular("b");
  const auto events = sorter.addEvents("goal");
  std::string got;
  sorter.push(events, 1.0, [&] { got += "e"; });
  sorter.push(b, 1.0, [&] { got += "b"; });
  sorter.push(a, 1.0, [&] { got += "1"; });
  sorter.push(a, 1.0, [&] { got += "2"; });
  EXPECT_EQ(got, "");  // another item of stamp 1 may still arrive
  sorter.push(a, 2.0, [] {});
  sorter.push(b, 2.0, [] {});
  EXPECT_EQ(got, "12be");
}

TEST(StreamSorter, aStreamDelaysTheOthersOnlyWhileItIsRegular) {
  StreamSorter sorter(0.0);
  const auto a = sorter.addRegular("a"), b = sorter.addEvents("b");
  std::string got;
  sorter.push(a, 1.0, [&] { got += "1"; });
  sorter.push(a, 2.0, [&] { got += "2"; });
  EXPECT_EQ(got, "1");
  sorter.setRegular(b, true);
  sorter.push(b, 2.0, [&] { got += "b"; });
  sorter.push(a, 4.0, [&] { got += "4"; });
  EXPECT_EQ(got, "1");
  sorter.setRegular(b, false);  // it has ended
  EXPECT_EQ(got, "12b");
}

TEST(StreamSorter, aStreamIsAwaitedUpToItsPatience) {
  StreamSorter sorter(0.0);
  const auto a = sorter.addRegular("a", 0.5), b = sorter.addRegular("b");
  std::string got;
  sorter.push(b, 1.0, [&] { got += "1"; });
  sorter.push(b, 1.4, [&] { got += "2"; });
  EXPECT_EQ(got, "");
  EXPECT_EQ(sorter.waitingFor(), "a");
  sorter.push(b, 1.6, [&] { got += "3"; });  // never one of a
  EXPECT_EQ(got, "12");
  EXPECT_EQ(sorter.waitingFor(), "b");
  sorter.push(a, 1.7, [&] { got += "a"; });  // awaited again
  sorter.push(b, 2.0, [&] { got += "4"; });
  EXPECT_EQ(got, "123");
  sorter.push(b, 2.1, [&] { got += "5"; });
  EXPECT_EQ(got, "123");
  sorter.push(b, 2.3, [&] { got += "6"; });  // 0.6 s after the last of a
  EXPECT_EQ(got, "123a45");
  sorter.flush();
  EXPECT_EQ(got, "123a456");
  EXPECT_EQ(sorter.late(), 0u);
}

TEST(StreamSorter, anEventWithinTheHoldBackIsInOrderAndALaterOneIsCounted) {
  StreamSorter sorter(0.05);
  const auto a = sorter.addRegular("a"), events = sorter.addEvents("goal");
  std::string got;
  sorter.push(a, 1.00, [&] { got += "1"; });
  sorter.push(a, 1.04, [&] { got += "2"; });
  sorter.push(events, 0.99, [&] { got += "e"; });
  sorter.push(a, 1.06, [&] { got += "3"; });
  EXPECT_EQ(got, "e1");
  sorter.push(events, 0.995, [&] { got += "L"; });
  EXPECT_EQ(got, "e1L");
  EXPECT_EQ(sorter.late(), 1u);
}

TEST(StreamSorter, resetDropsStampsAndItems) {
  StreamSorter sorter(0.0);
  const auto a = sorter.addRegular("a");
  std::string got;
  sorter.push(a, 100.0, [&] { got += "x"; });
  sorter.push(a, 101.0, [&] { got += "y"; });
  sorter.reset();
  sorter.push(a, 1.0, [&] { got += "1"; });
  sorter.push(a, 2.0, [&] { got += "2"; });
  sorter.flush();
  EXPECT_EQ(got, "x12");
  EXPECT_EQ(sorter.late(), 0u);
}

TEST(StreamSorter, aBackwardJumpOfTimeRestartsAndIsReported) {
  StreamSorter sorter(0.0);
  const auto a = sorter.addRegular("a"), b = sorter.addRegular("b"), goals = sorter.addEvents("goal");
  std::string got;
  sorter.onRestart([&] { got += "|"; });
  sorter.push(a, 100.0, [&] { got += "x"; });
  sorter.push(b, 101.0, [&] { got += "y"; });
  sorter.push(goals, 50.0, [&] { got += "g"; });   // an event may be old: no restart
  sorter.push(a, 99.5, [&] { got += "L"; });       // late, but within a second
  sorter.push(b, 300.0, [&] { got += "never"; });  // one stream may run ahead of another
  sorter.push(a, 100.0 - StreamSorter::RESTART - 0.001, [&] { got += "1"; });
  EXPECT_EQ(got, "gL|");
  sorter.push(b, 99.5, [&] { got += "2"; });
  sorter.push(a, 99.6, [&] { got += "3"; });
  EXPECT_EQ(sorter.newest(), 99.6);
  sorter.flush();
  EXPECT_EQ(got, "gL|123");
}

TEST(StreamSorter, aLatchedEventOfTheNewRunSurvivesTheRestart) {
  StreamSorter sorter(0.0);
  const auto a = sorter.addRegular("a"), condition = sorter.addLatched("condition");
  std::string got;
  sorter.onRestart([&] { got = "|"; });
  sorter.push(condition, 90.0, [&] { got += "old"; });
  sorter.push(a, 100.0, [&] { got += "x"; });
  sorter.push(a, 101.0, [&] { got += "y"; });
  sorter.push(a, 10.0, [&] { got += "1"; });  // the condition of the old run does not apply
  sorter.push(a, 200.0, [] {});
  EXPECT_EQ(got, "|1");
  sorter.push(condition, 10.0, [&] { got += "c"; });  // arrived before its run's first sample
  sorter.push(a, 10.5, [&] { got += "1"; });
  sorter.push(a, 11.0, [&] { got += "2"; });
  EXPECT_EQ(got, "|c1");
}

TEST(StreamSorter, anEventWithoutAStampFollowsTheSamplesReceivedSoFar) {
  StreamSorter sorter(0.0);
  const auto a = sorter.addRegular("a"), events = sorter.addEvents("fault");
  std::string got;
  sorter.pushNow(events, [&] { got += "e"; });
  EXPECT_EQ(got, "e");
  sorter.push(a, 1.0, [&] { got += "1"; });
  sorter.pushNow(events, [&] { got += "f"; });
  sorter.push(a, 2.0, [&] { got += "2"; });
  EXPECT_EQ(got, "e1f");
}

TEST(StreamSorter, anOptionalStreamIsAwaitedFromItsFirstItemAndAnUnawaitedOneNever) {
  StreamSorter sorter(0.0);
  const auto a = sorter.addRegular("a"), b = sorter.addOptional("b"), c = sorter.addUnawaited("c");
  std::string got;
  sorter.push(c, 0.5, [&] { got += "c"; });
  sorter.push(a, 1.0, [&] { got += "1"; });
  sorter.push(a, 2.0, [&] { got += "2"; });
  EXPECT_EQ(got, "c1");
  sorter.push(b, 2.0, [&] { got += "b"; });
  sorter.push(a, 4.0, [&] { got += "4"; });
  EXPECT_EQ(got, "c1");
  sorter.setRegular(b, false);  // it has ended
  EXPECT_EQ(got, "c12b");
}

TEST(StreamSorter, eventsAloneAreSortedByTheHoldBack) {
  StreamSorter sorter(0.1);
  const auto events = sorter.addEvents("goal");
  std::string got;
  sorter.push(events, 1.02, [&] { got += "2"; });
  sorter.push(events, 1.00, [&] { got += "1"; });
  sorter.push(events, 1.20, [&] { got += "3"; });
  EXPECT_EQ(got, "12");
}

TEST(StreamSorter, anItemMayThrowOrPush) {
  StreamSorter sorter(0.0);
  const auto a = sorter.addRegular("a");
  std::string got;
  sorter.push(a, 1.0, [&] { sorter.push(a, 1.5, [&] { got += "n"; }); });
  sorter.push(a, 2.0, [&] { throw Error("bad"); });
  EXPECT_THROW(sorter.push(a, 3.0, [&] { got += "3"; }), Error);
  sorter.flush();
  EXPECT_EQ(got, "n3");
}

TEST(StreamSorter, rejectsAStampThatIsNotFinite) {
  StreamSorter sorter(0.0);
  const auto a = sorter.addRegular("daq/hammer");
  try {
    sorter.push(a, NOT_A_NUMBER, [] {});
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("daq/hammer"), std::string::npos);
  }
  EXPECT_THROW(StreamSorter(-1.0), Error);
}

// Two streams of 3,000 messages each and a hundred goals, every message delayed by up to 40 ms as in roscpp:
// items are delivered in the order of stamps, whatever the order of arrival.
TEST(StreamSorter, sixThousandShuffledMessagesAreDeliveredInOrder) {
  struct Item {
    double stamp, arrival;
    std::size_t stream;
  };
  std::vector<double> reference;
  for (unsigned seed = 1; seed <= 5; ++seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> delay(0.0, 0.04);
    std::vector<Item> items;
    for (int i = 0; i < 3000; ++i) {
      items.push_back({0.01 * i, 0.0, 0});
      items.push_back({0.01 * i + (i % 3 ? 0.003 : 0.0), 0.0, 1});
      if (i % 30 == 0) items.push_back({0.01 * i + 0.005, 0.0, 2});
    }
    for (Item& item : items) item.arrival = item.stamp + delay(random);
    std::stable_sort(items.begin(), items.end(),
                     [](const Item& l, const Item& r) { return l.arrival < r.arrival; });
    StreamSorter sorter(0.05);
    sorter.addRegular("hammer");
    sorter.addRegular("state");
    sorter.addEvents("goal");
    std::vector<double> got;
    for (const Item& item : items) {
      sorter.push(item.stream, item.stamp, [&got, item] { got.push_back(10.0 * item.stamp + item.stream); });
    }
    sorter.flush();
    EXPECT_EQ(sorter.late(), 0u);
    EXPECT_EQ(got.size(), items.size());
    if (reference.empty()) {
      reference = got;
      std::vector<Item> expected = items;
      std::stable_sort(expected.begin(), expected.end(), [](const Item& l, const Item& r) {
        return std::make_pair(l.stamp, l.stream) < std::make_pair(r.stamp, r.stream);
      });
      for (std::size_t i = 0; i < expected.size(); ++i)
        EXPECT_EQ(got[i], 10.0 * expected[i].stamp + expected[i].stream);
    }
    EXPECT_EQ(got, reference);
  }
}

TEST(SampleBlock, findsChannelsByName) {
  SampleBlock block;
  block.stamp = 2.0;
  block.sample_rate = 100.0;
  block.channels = {"fx", "fy"};
  block.samples = {1, 2, 3, 4, 5, 6};
  EXPECT_EQ(block.size(), 3u);
  EXPECT_EQ(block.column("fy"), (std::vector<double>{2, 4, 6}));
  EXPECT_DOUBLE_EQ(block.timeOf(2), 2.02);
  try {
    block.channel("gap");
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("'gap' is missing (present: fx fy)"), std::string::npos);
  }
}

TEST(StreamSorter, anErrorNamesTheStreamOfItsItem) {
  StreamSorter sorter(0.0);
  const auto a = sorter.addRegular("a"), b = sorter.addRegular("b");
  sorter.push(b, 1.0, [] { throw Error("channel fx is missing"); });
  sorter.push(b, 2.0, [] {});
  try {
    sorter.push(a, 2.0, [] {});
    FAIL() << "no error";
  } catch (const StreamError& error) {
    EXPECT_EQ(error.stream(), "b");
    EXPECT_STREQ(error.what(), "channel fx is missing");
  }
}

}  // namespace
}  // namespace smartmill
