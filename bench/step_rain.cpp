// Rain, and single blocks for scripts.
#include <fmt/format.h>

#include <algorithm>

#include "bench/reference_loops.h"
#include "bench/step_modes.h"

namespace platen::bench {

namespace {

constexpr int rain_warm = 100;

struct RainResult {
  double Z_end = 0.0, listed = 0.0;
  std::int64_t rebuilds = 0, prunes = 0, redone = 0;
};

// From the start file every time, because rain does not stay what it is.
double rain_seconds(const Bed& bed, const BenchScene& scene, const BenchEngine& engine, std::int64_t steps,
                    RainResult& result) {
  const auto sim = make_simulation(bed, scene, engine);
  sim->advance(rain_warm);
  const EngineCounters before = sim->counters();
  const double seconds = seconds_of([&] { sim->advance(steps); });
  const EngineCounters& after = sim->counters();
  double listed = 0.0;
  for (const Batch& b : sim->batches()) listed += b.used;
  result = {sim->measure(false).coordination_number, listed / static_cast<double>(bed.size()),
            after.rebuilds - before.rebuilds, after.prunes - before.prunes, after.redone_steps - before.redone_steps};
  return seconds;
}

}  // namespace

void table_of_rain(const StepOptions& o) {
  Table table("Rain: solid fraction 0.25, 1 m/s downward, up to 0.3 m/s random per component, rebuilds included",
              {{"particles", "particles", 10, 0},
               {"scene", "scene", 11, 0},
               {"set", "isa", 8, 0},
               {"threads", "threads", 8, 0},
               {"rate", "M/s"},
               {"best", "best"},
               {"Z", "Z at end", 10, 3},
               {"listed", "listed", 8, 2},
               {"steps", "steps", 7, 0},
               {"rebuilds", "rebuilds"},
               {"prunes", "prunes", 8, 0},
               {"redone", "redone", 8, 0},
               {"fma", "FMA Gf/s", 10, 1},
               {"l2", "L2 GB/s", 9, 0},
               {"l3", "L3 GB/s", 9, 0},
               {"state", "state", 7, 2}});
  const std::int64_t steps = o.steps > 0 ? o.steps : 2000;
  for (const std::int64_t particles : o.particles.empty() ? std::vector<std::int64_t>{35000} : o.particles) {
    const Bed bed = rain_bed(particles, o.beds);
    for (const std::string& name : o.scenes.empty() ? std::vector<std::string>{"rain", "rain_full"} : o.scenes)
      for (const InstructionSet set :
           o.sets.empty() ? std::vector<InstructionSet>{preferred_instruction_set()} : o.sets)
        for (const int threads : o.threads.empty() ? std::vector<int>{1, 2} : o.threads) {
          const BenchScene scene = bench_scene(name);
          const BenchEngine engine = engine_of(o, set, threads);
          RainResult result;
          const Timing timing =
              run_in_turn({{name, [&] { return rain_seconds(bed, scene, engine, steps, result); }}}, o.rounds).front();
          const double all = 1e-6 * static_cast<double>(bed.size()) * static_cast<double>(steps);
          nlohmann::json row = {{"particles", bed.size()},
                                {"scene", name},
                                {"set", to_string(set)},
                                {"threads", threads},
                                {"rate", all / timing.typical()},
                                {"best", all / timing.best()},
                                {"Z", result.Z_end},
                                {"listed", result.listed},
                                {"steps", steps},
                                {"rebuilds", result.rebuilds},
                                {"prunes", result.prunes},
                                {"redone", result.redone},
                                {"dropped", timing.dropped}};
          add_reference(row, set);
          table.add(row);
        }
  }
  write_json(o.json, "rain", table);
}

void one_block(const StepOptions& o, bool rain) {
  const std::int64_t particles = o.particles.empty() ? 35000 : o.particles.front();
  const Bed bed = rain ? rain_bed(particles, o.beds) : dense_bed(particles, o.beds);
  const BenchScene scene = bench_scene(o.scenes.empty() ? (rain ? "rain" : "full") : o.scenes.front());
  const BenchEngine engine = engine_of(o, o.sets.empty() ? preferred_instruction_set() : o.sets.front(),
                                       o.threads.empty() ? 1 : o.threads.front());
  const std::int64_t steps = o.steps > 0 ? o.steps : rain ? 2000 : 500;
  const auto sim = make_simulation(bed, scene, engine);
  sim->advance(o.warm);
  std::vector<double> seconds;
  for (int block = 0; block < o.rounds; ++block) seconds.push_back(seconds_of([&] { sim->advance(steps); }));
  const Measures now = sim->measure(false);
  nlohmann::json line = {{"particles", bed.size()},
                         {"scene", scene.name},
                         {"set", to_string(engine.set)},
                         {"threads", engine.threads},
                         {"steps", steps},
                         {"seconds", seconds},
                         {"Z", now.coordination_number},
                         {"rebuilds", sim->counters().rebuilds},
                         {"prunes", sim->counters().prunes},
                         {"redone", sim->counters().redone_steps},
                         {"total_steps", sim->step()},
                         {"gap", sim->counters().gap / sim->largest_radius()},
                         {"skin", sim->counters().skin / sim->largest_radius()},
                         {"hash", fmt::format("{:016x}", sim->state_hash())}};
  fmt::print("{}\n", line.dump());
}

}  // namespace platen::bench
