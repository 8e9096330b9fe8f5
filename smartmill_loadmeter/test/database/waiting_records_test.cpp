#include "smartmill_loadmeter/database/waiting_records.h"

#include <gtest/gtest.h>

#include <vector>

#include "smartmill_core/error.h"

namespace smartmill::loadmeter {
namespace {

/// Database of numbers that can be full.
struct Numbers {
  bool full = false;
  std::vector<int> stored;

  WaitingRecords::Store storing(int number) {
    return [this, number] {
      if (full) throw Error("mill.sqlite: database or disk is full");
      stored.push_back(number);
    };
  }
};

TEST(WaitingRecords, WhatAFullDatabaseRefusesIsStoredLaterInOrderAndOnce) {
  Numbers database;
  WaitingRecords records;
  EXPECT_TRUE(records.add(database.storing(1)));
  database.full = true;
  EXPECT_FALSE(records.add(database.storing(2)));
  EXPECT_FALSE(records.add(database.storing(3)));
  EXPECT_EQ(records.retry(), 0u);
  EXPECT_EQ(records.size(), 2u);
  EXPECT_EQ(records.problem(), "mill.sqlite: database or disk is full");
  database.full = false;
  EXPECT_EQ(records.retry(), 2u);
  EXPECT_EQ(records.size(), 0u);
  EXPECT_EQ(records.problem(), "");
  EXPECT_TRUE(records.add(database.storing(4)));
  EXPECT_EQ(database.stored, (std::vector<int>{1, 2, 3, 4}));
}

TEST(WaitingRecords, TheOldestOfTooManyAreLostAndCounted) {
  Numbers database;
  database.full = true;
  WaitingRecords records(2);
  for (int number = 1; number <= 5; ++number) records.add(database.storing(number));
  EXPECT_EQ(records.size(), 2u);
  EXPECT_EQ(records.lost(), 3u);
  database.full = false;
  EXPECT_TRUE(records.add(database.storing(6)));
  EXPECT_EQ(database.stored, (std::vector<int>{4, 5, 6}));
}

}  // namespace
}  // namespace smartmill::loadmeter
