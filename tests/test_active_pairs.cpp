// Which pairs of a chunk the law sees, and how few of them are drawn together; but for the last test with vectors of two plain
// numbers, so that sanitizers see it all.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "core/float_mode.h"
#include "core/simulation.h"
#include "kernels/active_pairs.h"
#include "kernels/twice.h"
#include "tests/contact_pass.h"
#include "tests/scenes.h"

namespace platen {
namespace {

using test::Pass, test::pass;
using Two = Twice<Scalar>;
constexpr SceneTraits scene{Exponent::any, true, true, Rolling::absolute, false, true};
constexpr double leap = 2e-6;  // [m]

// A chunk of pairs that are apart, with their geometry and what is remembered numbered by pair.
struct Sample {
  Chunk<scene> chunk{};
  std::vector<std::int32_t> row_j;
  std::vector<PairTargets> to;
  std::vector<double> sp, tx, ty, tz, k_t_last;
  PairBatch batch{};

  Sample() : row_j(chunk_size), to(chunk_size), sp(chunk_size), tx(chunk_size), ty(chunk_size), tz(chunk_size), k_t_last(chunk_size) {
    std::int32_t i[chunk_size];
    for (int k = 0; k < chunk_size; ++k) {
      const auto at = static_cast<std::size_t>(k);
      i[at] = 100 + k / 3, row_j[at] = row_size * (1000 + k), to[at].partner = record_bytes * (500 + k);
      chunk.delta[k] = -1e-4, chunk.inverse[k] = 100.0 + k;
      for (int axis = 0; axis < 3; ++axis) chunk.n[axis][k] = 10 * k + axis;
      for (int side = 0; side < 2; ++side) chunk.R[side][k] = 2 + k + 0.1 * side;
    }
    find_owner_runs(i, chunk_size, 100, to.data());
    batch.row_j = row_j.data(), batch.to = to.data();
    batch.sp = sp.data(), batch.tx = tx.data(), batch.ty = ty.data(), batch.tz = tz.data(), batch.k_t_last = k_t_last.data();
    batch.first = 100, batch.end = 900, batch.count = chunk_size, batch.nothing = record_bytes * 900, batch.leap = leap;
  }
  ActiveVectors active() const {
    ActiveVectors found;
    find_active<Two, scene>(chunk, batch, chunk_size, found);
    return found;
  }
};

TEST(ActivePairs, TouchingOrLessThanALeapApart) {
  EXPECT_EQ(Sample().active().count, 0);
  const auto only = [](const ActiveVectors& active, int pair) {
    return active.count == 1 && active.pairs == 1 && active.at[0] == pair / 2 * 2 && active.lanes[0] == 1u << pair % 2;
  };
  Sample touching;
  touching.chunk.delta[7] = 1e-9;
  EXPECT_TRUE(only(touching.active(), 7));
  Sample parted;  // by as much as any pair can have in the step
  parted.chunk.delta[12] = -leap;
  EXPECT_TRUE(only(parted.active(), 12));
  parted.chunk.delta[12] = std::nextafter(-leap, -1.0);
  EXPECT_EQ(parted.active().count, 0);
  Sample broken;
  broken.chunk.delta[4] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(only(broken.active(), 4));
}

TEST(ActivePairs, AreGatheredWhereFew) {
  using Gathered = GatheredPairs<Two, scene>;
  Sample s;
  EXPECT_FALSE(Gathered::worth(s.active()));  // nothing there
  const std::vector<int> chosen = {3, 16, 17, 41, 62};
  for (const int k : chosen) s.chunk.delta[k] = 1e-6 * k;
  s.chunk.delta[62] = -0.5 * leap, s.k_t_last[62] = 5.0;  // apart, but remembered
  ActiveVectors active = s.active();
  EXPECT_EQ(active.count, 4);
  EXPECT_EQ(active.pairs, 5);
  EXPECT_FALSE(Gathered::worth(active));  // three vectors instead of four
  s.chunk.delta[30] = s.chunk.delta[50] = s.chunk.delta[55] = 1e-9;
  EXPECT_FALSE(Gathered::worth(s.active()));
  s.chunk.delta[16] = s.chunk.delta[17] = -1e-4;  // six vectors with one pair each: three are half as many
  active = s.active();
  ASSERT_TRUE(Gathered::worth(active));

  const std::vector<int> kept = {3, 30, 41, 50, 55, 62};
  for (const int k : kept) s.sp[static_cast<std::size_t>(k)] = k + 0.5, s.ty[static_cast<std::size_t>(k)] = -k;
  const Chunk<scene> before = s.chunk;
  Gathered gathered;
  gathered.take(s.chunk, s.batch, 0, active);
  const PairBatch view = gathered.view(s.batch);
  ASSERT_EQ(active.count, 3);
  for (int n = 0; n < 6; ++n) {
    const int k = kept[static_cast<std::size_t>(n)];
    EXPECT_EQ(s.chunk.delta[n], before.delta[k]);
    EXPECT_EQ(s.chunk.inverse[n], before.inverse[k]);
    for (int axis = 0; axis < 3; ++axis) EXPECT_EQ(s.chunk.n[axis][n], before.n[axis][k]);
    for (int side = 0; side < 2; ++side) EXPECT_EQ(s.chunk.R[side][n], before.R[side][k]);
    EXPECT_EQ(owner_of(view.to[n]), k / 3);
    EXPECT_EQ(view.row_j[n], row_size * (1000 + k));
    EXPECT_EQ(view.to[n].partner, record_bytes * (500 + k));
    EXPECT_EQ(view.sp[n], k + 0.5);
    EXPECT_EQ(view.ty[n], -k);
    EXPECT_EQ(view.k_t_last[n], k == 62 ? 5.0 : 0.0);
    for (double* column : {view.sp, view.tx, view.ty, view.tz, view.k_t_last}) column[n] = 1000.0 + k;  // as a law would
  }
  gathered.give_back(s.batch);
  for (int k = 0; k < chunk_size; ++k) {
    const bool was = std::find(kept.begin(), kept.end(), k) != kept.end();
    for (const auto* column : {&s.sp, &s.tx, &s.ty, &s.tz, &s.k_t_last}) EXPECT_EQ((*column)[static_cast<std::size_t>(k)], was ? 1000.0 + k : 0.0) << k;
  }
}

TEST(ActivePairs, AreFilledUpWithPairsThatAreApart) {
  Sample s;
  s.chunk.delta[20] = s.chunk.delta[40] = s.chunk.delta[60] = 1e-6;
  ActiveVectors active = s.active();
  GatheredPairs<Two, scene> gathered;
  gathered.take(s.chunk, s.batch, 0, active);
  const PairBatch view = gathered.view(s.batch);
  ASSERT_EQ(active.count, 2);
  EXPECT_LT(s.chunk.delta[3], 0.0);
  EXPECT_EQ(owner_of(view.to[3]), owner_of(view.to[2]));                // the owner's sum goes on
  EXPECT_EQ(view.row_j[3], row_size * (100 + owner_of(view.to[3])));      // a pair with itself, which has no distance and is masked
  EXPECT_EQ(view.to[3].partner, record_bytes * owner_of(view.to[3]));  // and nothing is added to it
  for (const double* column : {view.sp, view.tx, view.ty, view.tz, view.k_t_last}) EXPECT_EQ(column[3], 0.0);
}

TEST(ActivePairs, RunsOfOneOwnerAmongThem) {
  Sample s;
  const std::vector<int> kept = {3, 5, 21, 39, 40, 57};  // owners 101, 101, 107, 113, 113, 119
  for (const int k : kept) s.chunk.delta[k] = 1e-6;
  ActiveVectors active = s.active();
  ASSERT_EQ(active.pairs, 6);
  GatheredPairs<Two, scene> gathered;
  gathered.take(s.chunk, s.batch, 0, active);
  const PairBatch view = gathered.view(s.batch);
  const bool again[] = {false, true, false, false, true, false};
  const int owner[] = {101, 101, 107, 113, 113, 119};
  for (int n = 0; n < 6; ++n) {
    EXPECT_EQ(again_of(view.to[n]), again[n] ? 0xff : 0);
    EXPECT_EQ(own_of(view.to[n]), static_cast<std::uint32_t>(record_bytes * (owner[n] - 100)));
    EXPECT_EQ(owner_of(view.to[n]), owner[n] - 100);
  }
}

TEST(OwnerRuns, FitTheLargestBatch) {
  constexpr std::int32_t first = 8000, last = first + most_spheres_of_batch - 1;
  const std::int32_t i[] = {first, last, last};
  PairTargets to[3] = {};
  find_owner_runs(i, 3, first, to);
  EXPECT_EQ(own_of(to[0]), 0u);
  for (const int k : {1, 2}) {
    EXPECT_EQ(own_of(to[k]), std::uint32_t{record_bytes} * (most_spheres_of_batch - 1));
    EXPECT_EQ(owner_of(to[k]), most_spheres_of_batch - 1);
    EXPECT_EQ(owner_row(to[k]), row_size * (most_spheres_of_batch - 1));
  }
  EXPECT_EQ(again_of(to[0]), 0);
  EXPECT_EQ(again_of(to[1]), 0);
  EXPECT_EQ(again_of(to[2]), 0xff);
}

// Of eight owners within eight places each is found from the first of them, places of the batch itself at its end too; of others none.
TEST(OwnerRuns, OwnersOfEight) {
  constexpr std::int32_t first = 16, end = 48;
  const std::int32_t i[] = {16, 16, 17, 17, 20, 23, 23, 23, 24, 25, 25, 26, 30, 31, 31, 32, 46, 46, 46, 46, 47, 47, 47, 47};
  OwnersOfEight owners[3];
  find_owners(i, 24, first, end, owners);
  EXPECT_EQ(owners[1].first, -1) << "24 to 32";
  for (const int group : {0, 2}) {
    EXPECT_GE(owners[group].first, 0);
    EXPECT_LE(owners[group].first, end - 8 - first);
    for (int lane = 0; lane < 8; ++lane) EXPECT_EQ(first + owners[group].first + owners[group].place[lane], i[8 * group + lane]);
  }
}

// With lists so wide that most pairs are apart, and vectors are passed over or drawn together.
TEST(ActivePairs, WhetherTheyAreLookedForChangesNoBit) {
  bool short_chunk = false;
  for (const InstructionSet set : available_instruction_sets())
    for (const bool reproducible : {false, true})
      for (const scenes::LawCase& c : scenes::laws_of_scenes()) {
        SCOPED_TRACE(std::string(to_string(set)) + ", " + c.name);
        scenes::BedOptions bed;
        bed.nx = bed.ny = 6, bed.spacing = 2.02 * (1.0 - 0.7 * c.spread), bed.spread = c.spread;  // some touch, most do not
        EngineOptions engine;
        engine.instruction_set = set, engine.reproducible = reproducible;
        engine.batch = 96, engine.inner_gap = 0.9 * bed.R;
        Simulation sim(scenes::bed(bed, c.law, engine));
        sim.set_time_step(1e-5);
        sim.advance(40);
        ASSERT_GT(sim.batches().size(), 1u);
        std::int64_t contacts = 0, listed = 0;
        bool some_missed = false;
        for (const Batch& b : sim.batches()) {
          const Pass all = pass(sim, b, true, sim.leap_of(b, 1e-5));
          EXPECT_TRUE(all == pass(sim, b, false, sim.leap_of(b, 1e-5)));
          EXPECT_TRUE(all == pass(sim, b, true, -bed.R)) << "dense lists ask for no leap";
          // With a leap far below 0 whole vectors of touching pairs are left out.
          some_missed = some_missed || pass(sim, b, false, -bed.R).totals.contacts < all.totals.contacts;
          contacts += all.totals.contacts, listed += b.used;
          short_chunk = short_chunk || b.padded % chunk_size != 0;
        }
        EXPECT_GT(contacts, 0);
        EXPECT_LT(2 * contacts, listed);
        EXPECT_TRUE(some_missed) << "nothing is ever left out: the test shows nothing";
      }
  EXPECT_TRUE(short_chunk);
}

}  // namespace
}  // namespace platen
