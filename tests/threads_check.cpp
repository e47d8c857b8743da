// A small bed on plain threads, for ThreadSanitizer: it cannot see through Debian's libtbb, which is built without it.
//
//   threads_check split|fused|ordered|workers                clean, or ThreadSanitizer says what is wrong
//   threads_check split|fused|ordered|workers remove-edge    with one needed edge gone: ThreadSanitizer must report a race
#include <cstdio>
#include <cstring>

#include "tests/scenes.h"

namespace {

using namespace platen;

constexpr int threads = 4;

// Each worker has every fourth batch, so that all have to do with each other.
void give_to_workers(TaskTable& table) {
  std::vector<std::int32_t> worker;
  for (const Task& task : table.tasks()) worker.push_back(task.batch % threads);
  table.give_to(worker);
}

// Removes the first edge that nothing else stands for: neither other edges nor the order in which a thread does its
// tasks (t, t + threads, ..., or those of a worker, about). Of workers, who see of each other what was done last, those of all steps.
void remove_a_needed_edge(TaskTable& table) {
  const std::size_t n = table.tasks().size();
  const auto next_of_thread = [&](std::size_t t) {
    if (table.worker().empty()) return t + threads;
    std::size_t next = t + 1;
    while (next < n && table.worker()[next] != table.worker()[t]) ++next;
    return next;
  };
  const auto ordered_without = [&](std::size_t from, std::size_t to) {
    std::vector<bool> reached(n, false);
    reached[from] = true;
    for (std::size_t t = from; t < n; ++t) {
      if (!reached[t]) continue;
      if (const std::size_t next = next_of_thread(t); next < n) reached[next] = true;
      for (const std::int32_t next : table.successors()[t])
        if (!(t == from && static_cast<std::size_t>(next) == to)) reached[static_cast<std::size_t>(next)] = true;
    }
    return static_cast<bool>(reached[to]);
  };
  for (std::size_t t = 0; t < n; ++t)
    for (const std::int32_t next : table.successors()[t]) {
      if (ordered_without(t, static_cast<std::size_t>(next))) continue;
      std::printf("removed %s(%d) +%d -> %s(%d) +%d\n", to_string(table.tasks()[t].kind), table.tasks()[t].batch,
                  table.tasks()[t].offset, to_string(table.tasks()[static_cast<std::size_t>(next)].kind),
                  table.tasks()[static_cast<std::size_t>(next)].batch, table.tasks()[static_cast<std::size_t>(next)].offset);
      const Task from = table.tasks()[t], to = table.tasks()[static_cast<std::size_t>(next)];
      table.remove_edge(static_cast<std::int32_t>(t), next);
      if (table.worker().empty()) return;
      for (std::size_t later = t; later < n; ++later) {
        const auto list = table.successors()[later];
        const std::vector<std::int32_t> successors(list.begin(), list.end());  // removing moves them
        for (const std::int32_t other : successors) {
          const Task &a = table.tasks()[later], &b = table.tasks()[static_cast<std::size_t>(other)];
          if (a.kind == from.kind && a.batch == from.batch && b.kind == to.kind && b.batch == to.batch) table.remove_edge(static_cast<std::int32_t>(later), other);
        }
      }
      return;
    }
  std::puts("no edge is needed: nothing removed");
}

}  // namespace

int main(int count, char** arguments) {
  if (count < 2) return 2;
  scenes::BedOptions bed;
  bed.nx = bed.ny = 5, bed.nz = 6, bed.speed = 0.5;
  EngineOptions engine;
  engine.threads = threads, engine.executor = Executor::plain_threads, engine.batch = 16, engine.unroll = 8;
  engine.fused = std::strcmp(arguments[1], "fused") == 0;
  engine.instruction_set = preferred_instruction_set();
  if (std::strcmp(arguments[1], "ordered") == 0) engine.cache = 1e4;
  const bool workers = std::strcmp(arguments[1], "workers") == 0, remove = count > 2 && std::strcmp(arguments[2], "remove-edge") == 0;
  engine.tamper = [workers, remove](TaskTable& table) {
    if (workers) give_to_workers(table);
    if (remove) remove_a_needed_edge(table);
  };
  try {
    Simulation sim(scenes::bed(bed, scenes::full_law(), engine));
    sim.set_time_step(1e-5);
    scenes::add_plates(sim, scenes::height_of(bed) + 5e-5, -0.5);
    sim.advance(400);
    std::printf("%lld contacts, hash %016llx\n", static_cast<long long>(sim.measure().contacts),
                static_cast<unsigned long long>(sim.state_hash()));
  } catch (const std::exception& error) {  // with an edge gone anything may happen
    std::printf("%s\n", error.what());
    return 1;
  }
}
