// Into how many batches a bed is cut, and where [core/batch_cuts.h].
#include <gtest/gtest.h>

#include <cmath>

#include "core/batch_cuts.h"
#include "tests/scenes.h"

namespace platen {
namespace {

using scenes::BedOptions;

std::vector<Batch> batches_with(std::int32_t spheres, std::initializer_list<std::int32_t> pairs) {
  std::vector<Batch> batches;
  for (const std::int32_t used : pairs) {
    Batch& b = batches.emplace_back();
    b.first = spheres * static_cast<std::int32_t>(batches.size() - 1), b.count = spheres, b.used = used;
  }
  return batches;
}

TEST(AutomaticBatch, OneForEachThreadWhereWorkIsEven) {
  EXPECT_EQ(automatic_batch(5000, 1, false), 5000);
  EXPECT_EQ(automatic_batch(5000, 2, true), 2504);   // whole vectors, and no third batch of a few spheres
  EXPECT_EQ(automatic_batch(17213, 2, true), 8608);
  EXPECT_EQ(automatic_batch(35000, 2, true), 17504);
  EXPECT_EQ(automatic_batch(100, 1, false), 256);
  for (const int threads : {0, 1, 2, 3}) EXPECT_EQ(automatic_batch(0, threads, true), 256);
}

TEST(AutomaticBatch, SeveralForEachThreadWhereItIsNot) {
  EXPECT_EQ(automatic_batch(5000, 2, false), 840);
  EXPECT_EQ(automatic_batch(35000, 2, false), 2192);
}

// What one waits for is done while it does the other.
TEST(AutomaticBatch, TwoOrMoreForEachOfManyThreads) {
  EXPECT_EQ(automatic_batch(35000, 4, true), 2192);   // four each
  EXPECT_EQ(automatic_batch(35000, 16, true), 1096);  // two
  EXPECT_EQ(automatic_batch(35000, 16, false), 1096);
  EXPECT_EQ(automatic_batch(5000, 8, true), 320);
  EXPECT_EQ(automatic_batch(50000, 3, true), 2088);   // eight
}

// From the first step on, since a bed at rest may not make its lists anew for long.
TEST(AutomaticBatch, WhetherWorkIsEvenIsKnownAtOnce) {
  for (const bool even : {true, false}) {
    BedOptions bed;
    bed.nx = 20, bed.ny = 8, bed.nz = 14;
    SimulationSetup setup = scenes::bed(bed, scenes::full_law(), {});
    setup.engine.threads = 2;
    if (!even)  // spheres of one half of the bed lose sight of each other
      for (std::size_t k = 0; k < setup.spheres.id.size(); ++k)
        if (setup.spheres.position[3 * k] > 0.5 * setup.width) setup.spheres.position[3 * k + 2] *= 3.0;
    Simulation sim(std::move(setup));
    sim.ensure_forces();
    EXPECT_EQ(sim.counters().batches, even ? 2 : 6);
    EXPECT_EQ(sim.counters().rebuilds, 1);
  }
}

TEST(AutomaticBatch, NoneIsTooLarge) {
  for (const int threads : {1, 2, 4, 16})
    for (const std::int32_t particles : {35'000, 280'000, 1'000'000, 5'000'000}) {
      EXPECT_LE(automatic_batch(particles, threads, true), 20000);
      if (particles <= particles_in_cache) continue;
      EXPECT_LE(automatic_batch(particles, threads, true), 2048);
    }
}

TEST(AutomaticBatch, EvenWork) {
  EXPECT_FALSE(work_is_even({}, 2));
  EXPECT_FALSE(work_is_even(batches_with(1000, {3000}), 0));
  EXPECT_TRUE(work_is_even(batches_with(1000, {3000, 3000, 3000}), 2));  // the middle batch counts half for each part
  EXPECT_TRUE(work_is_even(batches_with(1000, {0, 6000, 0}), 2));
  EXPECT_FALSE(work_is_even(batches_with(1000, {6000, 0, 0}), 2));       // a free top: all pairs at one end
  EXPECT_FALSE(work_is_even(batches_with(1000, {3000, 3000, 2000, 2000}), 2));
  EXPECT_TRUE(work_is_even(batches_with(1000, {6000, 0, 0}), 1));
}

void expect_whole(const Cuts& cuts, std::int32_t padded, std::size_t batches) {
  ASSERT_EQ(cuts.size(), batches + 1);
  EXPECT_EQ(cuts.front(), 0);
  EXPECT_EQ(cuts.back(), padded);
  for (std::size_t k = 0; k < batches; ++k) {
    EXPECT_EQ(cuts[k] % padding, 0);
    EXPECT_LT(cuts[k], cuts[k + 1]);
  }
}

TEST(Cuts, EqualOnesAreEqual) {
  for (const std::int32_t padded : {8, 1000, 4096})
    for (const int size : {8, 100, 4096, 100000}) {
      const Cuts cuts = equal_cuts(padded, size);
      const auto batches = static_cast<std::size_t>(std::clamp(std::lround(static_cast<double>(padded) / size), 1l, static_cast<long>(padded / padding)));
      expect_whole(cuts, padded, batches);
      for (std::size_t k = 0; k < batches; ++k) EXPECT_NEAR(cuts[k + 1] - cuts[k], static_cast<double>(padded) / static_cast<double>(batches), padding);
    }
  EXPECT_EQ(equal_cuts(0, 256), (Cuts{0, 0}));
}

// Work of a stretch of the curve, as the batches before tell it.
double work_between(const std::vector<Batch>& batches, double from, double to) {
  double work = 0.0;
  for (const Batch& b : batches) {
    const double low = std::max<double>(from, b.first), high = std::min<double>(to, b.first + b.count);
    if (high > low) work += (high - low) / b.count * static_cast<double>(work_of(b));
  }
  return work;
}

TEST(Cuts, OfEqualWork) {
  // The second batch is full of pairs, the last one has none; a vector of particles is at most 8 x 5 = 40 of work.
  const std::vector<Batch> before = batches_with(1000, {1000, 4000, 2000, 0});
  for (const int size : {2000, 1000, 500, 64}) {
    const Cuts cuts = cuts_of_equal_work(before, 4000, size);
    const auto batches = static_cast<std::size_t>(std::lround(4000.0 / size));
    expect_whole(cuts, 4000, batches);
    for (std::size_t k = 0; k < batches; ++k)
      EXPECT_NEAR(work_between(before, cuts[k], cuts[k + 1]), 11000.0 / static_cast<double>(batches), 41.0);
  }
  EXPECT_EQ(cuts_of_equal_work(batches_with(1000, {3000, 3000}), 2000, 1000), equal_cuts(2000, 1000));
}

// All work at one end: the others get a vector each all the same.
TEST(Cuts, NoBatchIsEmpty) {
  const std::vector<Batch> front = batches_with(64, {1000000, 0}), back = batches_with(64, {0, 1000000});
  for (const auto* before : {&front, &back})
    for (const int size : {64, 16, 8}) expect_whole(cuts_of_equal_work(*before, 128, size), 128, static_cast<std::size_t>(128 / size));
}

// Batches of one bed, made anew with several threads: their work is alike, though its lower half alone has pairs.
TEST(Cuts, ARebuildCutsBySharesOfWork) {
  BedOptions bed;
  bed.nx = 24, bed.ny = 12, bed.nz = 20;
  SimulationSetup setup = scenes::bed(bed, scenes::full_law(), {});
  for (std::size_t k = 0; k < setup.spheres.id.size(); ++k)
    if (setup.spheres.position[3 * k] > 0.5 * setup.width) setup.spheres.position[3 * k + 2] *= 3.0;
  setup.engine.threads = 4;
  Simulation sim(std::move(setup));
  sim.ensure_forces();
  const auto spread = [&] {
    std::int64_t most = 0, all = 0;
    for (const Batch& b : sim.batches()) most = std::max(most, work_of(b)), all += work_of(b);
    return static_cast<double>(most) * static_cast<double>(sim.batches().size()) / static_cast<double>(all);
  };
  EXPECT_EQ(sim.counters().batches, 8);
  EXPECT_LT(spread(), 1.25);  // within a batch work is taken to lie evenly, which it does not at the border of the halves
  sim.rebuild_now();
  EXPECT_LT(spread(), 1.1);
  std::int32_t smallest = sim.batches().front().count, largest = smallest;
  for (const Batch& b : sim.batches()) smallest = std::min(smallest, b.count), largest = std::max(largest, b.count);
  EXPECT_GT(largest, 1.3 * smallest);
}

}  // namespace
}  // namespace platen
