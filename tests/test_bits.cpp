// The promises about bits: --reproducible gives the same on every instruction set, a scene that covers a case gives
// those of the narrowest one, the ledger changes none, and the quick arithmetic stays within its bound.
#include <gtest/gtest.h>

#include <cstdlib>
#include <map>
#include <set>

#include "tests/scenes.h"

namespace platen {
namespace {

using scenes::BedOptions;
using scenes::LawCase;

// 140 spheres, no multiple of a vector, in several batches, pressed from above; fast enough to part and meet again.
BedOptions colliding(double spread = 0.0) {
  BedOptions o;
  o.nx = 5, o.ny = 4, o.nz = 7;
  o.speed = 0.6;
  o.spread = spread, o.spacing = spread > 0.0 ? 1.75 : 2.02;
  return o;
}

struct Result {
  std::uint64_t hash = 0;
  Measures measures;
  bool seen[4] = {};  // branches
  std::size_t plate_contacts = 0;
  int met = 0, parted = 0;  // pairs
};

Result run(const LawCase& c, const EngineOptions& engine, int steps = 300) {
  const BedOptions o = colliding(c.spread);
  Simulation sim(scenes::bed(o, c.law, engine));
  sim.set_time_step(1e-5);
  scenes::add_plates(sim, scenes::height_of(o) + 0.02 * o.R, -0.5);
  Result r;
  const auto touching = [](const Snapshot& s) {
    std::set<std::pair<std::int64_t, std::int64_t>> pairs;
    for (std::size_t k = 0; k < s.contacts.size(); ++k) pairs.insert({s.contacts.pair[2 * k], s.contacts.pair[2 * k + 1]});
    return pairs;
  };
  auto before = touching(sim.snapshot());
  for (int block = 0; block < steps; block += 30) {
    sim.advance(30);
    const Snapshot s = sim.snapshot();
    for (const std::int8_t branch : s.contacts.branch) r.seen[branch] = true;
    r.plate_contacts += s.plate_contacts.size();
    const auto now = touching(s);
    for (const auto& pair : now) r.met += before.count(pair) == 0 ? 1 : 0;
    for (const auto& pair : before) r.parted += now.count(pair) == 0 ? 1 : 0;
    before = now;
  }
  r.hash = sim.state_hash();
  r.measures = sim.measure();
  return r;
}

EngineOptions options(InstructionSet set, bool reproducible, int scene) {
  EngineOptions engine;
  engine.instruction_set = set, engine.reproducible = reproducible, engine.scene = scene;
  engine.batch = 32;
  return engine;
}

// Of --reproducible runs after 300 steps. A scene with an exponent of its own calls pow, whose last bit is the
// business of the C library and the processor, so it has no entry. PLATEN_PRINT_GOLDEN=1 prints the table.
const std::map<std::string, std::uint64_t> golden = {
    {"elastic", 0x27e374771fbadb25ULL},
    {"cohesionless", 0x97c6222ea13f6233ULL},
    {"full", 0x4f6f2db286661800ULL},
    {"full_wide", 0xf930427395da71c1ULL},
    {"three_halves", 0x44e2d5cd59b2c9e6ULL},
};

TEST(Bits, ReproducibleIsTheSameOnEveryInstructionSet) {
  const bool print = std::getenv("PLATEN_PRINT_GOLDEN") != nullptr;
  std::vector<bool> covered(built_scenes.size(), false);
  for (const LawCase& c : scenes::laws_of_scenes()) {
    SCOPED_TRACE(c.name);
    const SceneTraits& traits = built_scenes[static_cast<std::size_t>(c.scene)].traits;
    covered[static_cast<std::size_t>(c.scene)] = true;
    const Result first = run(c, options(InstructionSet::scalar, true, c.scene));
    for (const InstructionSet set : available_instruction_sets()) {
      const Result other = run(c, options(set, true, c.scene));
      EXPECT_EQ(other.hash, first.hash) << to_string(set);
      EXPECT_EQ(other.measures.ledger.dissipated(), first.measures.ledger.dissipated()) << to_string(set);
      EXPECT_EQ(other.measures.ledger.plate_work, first.measures.ledger.plate_work) << to_string(set);
    }
    // The run went through everything that the scene has.
    const Ledger& l = first.measures.ledger;
    EXPECT_GT(first.met, 5);
    EXPECT_GT(first.parted, 5);
    EXPECT_GT(first.plate_contacts, 10u);
    EXPECT_GT(l.viscous_dissipation, 0.0);
    EXPECT_GT(l.sliding_dissipation, 0.0);
    EXPECT_GT(l.tangential_energy, 0.0);
    EXPECT_GT(l.rolling_dissipation, 0.0);  // plates roll in every scene
    EXPECT_NE(l.plate_model_work, 0.0);
    EXPECT_TRUE(first.seen[static_cast<int>(Branch::loading)]);
    if (traits.plasticity) {
      EXPECT_TRUE(first.seen[static_cast<int>(Branch::elastic)]);
      EXPECT_TRUE(first.seen[static_cast<int>(Branch::adhesive)]);
      EXPECT_GT(l.plastic_dissipation, 0.0);
    }
    if (traits.adhesion) {
      EXPECT_LT(l.adhesion_energy, 0.0);
    }
    if (traits.exponent == Exponent::any) continue;
    const std::string scene = built_scenes[static_cast<std::size_t>(c.scene)].name;
    if (print) std::printf("    {\"%s\", 0x%016llxULL},\n", scene.c_str(), static_cast<unsigned long long>(first.hash));
    const auto it = golden.find(scene);
    EXPECT_TRUE(it != golden.end() && first.hash == it->second) << "golden hash of " << scene << ": " << first.hash;
  }
  for (std::size_t k = 0; k < covered.size(); ++k) EXPECT_TRUE(covered[k]) << "no law for " << built_scenes[k].name;
}

// A gas: of the pairs that the inner list holds one in some ten touches, so that the wide kernels draw them together.
// --reproducible makes the scalar kernel, which takes pair by pair, the judge of all.
TEST(Bits, TouchingPairsAreDrawnTogetherWhereFewTouch) {
  for (const LawCase& c : scenes::laws_of_scenes()) {
    SCOPED_TRACE(c.name);
    BedOptions o;
    o.nx = 6, o.ny = 6, o.nz = 6, o.speed = 1.0, o.spread = c.spread, o.spacing = c.spread > 0.0 ? 2.1 : 2.3;
    std::set<std::uint64_t> hashes;
    std::set<double> dissipated;
    std::set<std::size_t> counts;
    for (const InstructionSet set : available_instruction_sets())
      for (const double gap : {0.8, 0.02}) {  // of R; the second lists hardly more than what touches
        EngineOptions engine = options(set, true, c.scene);
        engine.inner_gap = gap * o.R;
        Simulation sim(scenes::bed(o, c.law, engine));
        sim.set_time_step(1e-5);
        int few = 0;  // blocks with some contacts, of some 500 pairs that are listed with the wide gap
        for (int block = 0; block < 8; ++block) {
          sim.advance(40);
          const std::size_t contacts = sim.snapshot().contacts.size();
          few += contacts > 10 && contacts < 150 ? 1 : 0;
        }
        EXPECT_GT(few, 1);
        hashes.insert(sim.state_hash());
        dissipated.insert(sim.measure().ledger.dissipated());
        counts.insert(sim.snapshot().contacts.size());
      }
    EXPECT_EQ(hashes.size(), 1u);
    EXPECT_EQ(dissipated.size(), 1u);  // of exponents other than 1 also k_t of the step before, which no hash shows
    EXPECT_EQ(counts.size(), 1u);
  }
}

TEST(Bits, AHashSeesOneBit) {
  const LawCase c = scenes::laws_of_scenes()[2];
  const BedOptions o = colliding();
  SimulationSetup a = scenes::bed(o, c.law, {}), b = a;
  b.spheres.position[7] = std::nextafter(b.spheres.position[7], 1.0);
  Simulation one(a), two(b), three(a);
  EXPECT_NE(one.state_hash(), two.state_hash());
  EXPECT_EQ(one.state_hash(), three.state_hash());
  EXPECT_NE(one.state_hash(), one.state_hash("stage"));
}

// Laws that need less than any scene offers: what a scene has beyond that runs with neutral parameters.
std::vector<LawCase> modest_laws() {
  std::vector<LawCase> list;
  const PairLaw full = scenes::full_law();
  for (int k = 0; k < 16; ++k) {
    PairLaw law = full;
    if (k & 1) law.k2 = law.k1;
    if (k & 2) law.k_adh = law.f0 = 0.0;
    if (k & 4) law.rolling_friction = 0.0;
    if (k & 8) law.friction = 0.0;
    list.push_back({"n = 1", law, 0.0, -1});
  }
  PairLaw square = full;
  square.exponent = 2.0, square.k1 = 5e7, square.k2 = 2e8, square.k_adh = 2e7, square.rolling_friction = 0.0;
  list.push_back({"n = 2, no rolling", square, 0.3, -1});
  square.k2 = square.k1, square.k_adh = square.f0 = square.friction = 0.0;
  list.push_back({"n = 2, elastic, smooth", square, 0.0, -1});
  return list;
}

SceneTraits needs(const LawCase& c) {
  SceneTraits t;
  t.exponent = c.law.exponent == 1.0 ? Exponent::one : c.law.exponent == 1.5 ? Exponent::three_halves : Exponent::any;
  t.adhesion = c.law.k_adh > 0.0 || c.law.f0 != 0.0;
  t.plasticity = c.law.k2 > c.law.k1;
  t.rolling = c.law.rolling_friction > 0.0 ? Rolling::absolute : Rolling::none;
  t.equal_spheres = c.spread == 0.0;
  return t;
}

TEST(Bits, AWiderSceneGivesTheBitsOfTheNarrowest) {
  int compared = 0, relative = 0;
  for (const LawCase& c : modest_laws())
    for (const InstructionSet set : available_instruction_sets())
      for (const bool reproducible : {false, true}) {
        const SceneTraits needed = needs(c);
        const Result narrow = run(c, options(set, reproducible, -1), 120);
        for (std::size_t k = 0; k < built_scenes.size(); ++k) {
          const SceneTraits& wide = built_scenes[k].traits;
          if (!covers(wide, needed) || wide.exponent != needed.exponent) continue;
          SCOPED_TRACE(std::string(c.name) + " on " + built_scenes[k].name + ", " + to_string(set));
          const Result other = run(c, options(set, reproducible, static_cast<int>(k)), 120);
          EXPECT_EQ(other.hash, narrow.hash);
          EXPECT_EQ(other.measures.ledger.dissipated(), narrow.measures.ledger.dissipated());
          EXPECT_EQ(other.measures.energy_residual, narrow.measures.energy_residual);
          ++compared;
          if (wide.rolling == Rolling::relative) ++relative;
        }
      }
  EXPECT_GT(compared, 60);
  EXPECT_GT(relative, 0);
}

// Equal spheres whose scene reads columns, too: every pair of built scenes with the narrow one's own law.
TEST(Bits, EveryPairOfScenesThatCover) {
  int pairs = 0;
  for (const LawCase& c : scenes::laws_of_scenes())
    for (std::size_t wide = 0; wide < built_scenes.size(); ++wide) {
      const SceneTraits &narrow = built_scenes[static_cast<std::size_t>(c.scene)].traits, &other = built_scenes[wide].traits;
      if (static_cast<int>(wide) == c.scene || !covers(other, narrow) || other.exponent != narrow.exponent) continue;
      ++pairs;
      for (const InstructionSet set : available_instruction_sets())
        for (const bool reproducible : {false, true})
          EXPECT_EQ(run(c, options(set, reproducible, c.scene)).hash, run(c, options(set, reproducible, static_cast<int>(wide))).hash)
              << c.name << " on " << built_scenes[wide].name << ", " << to_string(set);
    }
  EXPECT_GE(pairs, 6);
}

TEST(Bits, TheLedgerChangesNone) {
  std::vector<LawCase> laws = scenes::laws_of_scenes();
  for (const LawCase& c : modest_laws()) laws.push_back(c);
  for (const LawCase& c : laws)
    for (const InstructionSet set : available_instruction_sets()) {
      EngineOptions with = options(set, false, -1), without = with;
      without.energy = false;
      const Result a = run(c, with, 90), b = run(c, without, 90);
      EXPECT_EQ(a.hash, b.hash) << c.name << ", " << to_string(set);
      EXPECT_EQ(a.measures.stress_top, b.measures.stress_top);
      EXPECT_GT(a.measures.ledger.viscous_dissipation, 0.0);
      EXPECT_EQ(b.measures.ledger.viscous_dissipation, 0.0);
    }
}

// Default and --reproducible kernels differ in 1/sqrt alone. With u = 2^-53:
//   1/sqrt     3 u (quick) and 2 u (exact) off the true value, so 5 u between the two; n inherits it, 6 u with its product
//   distance   reach (5 + 1) u, hence overlap 2R 6 u <= 12 u R, and f_hys k2 12 u R (a slope of at most k2)
//   f_hys, dashpots, lever arms: a handful of roundings of each part, 16 u of its size together
//   spring     turned by a further 1/sqrt: 16 u of its size, itself at most mu f_hys here
//   rounding   to the quantum q may fall to either side: q per contribution
// Per contact: 16 u (k2 2R + |f_hys| + |dashpots|) + q; a record has one contribution per contact. Positions of the two
// runs part by dt^2/m of that in a step, 1e-20 m, which is nothing beside 12 u R = 3e-18 m; three steps are allowed as
// many times the bound.
TEST(Bits, DefaultIsWithinItsBoundOfReproducible) {
  const double u = 0x1p-53;
  for (const InstructionSet set : available_instruction_sets()) {
    SCOPED_TRACE(to_string(set));
    const LawCase c = scenes::laws_of_scenes()[2];
    const BedOptions o = colliding();
    EngineOptions quick = options(set, false, -1), exact = options(set, true, -1);
    quick.batch = exact.batch = 4096;  // one batch: its sums are the particles' whole forces
    Simulation a(scenes::bed(o, c.law, quick)), b(scenes::bed(o, c.law, exact));
    a.set_time_step(1e-5), b.set_time_step(1e-5);
    double worst = 0.0;
    for (int step = 0; step <= 3; ++step) {
      if (step > 0) a.advance(1), b.advance(1);
      a.ensure_forces(), b.ensure_forces();
      const Snapshot s = b.snapshot();
      ASSERT_EQ(a.batches().size(), 1u);
      ASSERT_EQ(a.state().count, b.state().count);
      const LawConstants& law = b.law();
      const double q = 1.0 / law.force.inverse, v = 2.0 * std::sqrt(12.0) * o.speed;
      std::map<std::int64_t, double> bound;
      for (std::size_t k = 0; k < s.contacts.size(); ++k)
        for (int side = 0; side < 2; ++side)
          bound[s.contacts.pair[2 * k + static_cast<std::size_t>(side)]] +=
              16.0 * u * (law.k2 * 2.0 * o.R + std::fabs(s.contacts.normal_force[k]) + 2.0 * law.beta_n * v) + q;
      const auto sum = [](const Simulation& sim, std::int32_t rank, int field) {
        const Batch& batch = sim.batches()[0];
        const auto at = record_size * static_cast<std::size_t>(sim.state().places()[static_cast<std::size_t>(rank)]) +
                        static_cast<std::size_t>(field);
        return batch.sum[at];
      };
      for (std::int32_t rank = 0; rank < a.state().count; ++rank)
        for (int field = 0; field < 7; ++field) {
          const double allowed = (1 + step) * bound[b.state().id_of_rank[static_cast<std::size_t>(rank)]];
          const double off = std::fabs(sum(a, rank, field) - sum(b, rank, field));
          EXPECT_LE(off, allowed) << "field " << field << " of rank " << rank << ", step " << step;
          if (allowed > 0.0) worst = std::max(worst, off / allowed);
        }
    }
    RecordProperty(std::string("worst_") + to_string(set), std::to_string(worst));
  }
}

}  // namespace
}  // namespace platen
