// What the order of tasks of a large bed saves, counted in a model of a cache: no times but that of making the order.
#include "bench/step_modes.h"
#include "core/task_order.h"
#include "core/third_cache.h"

namespace platen::bench {

void table_of_orders(const StepOptions& o) {
  Table table("Order of tasks: bytes from memory for each particle and step, 32 steps, counted in a model of a cache",
              {{"particles", "particles", 10, 0},
               {"workers", "workers", 8, 0},
               {"batches", "batches", 8, 0},
               {"touched", "touched", 9, 0},
               {"cache_MiB", "MiB", 6, 0},
               {"by_step", "by step", 9, 0},
               {"ordered", "ordered", 9, 0},
               {"milliseconds", "ms", 8, 1}});
  for (const std::int64_t particles : either(o.particles, {280000})) {
    const Bed bed = dense_bed(particles, o.beds);
    const BenchScene scene = bench_scene("full");
    const auto sim = make_simulation(bed, scene, engine_of(o, sets_of(o).front(), 1));
    sim->advance(1);
    const TaskTable by_step(sim->batches(), 32, false);
    const double per = 1.0 / (static_cast<double>(particles) * by_step.steps());
    for (const auto& [workers, cache] : {std::pair{1, 6.0 * (1 << 20)}, {1, most_ordered_cache}, {1, 24.0 * (1 << 20)}, {2, most_ordered_cache}, {4, most_ordered_cache * 2.0 / 3.0}, {8, most_ordered_cache / 3.0}}) {
      TaskTable ordered = by_step;
      const double seconds = seconds_of([&] { ordered.reorder(order_for_cache(ordered, sim->batches(), cache, workers)); });
      table.add({{"particles", particles},
                 {"workers", workers},
                 {"batches", sim->counters().batches},
                 {"touched", touched_bytes(sim->batches()) / static_cast<double>(particles)},
                 {"cache_MiB", cache / (1 << 20)},
                 {"by_step", per * bytes_from_memory(by_step, sim->batches(), cache)},
                 {"ordered", per * bytes_from_memory(ordered, sim->batches(), cache)},
                 {"milliseconds", 1e3 * seconds}});
    }
  }
  std::printf("By step: one cache. Ordered: one for each worker. ms: all searches one after the other.\n");
  write_json(o.json, "orders", table);
}

}  // namespace platen::bench
