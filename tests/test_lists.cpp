// No pair is missed, however fast spheres move: runs over lists against every pair looked at in every step.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <string>
#include <utility>

#include "tests/scenes.h"

namespace platen {
namespace {

using scenes::BedOptions;
using Pairs = std::set<std::pair<std::int64_t, std::int64_t>>;

struct Scene {
  const char* name;
  SimulationSetup setup;
  double dt;
  int steps;
  double z_top, top_velocity;  // no plates where z_top is 0
};

PairLaw stiff_law() {  // so that 20 m/s press spheres together by a tenth of a radius
  PairLaw law = scenes::full_law();
  law.k1 = 2e5, law.k2 = 8e5, law.k_adh = 2e4;
  return law;
}

std::vector<Scene> fast_scenes() {
  std::vector<Scene> list;
  {  // a loose cloud, falling as a whole, with a few spheres at 5 to 50 m/s in it
    BedOptions o;
    o.nx = o.ny = 6, o.nz = 7, o.spacing = 2.6, o.speed = 0.3;
    SimulationSetup s = scenes::bed(o, stiff_law(), {});
    for (std::size_t k = 0; k < s.spheres.id.size(); ++k) s.spheres.velocity[3 * k + 2] -= 1.0;
    const double speeds[] = {5, -20, 50, -35, 12};
    for (std::size_t k = 0; k < 5; ++k) s.spheres.velocity[3 * (31 + 47 * k) + k % 3] = speeds[k];
    list.push_back({"projectiles in rain", s, 5e-7, 960, scenes::height_of(o) + 1e-4, 0.0});
  }
  {  // spheres deep in one another at rest: speeds of 10 m/s out of nothing, between two looks
    BedOptions o;
    o.nx = o.ny = 5, o.nz = 6, o.spacing = 1.75, o.speed = 0.0;
    list.push_back({"burst", scenes::bed(o, stiff_law(), {}), 1e-6, 480, 0.0, 0.0});
  }
  {  // a heap at rest that a fast plate runs into
    BedOptions o;
    o.nx = o.ny = 4, o.nz = 6, o.spacing = 2.02, o.speed = 0.0;
    list.push_back({"fast plate", scenes::bed(o, stiff_law(), {}), 1e-6, 640, scenes::height_of(o) + 1e-3, -8.0});
  }
  {  // a small sphere shot through the gaps of large ones
    BedOptions o;
    o.nx = o.ny = 5, o.nz = 5, o.spacing = 1.9, o.speed = 2.0, o.spread = 0.6, o.periodic = false;
    SimulationSetup s = scenes::bed(o, stiff_law(), {});
    for (std::size_t k = 7; k < s.spheres.id.size(); k += 40) s.spheres.velocity[3 * k] = 15.0;
    list.push_back({"unequal, open sides", s, 5e-7, 640, 0.0, 0.0});
  }
  return list;
}

void begin(Simulation& sim, const Scene& scene) {
  sim.set_time_step(scene.dt);
  if (scene.z_top > 0.0) scenes::add_plates(sim, scene.z_top, scene.top_velocity);
}

// Every pair that touches, by looking at all.
Pairs touching(const Simulation& sim, const SimulationSetup& setup) {
  const Particles& p = sim.state();
  const double W = setup.periodic ? setup.width : 0.0, D = setup.periodic ? setup.depth : 0.0;
  const auto nearest = [](double d, double L) { return L > 0.0 ? std::remainder(d, L) : d; };
  Pairs pairs;
  for (std::size_t a = 0; a < static_cast<std::size_t>(p.count); ++a)
    for (std::size_t b = a + 1; b < static_cast<std::size_t>(p.count); ++b) {
      const double dx = nearest(p.x[a] - p.x[b], W), dy = nearest(p.y[a] - p.y[b], D), dz = p.z[a] - p.z[b];
      const double reach = p.radius_of(static_cast<std::int32_t>(a)) + p.radius_of(static_cast<std::int32_t>(b));
      if (!(std::sqrt(dx * dx + dy * dy + dz * dz) < reach)) continue;
      const std::int64_t i = p.id_of_rank[static_cast<std::size_t>(p.rank[a])], j = p.id_of_rank[static_cast<std::size_t>(p.rank[b])];
      pairs.insert({std::min(i, j), std::max(i, j)});
    }
  return pairs;
}

Pairs listed(Simulation& sim) {
  const Snapshot s = sim.snapshot();
  Pairs pairs;
  for (std::size_t k = 0; k < s.contacts.size(); ++k) pairs.insert({s.contacts.pair[2 * k], s.contacts.pair[2 * k + 1]});
  return pairs;
}

TEST(Lists, NoPairIsMissedAtAnySpeed) {
  std::int64_t redone = 0, spared = 0, redone_in_rows = 0, spared_in_rows = 0;
  for (Scene scene : fast_scenes()) {
    SCOPED_TRACE(scene.name);
    scene.setup.engine.instruction_set = available_instruction_sets().back();
    scene.setup.engine.batch = 32;
    // Chunks of 32 over lists as the engine sees fit, one step at a time over the same lists, and one step at a time
    // with new lists before each; and chunks as beds make them that no cache holds.
    SimulationSetup large = scene.setup;
    large.engine.cache = 1.0;
    Simulation chunks(scene.setup), single(scene.setup), fresh(scene.setup), in_rows(large);
    begin(chunks, scene), begin(single, scene), begin(fresh, scene), begin(in_rows, scene);
    std::size_t met = 0;
    Pairs before = touching(single, scene.setup);
    for (int step = 1; step <= scene.steps; ++step) {
      single.advance(1);
      fresh.rebuild_now();
      fresh.advance(1);
      const Pairs all = touching(single, scene.setup);
      ASSERT_EQ(listed(single), all) << "step " << step;
      ASSERT_EQ(single.measure().contacts, static_cast<std::int64_t>(all.size())) << "step " << step;
      for (const auto& pair : all) met += before.count(pair) == 0 ? 1 : 0;
      before = all;
      if (step % 32 != 0) continue;
      chunks.advance(32), in_rows.advance(32);
      const std::uint64_t hash = fresh.state_hash();
      ASSERT_EQ(in_rows.state_hash(), hash) << "step " << step;
      ASSERT_EQ(chunks.state_hash(), hash) << "step " << step;
      ASSERT_EQ(single.state_hash(), hash) << "step " << step;
      ASSERT_EQ(chunks.measure().energy_residual, fresh.measure().energy_residual) << "step " << step;
    }
    EXPECT_GT(met, 10u) << "pairs that met";
    EXPECT_EQ(fresh.counters().rebuilds, scene.steps + 1);
    RecordProperty(std::string("redone, ") + scene.name, static_cast<int>(chunks.counters().redone_steps));
    redone += chunks.counters().redone_steps;
    spared += chunks.counters().spared_steps;
    redone_in_rows += in_rows.counters().redone_steps, spared_in_rows += in_rows.counters().spared_steps;
  }
  EXPECT_GT(redone, 0) << "the way back was never taken";
  EXPECT_GT(spared, 0) << "no sphere went beyond its margin where it could meet nobody";
  EXPECT_GT(redone_in_rows, 0);
  EXPECT_GT(spared_in_rows, 0);
}

// Spheres that are pushed onto a plate which they are not listed with, where no other sphere is near: it counts as a neighbour
// too. They go 0.067 R in 32 steps: farther than to the plate, less than the outer lists allow.
// Boxes of two to six cells a side, with spheres on the edges of box and cells: images are looked for pair by pair where there
// are less than three.
TEST(Lists, NoPairIsMissedInNarrowBoxes) {
  for (const InstructionSet set : available_instruction_sets())
    for (int nx = 3; nx <= 7; ++nx)
      for (int ny = 3; ny <= 7; ++ny) {
        BedOptions o;
        o.nx = nx, o.ny = ny, o.nz = 5, o.spread = 0.05;
        SimulationSetup setup = scenes::bed(o, stiff_law(), {});
        setup.engine.instruction_set = set;
        setup.engine.batch = 16;
        // The first sphere of each row comes to stand on an edge of a cell, the row with it.
        for (int row = 0; row < ny * o.nz; ++row) {
          double* x = setup.spheres.position.data() + 3 * nx * row;
          const int cells = 1 + row % 5;
          const double shift = setup.width * (row % cells) / cells - x[0];
          for (int i = 1; i < nx; ++i) x[3 * i] += shift;
          x[0] = setup.width * (row % cells) / cells;
        }
        Simulation sim(setup);
        sim.ensure_forces();
        const Pairs all = touching(sim, setup);
        EXPECT_GT(2 * all.size(), setup.spheres.id.size());
        EXPECT_EQ(listed(sim), all) << nx << " x " << ny;
        EXPECT_EQ(sim.measure().contacts, static_cast<std::int64_t>(all.size())) << nx << " x " << ny;
      }
}

TEST(Lists, NoPlateIsMissedByASphereThatIsPushed) {
  BedOptions o;
  o.nx = o.ny = 4, o.nz = 2, o.spacing = 3.0, o.speed = 0.0;
  SimulationSetup setup = scenes::bed(o, stiff_law(), {});
  setup.engine.instruction_set = available_instruction_sets().back();
  for (std::size_t k = 0; k < setup.spheres.id.size(); ++k)  // deep in one another, above the plate: the lower one is shot down
    setup.spheres.position[3 * k + 2] = k < 16 ? 1.06 * o.R : 2.56 * o.R;
  Simulation chunks(setup), fresh(setup);
  for (Simulation* sim : {&chunks, &fresh}) {
    sim->set_time_step(4.9e-7);
    scenes::add_plates(*sim, 20.0 * o.R, 0.0);
  }
  int pressed = 0;  // steps
  for (int step = 0; step < 32; ++step) {
    fresh.rebuild_now();
    fresh.advance(1);
    pressed += fresh.measure().stress_bottom > 0.0 ? 1 : 0;
  }
  chunks.advance(32);
  EXPECT_GT(pressed, 0) << fresh.state().z[0] / o.R;
  EXPECT_LT(pressed, 16);
  EXPECT_EQ(chunks.state_hash(), fresh.state_hash());
}

// The same onto spheres that are farther off than even the outer lists reach.
TEST(Lists, NoSphereBeyondTheOuterListsIsMissedEither) {
  BedOptions o;
  o.nx = o.ny = 4, o.nz = 3, o.spacing = 3.0, o.speed = 0.0;
  PairLaw law = stiff_law();
  law.k2 = law.k1, law.k_adh = law.f0 = 0.0, law.restitution = 1.0;
  SimulationSetup setup = scenes::bed(o, law, {});
  setup.gravity = 0.0;
  setup.engine.instruction_set = available_instruction_sets().back();
  for (std::size_t k = 0; k < setup.spheres.id.size(); ++k)
    setup.spheres.position[3 * k + 2] = k < 16 ? 2.0 * o.R : k < 32 ? 4.2 * o.R : 5.7 * o.R;
  Simulation chunks(setup), fresh(setup);
  for (Simulation* sim : {&chunks, &fresh}) sim->set_time_step(1.2e-6);
  for (int step = 0; step < 32; ++step) {
    fresh.rebuild_now();
    fresh.advance(1);
  }
  chunks.advance(32);
  std::size_t met = 0;
  for (const auto& [low, high] : listed(fresh)) met += low < setup.spheres.id[16] && high >= setup.spheres.id[16] ? 1 : 0;
  EXPECT_EQ(met, 16u) << "of the lowest layer";
  EXPECT_EQ(chunks.state_hash(), fresh.state_hash());
}

// Steps done again leave no trace with several threads and in other laws either.
TEST(Lists, StepsDoneAgainLeaveNoTrace) {
  for (const scenes::LawCase& c : scenes::laws_of_scenes()) {
    SCOPED_TRACE(c.name);
    BedOptions o;
    o.nx = o.ny = 5, o.nz = 6, o.spread = c.spread, o.spacing = 1.6, o.speed = 0.02;  // with spins, which the first kick slows
    SimulationSetup setup = scenes::bed(o, c.law, {});
    // A layer goes through a side in the first runs, which are done again, and on until the last.
    double farthest = 0.0;
    for (std::size_t k = 0; k < setup.spheres.id.size(); ++k) farthest = std::max(farthest, setup.spheres.position[3 * k]);
    for (std::size_t k = 0; k < setup.spheres.id.size(); ++k) setup.spheres.position[3 * k] += setup.width - 1e-6 - farthest, setup.spheres.velocity[3 * k] += 0.3;
    setup.engine.instruction_set = available_instruction_sets().back();
    setup.engine.batch = 16;
    const double z_top = scenes::height_of(o) + 1e-5;
    SimulationSetup other = setup;
    other.engine.inner_gap = 0.8 * o.R, other.engine.skin = o.R, other.engine.unroll = 1;
    setup.engine.inner_gap = 1e-3 * o.R, setup.engine.threads = 2;
    SimulationSetup large = setup;
    large.engine.cache = 1.0;
    Simulation narrow(setup), wide(other), in_rows(large);
    for (Simulation* sim : {&narrow, &wide, &in_rows}) {
      sim->set_time_step(1e-5);
      scenes::add_plates(*sim, z_top, -0.2);
      sim->count_inserted();
      sim->advance(320);
    }
    EXPECT_GT(narrow.counters().redone_steps, 0);
    EXPECT_GT(in_rows.counters().redone_steps, 0);
    const std::vector<std::int32_t> boxes = wide.snapshot().particles.image;
    EXPECT_GT(std::count(boxes.begin(), boxes.end(), 1), 10);
    EXPECT_EQ(narrow.snapshot().particles.image, boxes);
    EXPECT_EQ(in_rows.snapshot().particles.image, boxes);
    EXPECT_EQ(narrow.state_hash(), wide.state_hash());
    EXPECT_EQ(in_rows.state_hash(), wide.state_hash());
    EXPECT_EQ(in_rows.measure().energy_residual, wide.measure().energy_residual);
    const Measures a = narrow.measure(), b = wide.measure();
    EXPECT_EQ(a.energy_residual, b.energy_residual);
    EXPECT_EQ(a.ledger.dissipated(), b.ledger.dissipated());
    EXPECT_EQ(a.ledger.plate_work, b.ledger.plate_work);
  }
}

// The places that fill up the last vector rest while the bed falls: they must not pass for fast spheres.
TEST(Lists, PaddingDoesNotMove) {
  BedOptions o;
  o.nx = o.ny = 3, o.nz = 3, o.spacing = 2.5, o.speed = 0.0;  // 27 spheres
  SimulationSetup s = scenes::bed(o, scenes::full_law(), {});
  for (std::size_t k = 0; k < s.spheres.id.size(); ++k) s.spheres.velocity[3 * k + 2] = -5.0;
  Simulation sim(s);
  sim.set_time_step(1e-5);
  sim.advance(2000);  // 0.1 m, 40 radii
  EXPECT_LE(sim.counters().rebuilds, 4);
  EXPECT_LE(sim.counters().prunes, 8);
  EXPECT_LE(sim.counters().redone_steps, 32);  // the first steps, before the common velocity is known
}

// Whoever owns a pair across two batches, each is listed once, and none is missing: by colour, one batch has them all. Where the curve meets a border
// from both sides, each has about half of it; at the only border of an open bed everything is ahead of the first batch.
TEST(Batches, ShareWhatLiesBetweenThem) {
  struct Case {
    int nx, ny, nz;
    bool periodic, shared;
  };
  for (const Case& c : {Case{16, 6, 6, true, true}, {15, 5, 7, true, true}, {16, 6, 6, false, false}, {40, 30, 30, false, true}}) {
    SCOPED_TRACE(std::to_string(c.nx) + " x " + std::to_string(c.ny) + " x " + std::to_string(c.nz));
    std::set<std::pair<std::int32_t, std::int32_t>> across[2];
    for (const bool fused : {false, true}) {
      BedOptions bed;
      bed.nx = c.nx, bed.ny = c.ny, bed.nz = c.nz, bed.periodic = c.periodic;
      EngineOptions engine;
      engine.batch = (bed.nx * bed.ny * bed.nz + 1) / 2, engine.fused = fused;
      Simulation sim(scenes::bed(bed, scenes::full_law(), engine));
      sim.ensure_forces();
      ASSERT_EQ(sim.batches().size(), 2u);
      int owned[2] = {0, 0}, listed = 0;
      for (std::size_t k = 0; k < 2; ++k) {
        const Batch& b = sim.batches()[k];
        std::vector<std::int32_t> owner(b.outer_j.size() + OwnedCounts::beyond, -1);
        b.outer_owned.name_owners(b.first, owner.data());
        for (std::size_t m = 0; m < b.outer_j.size(); ++m) {
          const std::int32_t i = owner[m], j = b.outer_j[m];
          ASSERT_GE(i, b.first);
          if (j >= b.first && j < b.first + b.count) continue;
          across[fused].insert({std::min(i, j), std::max(i, j)});
          ++owned[k], ++listed;
        }
        EXPECT_EQ(b.partners.size(), owned[k] > 0 ? 1u : 0u);
        EXPECT_EQ(sim.batches()[1 - k].owners.size(), b.partners.size());
      }
      EXPECT_GT(listed, 0);
      EXPECT_EQ(across[fused].size(), static_cast<std::size_t>(listed));
      if (fused || !c.shared) {
        EXPECT_TRUE(owned[0] == 0 || owned[1] == 0);
      } else {
        EXPECT_GT(std::min(owned[0], owned[1]), 0.25 * listed);
      }
    }
    EXPECT_EQ(across[0], across[1]);
  }
}

double distance(const Particles& p, std::size_t i, std::size_t j, double width, double depth) {
  const double dx = std::remainder(p.x[i] - p.x[j], width), dy = std::remainder(p.y[i] - p.y[j], depth), dz = p.z[i] - p.z[j];
  return std::sqrt(dx * dx + dy * dy + dz * dz);
}
bool remembers(const Batch& b, std::size_t k) {
  return b.sp[k] != 0.0 || b.tx[k] != 0.0 || b.ty[k] != 0.0 || b.tz[k] != 0.0 || (!b.k_t_last.empty() && b.k_t_last[k] != 0.0);
}
PairLaw bouncing_law(double exponent) {  // a little plasticity and no cohesion, lest they stay together
  PairLaw law = scenes::full_law();
  law.k2 = 1.2 * law.k1, law.k_adh = law.f0 = 0.0, law.restitution = 0.9, law.exponent = exponent;
  if (exponent != 1.0) law.k1 *= 30.0, law.k2 *= 30.0;  // N/m^n
  return law;
}

// The kernels pass over pairs that cannot have touched at the last step, by the bound of what a pair's distance may have
// changed in it. No pair's changes by more, and whoever parts forgets at once, also where few pairs touch and are drawn together.
TEST(Lists, PairsThatPartedRememberNothing) {
  for (const InstructionSet set : available_instruction_sets())
    for (const double exponent : {1.0, 1.5})
      for (const int batch : {0, 16}) {
        SCOPED_TRACE(std::string(to_string(set)) + ", exponent " + std::to_string(exponent) + ", batch " + std::to_string(batch));
        BedOptions o;
        o.nx = o.ny = 6, o.nz = 7, o.spacing = 2.4, o.speed = 0.5;
        EngineOptions engine;
        engine.instruction_set = set, engine.batch = batch, engine.inner_gap = 0.3 * o.R, engine.threads = 2;
        SimulationSetup setup = scenes::bed(o, bouncing_law(exponent), engine);
        for (std::size_t k = 0; k < setup.spheres.id.size(); ++k) setup.spheres.velocity[3 * k + 2] -= 1.0;  // falling as a whole
        for (std::size_t k = 0; k < 4; ++k) setup.spheres.velocity[3 * (31 + 53 * k) + k % 3] = k % 2 == 0 ? 12.0 : -12.0;
        Simulation sim(setup);
        const double dt = 2e-6;
        sim.set_time_step(dt);
        std::size_t listed = 0, touching = 0, parted = 0;
        double nearest_to_leap = 0.0;
        std::map<std::pair<std::int32_t, std::int32_t>, double> before;
        for (int step = 0; step < 1500; ++step) {
          sim.advance(1);
          std::map<std::pair<std::int32_t, std::int32_t>, double> now;
          const Particles& p = sim.state();
          for (const Batch& b : sim.batches()) {
            const double leap = sim.leap_of(b, dt);
            for (std::size_t k = 0; k < static_cast<std::size_t>(b.used); ++k) {
              const auto i = static_cast<std::size_t>(b.i(k)), j = static_cast<std::size_t>(b.j(k));
              const std::pair<std::int32_t, std::int32_t> pair = std::minmax(p.rank[i], p.rank[j]);
              const double d = now[pair] = distance(p, i, j, setup.width, setup.depth);
              const auto last = before.find(pair);
              if (last != before.end()) {
                ASSERT_LE(std::abs(d - last->second), leap) << "step " << step;
                nearest_to_leap = std::max(nearest_to_leap, std::abs(d - last->second) / leap);
              }
              ++listed, touching += d < 2.0 * o.R;
              if (d < 2.0 * o.R * (1.0 - 1e-12)) continue;
              parted += last != before.end() && last->second < 2.0 * o.R;
              ASSERT_FALSE(d > 2.0 * o.R * (1.0 + 1e-12) && remembers(b, k)) << "step " << step;
            }
          }
          before = now;
        }
        EXPECT_GT(parted, 20u);
        EXPECT_GT(nearest_to_leap, 0.5) << "the bound is never nearly reached: the test shows little";
        EXPECT_LT(touching * 4, listed) << "a dense bed: nothing is passed over";
      }
}

// Two spheres that just touch, by a rounding error, and recede with all the speed there is: what rounding adds to their way
// is within the bound as well.
TEST(Lists, SpheresThatJustTouchedRememberNothing) {
  scenes::Sequence random(7);
  int touched = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    SimulationSetup setup;
    setup.pair = bouncing_law(1.0);
    setup.gravity = 0.0;
    const double R = 0.0025, x = random.between(0.01, 0.2), y = random.between(0.01, 0.2), z = random.between(0.01, 0.2);
    setup.spheres.id = {1, 2};
    const double a = random.between(-1, 1), b = random.between(-1, 1), c = random.between(-1, 1);
    const double reach = 2.0 * R / std::sqrt(a * a + b * b + c * c), speed = 1e-6;
    setup.spheres.position = {x, y, z, x + reach * a, y + reach * b, z + reach * c};
    setup.spheres.velocity = {-speed * a, -speed * b, -speed * c, speed * a, speed * b, speed * c};
    setup.spheres.radius = {R, R}, setup.spheres.density = {2000.0, 2000.0};
    setup.engine.inner_gap = 0.3 * R;
    Simulation sim(setup);
    sim.set_time_step(1e-6);
    sim.ensure_forces();
    ASSERT_EQ(sim.batches().size(), 1u);
    const Batch& batch = sim.batches()[0];
    if (batch.used == 0 || !remembers(batch, 0)) continue;  // rounded apart
    ++touched;
    sim.advance(1);
    ASSERT_FALSE(remembers(batch, 0)) << "trial " << trial;
  }
  EXPECT_GT(touched, 500);
}

}  // namespace
}  // namespace platen
