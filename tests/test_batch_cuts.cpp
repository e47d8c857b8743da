// Into how many batches a bed is cut, and where [core/batch_cuts.h].
#include <gtest/gtest.h>

#include <cmath>

#include "core/batch_cuts.h"
#include "core/third_cache.h"
#include "tests/scenes.h"

namespace platen {
namespace {

using scenes::BedOptions;

// Batches of `spheres` each with the given numbers of pairs.
std::vector<Batch> batches_with(std::int32_t spheres, std::initializer_list<std::int32_t> pairs) {
  std::vector<Batch> batches;
  for (const std::int32_t used : pairs) {
    Batch& b = batches.emplace_back();
    b.first = spheres * static_cast<std::int32_t>(batches.size() - 1), b.count = spheres, b.used = used;
  }
  return batches;
}

TEST(AutomaticBatches, OneForEachThreadWhereWorkIsEven) {
  EXPECT_EQ(automatic_batches(5000, 1, false, most_ordered_cache), 1);
  EXPECT_EQ(automatic_batches(17213, 1, true, most_ordered_cache), 1);
  EXPECT_EQ(automatic_batches(35000, 1, true, most_ordered_cache), 2);  // none has more than 20,000
  for (const int particles : {5000, 17213, 35000}) EXPECT_EQ(automatic_batches(particles, 2, true, most_ordered_cache), 2);
  for (const int threads : {1, 2, 16}) EXPECT_EQ(automatic_batches(300, threads, false, most_ordered_cache), 1);
  for (const int threads : {0, 1, 2, 3}) EXPECT_EQ(automatic_batches(0, threads, true, most_ordered_cache), 1);
}

TEST(AutomaticBatches, SeveralForEachOfTwoThreadsWhereItIsNot) {
  EXPECT_EQ(automatic_batches(5000, 2, false, most_ordered_cache), 6);
  EXPECT_EQ(automatic_batches(35000, 2, false, most_ordered_cache), 16);
}

// What one waits for is done while it does the other.
TEST(AutomaticBatches, TwoOrMoreForEachOfManyThreads) {
  EXPECT_EQ(automatic_batches(35000, 4, true, most_ordered_cache), 16);
  EXPECT_EQ(automatic_batches(35000, 16, true, most_ordered_cache), 32);
  EXPECT_EQ(automatic_batches(35000, 16, false, most_ordered_cache), 32);
  EXPECT_EQ(automatic_batches(5000, 8, true, most_ordered_cache), 16);
  EXPECT_EQ(automatic_batches(5000, 16, true, most_ordered_cache), 16);  // 312 spheres each; two would be small
  EXPECT_EQ(automatic_batches(50000, 3, true, most_ordered_cache), 24);
  EXPECT_EQ(automatic_batches(2000, 16, true, most_ordered_cache), 7);   // fewer than threads
  for (const int threads : {3, 5, 16, 64}) EXPECT_EQ(automatic_batches(50000, threads, true, most_ordered_cache) % threads, 0);
}

// From the first step on, since a bed at rest may not make its lists anew for long.
TEST(AutomaticBatches, WhetherWorkIsEvenIsKnownAtOnce) {
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

TEST(AutomaticBatches, NoneIsTooLarge) {
  for (const int threads : {1, 2, 4, 16})
    for (const std::int32_t particles : {35'000, 280'000, 1'000'000, 5'000'000})
      EXPECT_LE(particles / automatic_batches(particles, threads, true, most_ordered_cache), particles > particles_in(most_ordered_cache) ? 2048 : 20000);
}

TEST(AutomaticBatches, SmallOnesWhereTheCacheIsSmall) {
  EXPECT_EQ(automatic_batches(14000, 1, true, 3 << 20), 1);
  EXPECT_EQ(automatic_batches(35000, 1, true, 3 << 20), 18);
  EXPECT_EQ(automatic_batches(35000, 2, true, 3 << 20), 18);
}

TEST(ThirdCache, APartOfItUpToABound) {
  EXPECT_EQ(ordered_cache_of(8 << 20), 3 << 20);
  EXPECT_EQ(ordered_cache_of(24 << 20), 9 << 20);
  EXPECT_EQ(ordered_cache_of(32 << 20), 12 << 20);
  EXPECT_EQ(ordered_cache_of(256 << 20), 12 << 20);
  EXPECT_EQ(ordered_cache_of(0), 12 << 20);
  EXPECT_GT(ordered_cache(), 0.0);
  EXPECT_LE(ordered_cache(), 12 << 20);
}

TEST(ThirdCache, SizesAsTheKernelWritesThem) {
  EXPECT_EQ(cache_size("8192K"), 8 << 20);
  EXPECT_EQ(cache_size("32M"), 32 << 20);
  EXPECT_EQ(cache_size("512"), 512);
  for (const char* no_size : {"", "K", "-1K", "8192 K", "8192KB", "much"}) EXPECT_EQ(cache_size(no_size), 0.0) << no_size;
}

TEST(AutomaticBatches, EvenWork) {
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
    for (const int count : {0, 1, 3, 40, 1000000}) {
      const Cuts cuts = equal_cuts(padded, count);
      const auto batches = static_cast<std::size_t>(std::clamp(count, 1, padded / padding));
      expect_whole(cuts, padded, batches);
      for (std::size_t k = 0; k < batches; ++k) EXPECT_NEAR(cuts[k + 1] - cuts[k], static_cast<double>(padded) / static_cast<double>(batches), padding);
    }
  EXPECT_EQ(equal_cuts(0, 3), (Cuts{0, 0}));
  EXPECT_EQ(batches_of(1000, 300), 3);
  // However large a batch is asked for, places of its sums fit into what lists say of them [kernels/owner_runs.h].
  for (const std::int32_t padded : {299000, 393208, 655000, 1000000, 3000000})
    for (const int size : {130000, 200000, 262144, 1000000000}) {
      const Cuts cuts = equal_cuts(padded, batches_of(padded, size));
      for (std::size_t k = 1; k < cuts.size(); ++k) EXPECT_LE(cuts[k] - cuts[k - 1], most_spheres_of_batch) << padded << " " << size;
    }
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
  for (const int count : {2, 4, 8, 63}) {
    const Cuts cuts = cuts_of_equal_work(before, 4000, count);
    const auto batches = static_cast<std::size_t>(count);
    expect_whole(cuts, 4000, batches);
    for (std::size_t k = 0; k < batches; ++k)
      EXPECT_NEAR(work_between(before, cuts[k], cuts[k + 1]), 11000.0 / static_cast<double>(batches), 41.0);
  }
  EXPECT_EQ(cuts_of_equal_work(batches_with(1000, {3000, 3000}), 2000, 5), equal_cuts(2000, 5));
}

// All work at one end: the others get a vector each all the same.
TEST(Cuts, NoBatchIsEmpty) {
  const std::vector<Batch> front = batches_with(64, {1000000, 0}), back = batches_with(64, {0, 1000000});
  for (const auto* before : {&front, &back})
    for (const int count : {2, 8, 16}) expect_whole(cuts_of_equal_work(*before, 128, count), 128, static_cast<std::size_t>(count));
}

// Batches of one bed, made anew with several threads: their work is alike, though only one half of it has pairs.
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
