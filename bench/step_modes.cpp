#include "bench/step_modes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <thread>

#include "bench/parallel_for_step.h"
#include "bench/reference_loops.h"
#include "bench/scalar_step.h"
#include "core/huge_pool.h"

namespace platen::bench {

namespace {

std::int64_t steps_of(const StepOptions& o, std::size_t particles) {
  if (o.steps > 0) return o.steps;
  const double wanted = o.seconds * 15e6 / static_cast<double>(particles);
  return std::max<std::int64_t>(1, std::llround(wanted / 32.0)) * 32;  // whole runs of the graph
}

double rate(std::size_t particles, std::int64_t steps, double seconds) {
  return 1e-6 * static_cast<double>(particles) * static_cast<double>(steps) / seconds;
}

std::int64_t listed_pairs(const Simulation& sim) {
  std::int64_t all = 0;
  for (const Batch& b : sim.batches()) all += b.used;
  return all;
}

// What every row says of the state that was timed.
nlohmann::json row_of(Simulation& sim, const BenchScene& scene, int threads) {
  const Measures now = sim.measure(false);
  const auto n = static_cast<double>(sim.particles());
  return {{"particles", sim.particles()},
          {"scene", scene.name},
          {"kernels", built_scenes[static_cast<std::size_t>(sim.kernels().scene)].name},
          {"set", to_string(sim.kernels().instruction_set)},
          {"threads", threads},
          {"Z", now.coordination_number},
          {"contacts", static_cast<double>(now.contacts) / n},
          {"listed", static_cast<double>(listed_pairs(sim)) / n},
          {"batches", sim.counters().batches}};
}

void add_time(nlohmann::json& row, Simulation& sim, const Timing& timing, std::int64_t steps, int threads) {
  const auto n = static_cast<std::size_t>(sim.particles());
  const double contacts = row["contacts"].get<double>() * static_cast<double>(n), seconds = timing.typical();
  row["rate"] = rate(n, steps, seconds);
  row["best"] = rate(n, steps, timing.best());
  if (contacts > 0.0) row["ns"] = 1e9 * seconds * threads / (contacts * static_cast<double>(steps));
  row["steps"] = steps, row["rounds"] = timing.seconds.size(), row["dropped"] = timing.dropped;
  row["steal_kept"] = timing.steal_kept;
  row["rebuilds"] = sim.counters().rebuilds, row["prunes"] = sim.counters().prunes;
  row["redone"] = sim.counters().redone_steps, row["total_steps"] = sim.step();
}

std::string hash_of(Simulation& sim) { return fmt::format("{:016x}", sim.state_hash()); }

constexpr double most_spheres_side_by_side = 4e6;  // 3 GB

// Beds that have nothing to do with each other, each on a thread of its own: what as many cores make of each other's caches and memory.
Variant side_by_side(const std::string& name, const std::vector<std::unique_ptr<Simulation>>& sims, std::int64_t steps) {
  return {name, [&sims, steps] {
            return seconds_of([&] {
              std::vector<std::thread> team;
              for (const auto& sim : sims) team.emplace_back([&sim, steps] { sim->advance(steps); });
              for (std::thread& thread : team) thread.join();
            });
          }};
}

Variant stepping(const std::string& name, Simulation& sim, std::int64_t steps) {
  return {name, [&sim, steps] { return seconds_of([&] { sim.advance(steps); }); }};
}

const Column particles_column{"particles", "particles", 10, 0}, set_column{"set", "isa", 8, 0},
    scene_column{"scene", "scene", 17, 0}, z_column{"Z", "Z", 7, 2}, fma_column{"fma", "FMA Gf/s", 10, 1},
    l2_column{"l2", "L2 GB/s", 9, 0}, l3_column{"l3", "L3 GB/s", 9, 0}, cores_column{"cores", "cores ns", 9, 0}, state_column{"state", "state", 7, 2},
    hash_column{"hash", "hash after warm-up", 20, 0};

}  // namespace

BenchEngine engine_of(const StepOptions& o, InstructionSet set, int threads) {
  BenchEngine engine;
  engine.set = set, engine.threads = threads, engine.batch = o.batch, engine.unroll = o.unroll;
  engine.cache = o.cache * (1 << 20);
  engine.skin = o.skin * bench_radius, engine.gap = o.gap * bench_radius;
  return engine;
}

void table_of_steps(const StepOptions& o) {
  Table table("Whole step, M particle-steps/s", {particles_column,
                                                 scene_column,
                                                 {"threads", "threads", 8, 0},
                                                 set_column,
                                                 {"rate", "M/s"},
                                                 {"best", "best"},
                                                 {"ns", "ns/contact", 12},
                                                 z_column,
                                                 {"contacts", "c/particle", 11},
                                                 {"listed", "listed", 8},
                                                 {"rebuilds", "rebuilds"},
                                                 {"memory", "B/particle", 11, 0},
                                                 fma_column,
                                                 l2_column,
                                                 l3_column,
                                                 cores_column,
                                                 state_column,
                                                 hash_column});
  for (const std::int64_t particles : either(o.particles, {5000, 35000})) {
    const Bed bed = dense_bed(particles, o.beds);
    for (const std::string& name : either(o.scenes, {"full"}))
      for (const InstructionSet set : sets_of(o))
        for (const int threads : either(o.threads, {1, 2})) {
          const BenchScene scene = bench_scene(name);
          trim_pool();  // what the benches before have left there would serve this one, and not be counted
          const double before = resident_bytes();
          const auto sim = make_simulation(bed, scene, engine_of(o, set, threads));
          sim->advance(o.warm);
          const double memory = (resident_bytes() - before) / static_cast<double>(bed.size());
          const std::string hash = hash_of(*sim);
          const std::int64_t steps = steps_of(o, bed.size());
          const Timing timing = run_in_turn({stepping(name, *sim, steps)}, o.rounds).front();
          nlohmann::json row = row_of(*sim, scene, threads);
          add_time(row, *sim, timing, steps, threads);
          row["hash"] = hash;
          row["memory"] = memory;
          add_reference(row, set);
          table.add(row);
        }
  }
  write_json(o.json, "step", table);
}

void table_of_threads(const StepOptions& o) {
  Table table("One thread against many, blocks in turn", {particles_column,
                                                          set_column,
                                                          {"threads", "threads", 8, 0},
                                                          {"rate_one", "M/s, 1"},
                                                          {"rate", "M/s, many", 11},
                                                          {"speedup", "speed-up"},
                                                          {"apart", "side by side", 13},
                                                          {"rounds", "pairs", 7, 0},
                                                          {"dropped", "dropped", 9, 0},
                                                          {"same", "same bits"},
                                                          z_column,
                                                          fma_column,
                                                          l2_column,
                                                          l3_column,
                                                          cores_column,
                                                          state_column});
  const std::vector<int> given = either(o.threads, {2});
  const int many = *std::max_element(given.begin(), given.end());
  for (const std::int64_t particles : either(o.particles, {35000, 280000, 1000000})) {
    const Bed bed = dense_bed(particles, o.beds);
    for (const InstructionSet set : sets_of(o)) {
      const BenchScene scene = bench_scene("full");
      const auto one = make_simulation(bed, scene, engine_of(o, set, 1));
      const auto team = make_simulation(bed, scene, engine_of(o, set, many));
      // Simulations of their own: `one` and `team` stay at the same step. Not where they would take more than some gigabytes.
      std::vector<std::unique_ptr<Simulation>> apart;
      for (int k = 0; k < many && many * static_cast<double>(particles) <= most_spheres_side_by_side; ++k) {
        apart.push_back(make_simulation(bed, scene, engine_of(o, set, 1)));
        apart.back()->advance(o.warm);
      }
      one->advance(o.warm), team->advance(o.warm);
      const bool same = one->state_hash() == team->state_hash();
      const std::int64_t steps = steps_of(o, bed.size());
      std::vector<Variant> variants = {stepping("one", *one, steps), stepping("many", *team, steps)};
      if (!apart.empty()) variants.push_back(side_by_side("apart", apart, steps));
      const auto timings = run_in_turn(variants, o.rounds);
      nlohmann::json row = row_of(*team, scene, many);
      add_time(row, *team, timings[1], steps, many);
      row["rate_one"] = rate(bed.size(), steps, timings[0].typical());
      row["speedup"] = median_ratio(timings[0], timings[1]);
      if (!apart.empty()) row["apart"] = many * median_ratio(timings[0], timings[2]);
      row["same"] = same;
      add_reference(row, set);
      table.add(row);
    }
  }
  write_json(o.json, "threads", table);
}

void table_of_features(const StepOptions& o) {
  Table table("What a feature costs: time of a scene over that of the full one, one thread, blocks in turn",
              {particles_column,
               set_column,
               scene_column,
               {"kernels", "kernels", 18, 0},
               {"rate", "M/s"},
               {"relative", "time/full"},
               {"ns", "ns/contact", 12},
               z_column,
               {"listed", "listed", 8},
               {"rebuilds", "rebuilds"},
               fma_column,
               state_column,
               hash_column});
  for (const std::int64_t particles : either(o.particles, {35000})) {
    const Bed bed = dense_bed(particles, o.beds);
    for (const InstructionSet set : sets_of(o)) {
      std::vector<BenchScene> scenes;
      for (const BenchScene& scene : bench_scenes()) {
        const bool asked =
            o.scenes.empty() || std::find(o.scenes.begin(), o.scenes.end(), scene.name) != o.scenes.end();
        if (scene.top && (asked || scene.name == "full")) scenes.push_back(scene);
      }
      std::vector<std::unique_ptr<Simulation>> sims;
      std::vector<Variant> variants;
      std::vector<std::string> hashes;
      const std::int64_t steps = steps_of(o, bed.size());
      for (const BenchScene& scene : scenes) {
        sims.push_back(make_simulation(bed, scene, engine_of(o, set, 1)));
        sims.back()->advance(o.warm);
        hashes.push_back(hash_of(*sims.back()));
        variants.push_back(stepping(scene.name, *sims.back(), steps));
      }
      const auto timings = run_in_turn(variants, o.rounds);
      for (std::size_t k = 0; k < scenes.size(); ++k) {
        nlohmann::json row = row_of(*sims[k], scenes[k], 1);
        add_time(row, *sims[k], timings[k], steps, 1);
        row["relative"] = median_ratio(timings[k], timings[0]);
        row["hash"] = hashes[k];
        add_reference(row, set);
        table.add(row);
      }
    }
  }
  write_json(o.json, "features", table);
}

bool table_of_scalar(const StepOptions& o) {
  Table table("platen on one thread against the plain scalar half-list step, blocks in turn",
              {particles_column,
               scene_column,
               set_column,
               {"rate", "platen M/s", 12},
               {"scalar", "scalar M/s", 12},
               {"ratio", "ratio", 8},
               {"agrees", "|dx|/R", 9, 0},
               z_column,
               {"scalar_contacts", "scalar c", 10},
               {"scalar_listed", "listed", 8},
               fma_column,
               l2_column,
               l3_column,
               cores_column,
               state_column});
  if (!ScalarStep::available()) {
    fmt::print("  skipped: the yardstick is built for AVX2 and FMA, which this processor lacks\n");
    return true;
  }
  bool right = true;
  for (const std::int64_t particles : either(o.particles, {5000, 35000})) {
    const Bed bed = dense_bed(particles, o.beds);
    for (const std::string& name : either(o.scenes, {"full", "no_plates"})) {
      const BenchScene scene = bench_scene(name);
      const double difference = scalar_difference(bed, scene, 100);
      right = right && difference < 1e-9;
      for (const InstructionSet set : sets_of(o)) {
        const auto sim = make_simulation(bed, scene, engine_of(o, set, 1));
        ScalarStep scalar(bed, scene);
        sim->advance(o.warm), scalar.advance(o.warm);
        const std::int64_t steps = steps_of(o, bed.size());
        const auto timings = run_in_turn(
            {stepping("platen", *sim, steps), {"scalar", [&] { return seconds_of([&] { scalar.advance(steps); }); }}},
            o.rounds);
        nlohmann::json row = row_of(*sim, scene, 1);
        add_time(row, *sim, timings[0], steps, 1);
        const auto n = static_cast<double>(bed.size());
        row["scalar"] = rate(bed.size(), steps, timings[1].typical());
        row["ratio"] = median_ratio(timings[1], timings[0]);
        row["difference"] = difference;
        row["agrees"] = fmt::format("{:.0e}", difference);
        row["scalar_contacts"] = static_cast<double>(scalar.contacts()) / n;
        row["scalar_listed"] = static_cast<double>(scalar.listed()) / n;
        row["scalar_rebuilds"] = scalar.rebuilds();
        add_reference(row, set);
        table.add(row);
      }
    }
  }
  write_json(o.json, "scalar", table);
  if (!right) fmt::print(stderr, "bench_step: the scalar step and platen do not agree to 1e-9 R after 100 steps\n");
  return right;
}

void table_of_rebuilds(const StepOptions& o) {
  Table table("A rebuild: Morton sort, outer and inner lists, history, graph", {particles_column,
                                                                                {"threads", "threads", 8, 0},
                                                                                {"wall", "ns/particle", 13, 0},
                                                                                {"cpu", "cpu ns/particle", 17, 0},
                                                                                z_column,
                                                                                {"listed", "listed", 8},
                                                                                fma_column,
                                                                                l2_column,
                                                                                l3_column,
                                                                                cores_column,
                                                                                state_column});
  for (const std::int64_t particles : either(o.particles, {35000}))
    for (const int threads : either(o.threads, {1, 2})) {
      const Bed bed = dense_bed(particles, o.beds);
      const InstructionSet set = sets_of(o).front();
      const BenchScene scene = bench_scene("full");
      const auto sim = make_simulation(bed, scene, engine_of(o, set, threads));
      sim->advance(32);
      constexpr int times = 4;
      std::vector<double> cpu;
      const Timing timing = run_in_turn({{"rebuild",
                                          [&] {
                                            const std::clock_t start = std::clock();
                                            const double seconds = seconds_of([&] {
                                              for (int k = 0; k < times; ++k) sim->rebuild_now();
                                            });
                                            cpu.push_back(static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC);
                                            return seconds;
                                          }}},
                                        o.rounds)
                                .front();
      nlohmann::json row = row_of(*sim, scene, threads);
      const double each = 1e9 / (times * static_cast<double>(bed.size()));
      row["wall"] = each * timing.typical(), row["cpu"] = each * median(cpu);
      add_reference(row, set);
      table.add(row);
    }
  write_json(o.json, "rebuilds", table);
}

bool table_of_executors(const StepOptions& o) {
  Table table("The flow graph against two parallel_for a step, blocks in turn, M particle-steps/s",
              {particles_column,
               set_column,
               {"threads", "threads", 8, 0},
               {"split", "graph"},
               {"fused", "fused"},
               {"rate", "parallel_for", 14},
               {"ratio", "graph/p_for", 12},
               {"same", "same bits"},
               z_column,
               {"batches", "batches"},
               fma_column,
               state_column});
  bool right = true;
  for (const std::int64_t particles : either(o.particles, {5000, 35000, 280000})) {
    const Bed bed = dense_bed(particles, o.beds);
    for (const InstructionSet set : sets_of(o))
      for (const int threads : either(o.threads, {2})) {
        const BenchScene scene = bench_scene("full");
        BenchEngine engine = engine_of(o, set, threads);
        engine.executor = Executor::flow_graph;
        const auto split = make_simulation(bed, scene, engine);
        engine.fused = true;
        const auto fused = make_simulation(bed, scene, engine);
        split->advance(o.warm), fused->advance(o.warm);
        split->rebuild_now();
        ParallelForStep loops(*split, scene.law, scene.gravity, threads);
        const std::int64_t sorted = split->counters().rebuilds;
        split->advance(16), fused->advance(16), loops.advance(16);
        // Comparable only where the Simulation has not sorted its spheres anew in between.
        const bool comparable = split->counters().rebuilds == sorted;
        const bool same = comparable && loops.same_bits(*split);
        right = right && (same || !comparable);
        const std::int64_t steps = steps_of(o, bed.size());
        const auto timings =
            run_in_turn({stepping("split", *split, steps),
                         stepping("fused", *fused, steps),
                         {"loops", [&] { return seconds_of([&] { loops.advance(static_cast<int>(steps)); }); }}},
                        o.rounds);
        nlohmann::json row = row_of(*split, scene, threads);
        add_time(row, *split, timings[2], steps, threads);
        row["split"] = rate(bed.size(), steps, timings[0].typical());
        row["fused"] = rate(bed.size(), steps, timings[1].typical());
        row["ratio"] = median_ratio(timings[2], timings[0]);
        row["same"] = comparable ? nlohmann::json(same) : nlohmann::json("sorted");
        add_reference(row, set);
        table.add(row);
      }
  }
  write_json(o.json, "executors", table);
  if (!right) fmt::print(stderr, "bench_step: the graph and the parallel loops do not give the same bits\n");
  return right;
}

}  // namespace platen::bench
