// How the graph of tasks would run on more cores than this machine has. Simulated: the real tasks with the times that
// each of them takes here on one core, dealt out to so many workers as soon as all that they wait for is done. Cores that
// share caches and memory are slower than that, so this is a bound of what the graph allows, not a measurement.
#include <tbb/task_arena.h>

#include <algorithm>
#include <functional>
#include <queue>

#include "bench/parallel_for_step.h"
#include "bench/step_modes.h"
#include "core/flow_graph.h"
#include "core/task_order.h"
#include "core/third_cache.h"

namespace platen::bench {

namespace {

struct Schedule {
  double makespan = 0.0;  // [s]
  double work = 0.0;      // sum of all tasks [s]
  double longest = 0.0;   // longest chain of tasks that need each other's results [s]
};

// Whoever is free takes the first ready task in the order of the table, or, by workers, the first of its own (real ones look no farther
// than core/worker_tasks.h says, and take each other's when they have none).
Schedule schedule(const TaskTable& table, const std::vector<double>& cost, int workers, Takers takers) {
  const std::size_t count = table.tasks().size();
  const bool own = takers == Takers::workers && !table.worker().empty();
  std::vector<std::int32_t> waits = table.predecessors();
  std::vector<double> chain(count, 0.0);
  using Ready = std::priority_queue<std::int32_t, std::vector<std::int32_t>, std::greater<>>;
  std::vector<Ready> ready(own ? static_cast<std::size_t>(workers) : 1);  // of each worker, or of all
  std::vector<int> idle(ready.size(), own ? 1 : workers);
  const auto taker = [&](std::size_t t) { return own ? static_cast<std::size_t>(table.worker()[t]) : std::size_t{0}; };
  using Running = std::pair<double, std::int32_t>;  // when it ends, task
  std::priority_queue<Running, std::vector<Running>, std::greater<>> running;
  Schedule result;
  double now = 0.0;
  const auto begin = [&](std::size_t by) {
    for (; idle[by] > 0 && !ready[by].empty(); --idle[by]) {
      const auto t = static_cast<std::size_t>(ready[by].top());
      ready[by].pop();
      running.push({now + cost[t], static_cast<std::int32_t>(t)});
      result.work += cost[t];
    }
  };
  for (std::size_t t = 0; t < count; ++t)
    if (waits[t] == 0) ready[taker(t)].push(static_cast<std::int32_t>(t));
  for (std::size_t by = 0; by < ready.size(); ++by) begin(by);
  while (!running.empty()) {
    const auto [end, task] = running.top();
    running.pop();
    now = end;
    const auto t = static_cast<std::size_t>(task);
    chain[t] += cost[t];
    result.longest = std::max(result.longest, chain[t]);
    ++idle[taker(t)];
    for (const std::int32_t next : table.successors()[t]) {
      chain[static_cast<std::size_t>(next)] = std::max(chain[static_cast<std::size_t>(next)], chain[t]);
      if (--waits[static_cast<std::size_t>(next)] == 0) ready[taker(static_cast<std::size_t>(next))].push(next);
    }
    for (std::size_t by = 0; by < ready.size(); ++by) begin(by);
  }
  result.makespan = now;
  return result;
}

// What a flow graph costs by itself, for one task [s].
double overhead_of_a_task(const TaskTable& table) {
  tbb::task_arena one(1);
  double seconds = 0.0;
  one.execute([&] {
    FlowGraph graph(table, [](const Task&) {});
    graph.run(table.steps());
    seconds = seconds_of([&] { graph.run(table.steps()); });
  });
  return seconds / static_cast<double>(table.tasks().size());
}

}  // namespace

void table_of_schedules(const StepOptions& o) {
  Table table("Simulated schedule of the real graph, 32 steps long, with task times measured here on one core",
              {{"particles", "particles", 10, 0},
               {"workers", "workers", 8, 0},
               {"batches", "batches", 8, 0},
               {"task_us", "us/task", 9, 1},
               {"overhead_us", "overhead", 9, 2},
               {"bound", "work/chain", 11, 1},
               {"speedup", "speed-up", 9, 2},
               {"busy", "busy", 7, 2}});
  for (const std::int64_t particles : either(o.particles, {35000})) {
    const Bed bed = dense_bed(particles, o.beds);
    const BenchScene scene = bench_scene("full");
    for (const int workers : either(o.threads, {1, 2, 4, 8, 16, 32, 64})) {
      const InstructionSet set = sets_of(o).front();
      BenchEngine engine = engine_of(o, set, 1);
      const double cache = engine.cache > 0.0 ? engine.cache : ordered_cache();
      if (engine.batch == 0) engine.batch = static_cast<int>(particles) / automatic_batches(static_cast<std::int32_t>(particles), workers, workers == 2, cache);
      const auto sim = make_simulation(bed, scene, engine);
      sim->advance(64);
      sim->rebuild_now();
      ParallelForStep tasks(*sim, scene.law, scene.gravity, 1);
      const std::vector<ParallelForStep::BatchTimes> times = tasks.times(40);
      TaskTable graph(sim->batches(), 32, false);
      const bool large = order_if_large(graph, sim->batches(), cache, workers) > 0.0;
      if (!large && workers > 2) deal_out(graph, sim->batches(), workers);
      const double overhead = overhead_of_a_task(graph);
      std::vector<double> cost;
      for (const Task& task : graph.tasks()) {
        const auto& t = times[static_cast<std::size_t>(task.batch)];
        cost.push_back(overhead + (task.kind == TaskKind::contacts ? t.contacts : t.integrate));
      }
      // Of a bed in the caches, dealt out to workers, the quicker way, as Simulation finds it by trying.
      Schedule s = schedule(graph, cost, workers, Takers::workers);
      if (!large && !graph.worker().empty())
        if (const Schedule other = schedule(graph, cost, workers, Takers::anybody); other.makespan < s.makespan) s = other;
      table.add({{"particles", particles},
                 {"workers", workers},
                 {"batches", sim->counters().batches},
                 {"task_us", 1e6 * s.work / static_cast<double>(cost.size())},
                 {"overhead_us", 1e6 * overhead},
                 {"bound", s.work / s.longest},
                 {"speedup", s.work / s.makespan},
                 {"busy", s.work / s.makespan / workers},
                 {"simulated", true}});
    }
  }
  write_json(o.json, "schedule", table);
}

}  // namespace platen::bench
