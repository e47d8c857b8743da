// The quicker of two ways [core/quicker.h].
#include <gtest/gtest.h>

#include <vector>

#include "core/quicker.h"

namespace platen {
namespace {

constexpr int trial = Quicker::runs_of_block * Quicker::blocks_of_trial, clear_trial = 2 * Quicker::runs_of_block;

// Where runs of both took as long as each other now and then, all of the trial is needed; else a block of each will do.
TEST(Quicker, TriesBothInTurnAndTakesTheQuicker) {
  for (const int best : {0, 1})
    for (const bool clear : {true, false}) {
      Quicker quicker;
      std::vector<int> ways;
      while (quicker.trying() && static_cast<int>(ways.size()) <= trial) {
        const bool slow_for_once = !clear && ways.size() % Quicker::runs_of_block == 1;
        ways.push_back(quicker.way());
        quicker.took(quicker.way() == best && !slow_for_once ? 1.0 : 1.2);
      }
      ASSERT_EQ(static_cast<int>(ways.size()), clear ? clear_trial : trial);
      for (int run = 0; run < static_cast<int>(ways.size()); ++run) EXPECT_EQ(ways[static_cast<std::size_t>(run)], run / Quicker::runs_of_block % 2);
      EXPECT_EQ(quicker.way(), best);
    }
}

// What only becomes slower, or quicker, is no way's doing.
TEST(Quicker, ATrendEndsNoTrialEarly) {
  for (const double trend : {1.001, 0.999}) {
    Quicker quicker;
    double seconds = 1.0;
    for (int run = 0; run < trial; ++run) {
      EXPECT_TRUE(quicker.trying());
      quicker.took(seconds *= trend);
    }
    EXPECT_FALSE(quicker.trying());
  }
}

// The first run of a block, and one that something else held up, decide nothing.
TEST(Quicker, SingleRunsDecideNothing) {
  Quicker quicker;
  for (int run = 0; run < trial; ++run) {
    // Of five that count in a block two are held up, and so is the first one: half of all.
    const int of_block = run % Quicker::runs_of_block;
    quicker.took(quicker.way() == 1 ? (of_block < 3 ? 100.0 : 1.0) : 1.1);
  }
  EXPECT_EQ(quicker.way(), 1);
}

TEST(Quicker, StaysAndLooksAgain) {
  Quicker quicker;
  for (int run = 0; run < clear_trial; ++run) quicker.took(quicker.way() == 1 ? 1.0 : 2.0);
  for (int run = 0; run < Quicker::runs_between; ++run) {
    EXPECT_EQ(quicker.way(), 1);
    quicker.took(50.0);
  }
  EXPECT_TRUE(quicker.trying());
  for (int run = 0; run < clear_trial; ++run) quicker.took(quicker.way() == 1 ? 2.0 : 1.0);
  EXPECT_EQ(quicker.way(), 0);
}

}  // namespace
}  // namespace platen
