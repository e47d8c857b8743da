// The same bits for any number of threads, executor, batch size, list width, graph length, and for any way to look at
// the run while it goes: state hash and every column of the energy ledger.
#include <gtest/gtest.h>

#include <cstring>
#include <functional>

#include "core/cache_model.h"
#include "core/simulation_state.h"
#include "tests/scenes.h"

namespace platen {
namespace {

using scenes::BedOptions;

struct Outcome {
  std::uint64_t hash = 0;
  std::vector<double> numbers;  // every measured quantity
  EngineCounters counters;
};

std::vector<double> numbers_of(const Measures& m) {
  const Ledger& l = m.ledger;
  return {m.time, m.height, m.stress_top, m.stress_bottom, m.porosity, m.coordination_number, static_cast<double>(m.contacts),
          m.kinetic_energy, m.potential_energy, m.support_force, m.weight, m.energy_residual, m.highest_point,
          l.elastic_energy, l.adhesion_energy, l.tangential_energy, l.plate_energy, l.plastic_dissipation,
          l.viscous_dissipation, l.sliding_dissipation, l.rolling_dissipation, l.plate_model_work, l.plate_work};
}

void expect_same(const Outcome& got, const Outcome& wanted, const std::string& what) {
  EXPECT_EQ(got.hash, wanted.hash) << what;
  ASSERT_EQ(got.numbers.size(), wanted.numbers.size());
  for (std::size_t k = 0; k < wanted.numbers.size(); ++k)
    EXPECT_EQ(std::memcmp(&got.numbers[k], &wanted.numbers[k], sizeof(double)), 0)
        << what << ", number " << k << ": " << got.numbers[k] << " against " << wanted.numbers[k];
}

// A periodic bed of 990 spheres, no multiple of a vector, pressed from above, with a few spheres ten times as fast as
// the rest.
SimulationSetup pressed_bed(const EngineOptions& engine) {
  BedOptions o;
  o.nx = 11, o.ny = 9, o.nz = 10, o.speed = 0.3;
  SimulationSetup setup = scenes::bed(o, scenes::full_law(), engine);
  setup.engine.instruction_set = available_instruction_sets().back();
  for (std::size_t k = 100; k < setup.spheres.id.size(); k += 211) setup.spheres.velocity[3 * k + k % 3] = 3.0;
  return setup;
}
constexpr int bed_steps = 1500;

using Way = std::function<void(Simulation&, std::int64_t steps)>;
void straight(Simulation& sim, std::int64_t steps) { sim.advance(steps); }

Outcome run(const SimulationSetup& setup, std::int64_t steps, const Way& way = straight) {
  Simulation sim(setup);
  sim.set_time_step(1e-5);
  scenes::add_plates(sim, 10 * 1.9 * 0.0025 + 5e-5, -0.3);
  sim.count_inserted();
  way(sim, steps);
  return {sim.state_hash(), numbers_of(sim.measure()), sim.counters()};
}

const Outcome& reference() {
  static const Outcome outcome = run(pressed_bed({}), bed_steps);
  return outcome;
}

TEST(Determinism, TheBedIsLively) {  // what the other tests compare is worth comparing
  const Outcome& r = reference();
  EXPECT_GT(r.counters.rebuilds, 1);
  EXPECT_GT(r.counters.prunes, 3);
  EXPECT_GT(r.numbers[2], 100.0);  // stress on the top plate [Pa]
  EXPECT_GT(r.numbers[6], 2000);   // contacts
}

TEST(Determinism, ThreadsAndExecutors) {
  for (const int threads : {1, 2, 3, 5, 8, 16})
    for (const bool fused : {false, true})
      for (const Executor executor : {Executor::flow_graph, Executor::plain_threads}) {
        EngineOptions engine;
        engine.threads = threads, engine.fused = fused, engine.executor = executor, engine.batch = 64;
        // Plain threads turn round and round while they wait: a few steps are enough for more of them than cores.
        const bool many = executor == Executor::plain_threads && threads > 3;
        const std::int64_t steps = many ? 150 : bed_steps;
        const Outcome wanted = many ? run(pressed_bed({}), steps) : reference();
        expect_same(run(pressed_bed(engine), steps), wanted,
                    std::to_string(threads) + (fused ? " fused" : " split") +
                        (executor == Executor::flow_graph ? " flow graph" : " plain threads"));
      }
}

TEST(Determinism, BatchSizes) {
  for (const int batch : {16, 64, 256})
    for (const bool fused : {false, true}) {
      EngineOptions engine;
      engine.batch = batch, engine.fused = fused;
      const Outcome r = run(pressed_bed(engine), bed_steps);
      expect_same(r, reference(), "batch " + std::to_string(batch));
      EXPECT_NEAR(r.counters.batches, 990.0 / batch, 2.0);
    }
}

// The order of a bed that no cache holds [core/task_order.h].
TEST(Determinism, OrdersForACache) {
  for (const int threads : {1, 2, 3, 8})
    for (const bool fused : {false, true})
      for (const double cache : {1e4, 1e5}) {
        EngineOptions engine;
        engine.threads = threads, engine.fused = fused, engine.batch = 16, engine.cache = cache;
        bool ordered = false, parts = false;
        engine.tamper = [&](TaskTable& table) { ordered = table.ordered(), parts = !table.worker().empty(); };
        expect_same(run(pressed_bed(engine), bed_steps), reference(), std::to_string(threads) + (fused ? " fused" : " split"));
        EXPECT_TRUE(ordered);
        EXPECT_EQ(parts, threads == 2 || threads == 3);  // 62 batches are too few for eight parts
      }
}

// What a bed that no cache holds does in its rows, on every instruction set, for one radius and for many.
TEST(Determinism, InRowsOrColumns) {
  for (const InstructionSet set : available_instruction_sets())
    for (const scenes::LawCase& c : scenes::laws_of_scenes()) {
      scenes::BedOptions o;
      o.nx = o.ny = 5, o.nz = 5, o.spread = c.spread, o.spacing = 1.9;  // 125 spheres do not fill their last vector
      EngineOptions engine;
      engine.instruction_set = set, engine.batch = 16;
      std::uint64_t hash[2];
      for (const bool in_rows : {false, true}) {
        bool ordered = false;
        engine.cache = in_rows ? 1.0 : most_ordered_cache;
        engine.tamper = [&](TaskTable& table) { ordered = table.ordered(); };
        Simulation sim(scenes::bed(o, c.law, engine));
        sim.set_time_step(1e-5);
        scenes::add_plates(sim, scenes::height_of(o) + 1e-5, -0.2);
        sim.advance(150);
        EXPECT_EQ(ordered, in_rows);
        // Elsewhere, and without sides.
        const SimulationState state = sim.whole_state();
        Simulation next(scenes::bed(o, c.law, engine));
        next.take_up(state);
        EXPECT_EQ(next.state_hash(), sim.state_hash());
        next.open_sides();
        next.advance(50);
        hash[in_rows] = next.state_hash();
      }
      EXPECT_EQ(hash[0], hash[1]) << to_string(set) << ", " << c.name;
    }
}

TEST(Determinism, AutomaticBatches) {
  for (const int threads : {1, 2, 3}) {
    EngineOptions engine;
    engine.threads = threads;
    const Outcome r = run(pressed_bed(engine), bed_steps);
    expect_same(r, reference(), std::to_string(threads) + " threads");
    // 990 spheres: one batch on one thread; two on two where work is even, else as many as 256 spheres each leave.
    if (threads == 1) EXPECT_EQ(r.counters.batches, 1);
    else EXPECT_TRUE(r.counters.batches == 3 || (threads == 2 && r.counters.batches == 2)) << r.counters.batches;
  }
}

// Both ways to share a bed in the caches, one after the other [core/quicker.h].
TEST(Determinism, WhoeverTakesTheTasks) {
  for (const int threads : {3, 8})
    for (const bool fused : {false, true}) {
      EngineOptions engine;
      engine.threads = threads, engine.fused = fused, engine.batch = 32, engine.unroll = 4;
      bool parts = false;
      engine.tamper = [&](TaskTable& table) { parts = !table.worker().empty() && !table.ordered(); };
      static_assert(bed_steps > 4 * Quicker::runs_of_block * Quicker::blocks_of_trial);
      const Outcome r = run(pressed_bed(engine), bed_steps);
      expect_same(r, reference(), std::to_string(threads) + (fused ? " fused" : " split"));
      EXPECT_TRUE(parts);
      EXPECT_GE(r.counters.runs_by_workers, Quicker::runs_of_block);
      EXPECT_LE(r.counters.runs_by_workers, bed_steps / engine.unroll - Quicker::runs_of_block);
    }
}

// With and without asking ahead, one after the other: a bed that two caches hold and half a cache does not.
TEST(Determinism, AskingOrNot) {
  EngineOptions engine;
  engine.unroll = 4;
  static_assert(bed_steps > 4 * Quicker::runs_of_block * Quicker::blocks_of_trial);
  Simulation sim(pressed_bed({}));
  sim.set_time_step(1e-5);
  sim.rebuild_now();
  const double bytes = touched_bytes(sim.batches());
  for (const double caches : {0.25, 1.0, 4.0}) {
    engine.cache = bytes / caches;
    const Outcome r = run(pressed_bed(engine), bed_steps);
    expect_same(r, reference(), std::to_string(caches) + " caches");
    const std::int64_t asking = r.counters.runs_asking, all = r.counters.runs, tried = Quicker::runs_of_block;
    EXPECT_GE(asking, caches == 4.0 ? all : caches == 1.0 ? tried : 0) << caches << " caches";
    EXPECT_LE(asking, caches == 4.0 ? all : caches == 1.0 ? all - tried : 0) << caches << " caches";
  }
}

TEST(Determinism, SkinsAndGaps) {
  const double R = 0.0025;
  for (const double skin : {0.1 * R, 0.3 * R, 0.7 * R})
    for (const double gap : {0.01 * R, 0.05 * R, 0.2 * R}) {
      EngineOptions engine;
      engine.skin = skin, engine.inner_gap = gap;
      expect_same(run(pressed_bed(engine), bed_steps), reference(),
                  "skin " + std::to_string(skin / R) + " R, gap " + std::to_string(gap / R) + " R");
    }
}

TEST(Determinism, GraphLengths) {
  for (const int unroll : {1, 7, 32, 1000})
    for (const int threads : {1, 2}) {
      EngineOptions engine;
      engine.unroll = unroll, engine.threads = threads;
      expect_same(run(pressed_bed(engine), bed_steps), reference(), "unroll " + std::to_string(unroll));
    }
  // Where nothing moves lists hold for ever; no run is longer for it than sides that are crossed can be counted.
  scenes::BedOptions apart;
  apart.spacing = 2.5, apart.speed = 0.0;
  EngineOptions engine;
  engine.unroll = 1000;
  SimulationSetup setup = scenes::bed(apart, scenes::full_law(), engine);
  setup.gravity = 0.0;
  Simulation sim(std::move(setup));
  sim.set_time_step(1e-6);
  sim.advance(10 * most_steps_of_run);
  EXPECT_EQ(sim.counters().runs, 10);
}

TEST(Determinism, LookingChangesNothing) {
  const Way often = [](Simulation& sim, std::int64_t steps) {
    for (std::int64_t k = 0; k < steps; ++k) {
      sim.advance(1);
      switch (k % 5) {
        case 0: sim.measure(); break;
        case 1: sim.snapshot(k % 2 == 0); break;
        case 2: sim.state_hash("a stage"); break;
        case 3: sim.stress(plate_top); break;
        default: break;
      }
      if (k % 250 == 0) sim.step_limits();
    }
  };
  for (const int threads : {1, 2}) {
    EngineOptions engine;
    engine.threads = threads;
    expect_same(run(pressed_bed(engine), bed_steps, often), reference(), "often");
  }
}

TEST(Determinism, RebuildsAtAnyTime) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    const Way rebuilding = [seed](Simulation& sim, std::int64_t steps) {
      scenes::Sequence random(seed);
      for (std::int64_t done = 0; done < steps;) {
        const auto n = std::min<std::int64_t>(steps - done, 1 + static_cast<std::int64_t>(random.next() * 40.0));
        sim.advance(n);
        done += n;
        sim.rebuild_now();
        if (random.next() < 0.2) sim.rebuild_now();
      }
    };
    EngineOptions engine;
    engine.fused = seed == 2, engine.batch = 128;
    expect_same(run(pressed_bed(engine), bed_steps, rebuilding), reference(), "rebuilds, seed " + std::to_string(seed));
  }
}

TEST(Determinism, TwoHundredRepetitionsGiveOneHash) {
  BedOptions o;
  o.nx = 7, o.ny = 6, o.nz = 6, o.speed = 1.0;
  for (const int threads : {2, 4}) {
    EngineOptions engine;
    engine.threads = threads, engine.batch = 16, engine.executor = Executor::flow_graph;
    engine.instruction_set = available_instruction_sets().back();
    std::uint64_t first = 0;
    for (int k = 0; k < 200; ++k) {
      engine.fused = k % 2 == 1;
      const Outcome r = run(scenes::bed(o, scenes::full_law(), engine), 100);
      if (k == 0) first = r.hash;
      EXPECT_EQ(r.hash, first) << threads << " threads, repetition " << k;
    }
  }
}

// A lattice that comes down through an outlet, sphere by sphere.
TEST(Determinism, RainFromAnOutlet) {
  const auto rain = [](int threads, bool outlet) {
    BedOptions o;
    o.nx = 11, o.ny = 9, o.nz = 10, o.spacing = 2.2;
    EngineOptions engine;
    engine.threads = threads, engine.batch = threads == 1 ? 0 : 32 * threads;
    SimulationSetup setup = scenes::bed(o, scenes::full_law(), engine);
    const std::size_t n = setup.spheres.id.size();
    setup.spheres.velocity.assign(3 * n, 0.0), setup.spheres.spin.assign(3 * n, 0.0);
    for (std::size_t k = 0; k < n; ++k) setup.spheres.velocity[3 * k + 2] = -0.5;
    Simulation sim(setup);
    sim.set_time_step(1e-5);
    scenes::add_plates(sim, 0.2, 0.0);
    sim.count_inserted();
    std::int64_t carried = 0;
    for (int look = 0; look < 100; ++look) {
      if (outlet) carried += sim.carry_down(0.01, 0.5);
      sim.advance(32);
    }
    EXPECT_EQ(carried > 0, outlet);
    EXPECT_GT(sim.measure().contacts, 100);
    return Outcome{sim.state_hash(), numbers_of(sim.measure()), sim.counters()};
  };
  const Outcome wanted = rain(1, true);
  for (const int threads : {2, 3}) expect_same(rain(threads, true), wanted, std::to_string(threads) + " threads");
  EXPECT_NE(rain(1, false).hash, wanted.hash);
}

// Sides taken away, plates removed, a step that changes: each in mid-run, with another engine.
TEST(Determinism, InterventionsInMidRun) {
  const Way eventful = [](Simulation& sim, std::int64_t steps) {
    sim.advance(steps / 5);
    sim.set_time_step(0.75e-5);
    sim.advance(steps / 5);
    sim.set_plane_velocity(plate_top, 0.4);
    sim.advance(steps / 5);
    sim.open_sides();
    sim.advance(steps / 5);
    sim.remove_plane(plate_top);
    sim.advance(steps / 5);
  };
  const Outcome wanted = run(pressed_bed({}), bed_steps, eventful);
  for (const int threads : {2, 3}) {
    EngineOptions engine;
    engine.threads = threads, engine.batch = 32 * threads, engine.fused = threads == 3, engine.unroll = 5 * threads;
    engine.inner_gap = 0.03 * 0.0025 * threads;
    expect_same(run(pressed_bed(engine), bed_steps, eventful), wanted, std::to_string(threads) + " threads");
  }
}

}  // namespace
}  // namespace platen
