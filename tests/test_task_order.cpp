// The order of tasks of beds that no cache holds [core/task_order.h].
#include <gtest/gtest.h>

#include <tbb/task_arena.h>

#include <algorithm>
#include <list>
#include <map>
#include <mutex>
#include <tuple>

#include "core/flow_graph.h"
#include "core/task_order.h"
#include "core/worker_tasks.h"
#include "tests/scenes.h"

namespace platen {
namespace {

using scenes::BedOptions;

Simulation long_bed(int batch, bool fused = false) {
  BedOptions o;
  o.nx = 40, o.ny = 6, o.nz = 7;
  EngineOptions engine;
  engine.batch = batch, engine.fused = fused;
  return Simulation(scenes::bed(o, scenes::full_law(), engine));
}

// All batches are about equally large: so many of them, states and contacts apart, that a cache takes in when it holds `places`
// and forgets what was not used for longest.
int loaded(const TaskTable& table, std::size_t places) {
  std::list<int> held;  // last used first
  int count = 0;
  const auto use = [&](int what) {
    const auto at = std::find(held.begin(), held.end(), what);
    if (at == held.end())
      ++count;
    else
      held.erase(at);
    held.push_front(what);
    if (held.size() > places) held.pop_back();
  };
  for (const Task& task : table.tasks()) {
    use(2 * task.batch);
    if (task.kind != TaskKind::integrate) use(2 * task.batch + 1);
  }
  return count;
}

using Key = std::tuple<int, int, int>;
Key key(const Task& task) { return {static_cast<int>(task.kind), task.batch, task.offset}; }
std::map<Key, std::size_t> index_of_tasks(const TaskTable& table) {
  std::map<Key, std::size_t> index;
  for (std::size_t t = 0; t < table.tasks().size(); ++t) index[key(table.tasks()[t])] = t;
  return index;
}

TaskTable ordered(const Simulation& sim, int steps, bool fused, double cache) {
  TaskTable table(sim.batches(), steps, fused);
  table.reorder(order_for_cache(table, sim.batches(), cache));
  return table;
}

TEST(TaskOrder, KeepsTasksAndEdges) {
  for (const int batch : {16, 64, 4096})
    for (const bool fused : {false, true}) {
      Simulation sim = long_bed(batch, fused);
      sim.ensure_forces();
      for (const double share : {0.0, 0.1, 0.5, 2.0}) {
        const TaskTable plain(sim.batches(), 5, fused);
        const std::vector<std::int32_t> order = order_for_cache(plain, sim.batches(), share * touched_bytes(sim.batches())).tasks;
        std::vector<std::int32_t> sorted = order;
        std::sort(sorted.begin(), sorted.end());
        ASSERT_EQ(sorted.size(), plain.tasks().size());
        for (std::size_t k = 0; k < sorted.size(); ++k) ASSERT_EQ(sorted[k], static_cast<std::int32_t>(k));

        TaskTable table = plain;
        table.reorder({order, {}});
        EXPECT_FALSE(plain.ordered());
        EXPECT_TRUE(table.ordered());
        for (std::size_t k = 0; k < order.size(); ++k) {
          const auto t = static_cast<std::size_t>(order[k]);
          EXPECT_EQ(table.tasks()[k].number, static_cast<std::int32_t>(k));
          EXPECT_EQ(plain.tasks()[t].number, static_cast<std::int32_t>(t));
          EXPECT_EQ(table.tasks()[k].kind, plain.tasks()[t].kind);
          EXPECT_EQ(table.tasks()[k].batch, plain.tasks()[t].batch);
          EXPECT_EQ(table.tasks()[k].offset, plain.tasks()[t].offset);
          EXPECT_EQ(table.predecessors()[k], plain.predecessors()[t]);
          ASSERT_EQ(table.successors()[k].size(), plain.successors()[t].size());
          for (std::size_t m = 0; m < table.successors()[k].size(); ++m) {
            const std::int32_t next = table.successors()[k][m];
            EXPECT_GT(next, static_cast<std::int32_t>(k));
            EXPECT_EQ(order[static_cast<std::size_t>(next)], plain.successors()[t][m]);
          }
        }
      }
  }
}

TEST(TaskOrder, BringsLessFromMemory) {
  Simulation sim = long_bed(64);
  sim.ensure_forces();
  const std::size_t batches = sim.batches().size();
  ASSERT_GT(batches, 20u);
  const int steps = 16;
  const TaskTable plain(sim.batches(), steps, false);
  // A third of all: step by step everything is brought in anew, states for each half of a step.
  const std::size_t places = 2 * batches / 3;
  EXPECT_EQ(loaded(plain, places), static_cast<int>(3 * batches) * steps);
  const TaskTable table = ordered(sim, steps, false, touched_bytes(sim.batches()) / 3.0);
  EXPECT_LT(loaded(table, places), loaded(plain, places) / 2);
  // By bytes it counts alike.
  const double third = touched_bytes(sim.batches()) / 3.0;
  EXPECT_LT(bytes_from_memory(table, sim.batches(), third), 0.5 * bytes_from_memory(plain, sim.batches(), third));
  EXPECT_NEAR(bytes_from_memory(plain, sim.batches(), 1e12), touched_bytes(sim.batches()), 1.0);
  // A cache that holds all has everything brought in once, in whatever order.
  EXPECT_EQ(loaded(ordered(sim, steps, false, 1e12), 2 * batches), static_cast<int>(2 * batches));
}

// Batches that touch nobody take all their steps one after the other.
TEST(TaskOrder, BatchesWithoutNeighboursAreDoneOneByOne) {
  std::vector<Batch> batches(40);
  for (Batch& b : batches) b.count = 64, b.padded = 16;
  TaskTable table(batches, 10, false);
  table.reorder(order_for_cache(table, batches, touched_bytes(batches) / 8.0));
  EXPECT_NEAR(bytes_from_memory(table, batches, touched_bytes(batches) / 8.0), touched_bytes(batches), 1.0);
}

TEST(TaskOrder, TinyBatchesAreLeftInTheOrderOfSteps) {
  std::vector<Batch> batches(2000);
  for (Batch& b : batches) b.count = 8;
  for (const double share : {0.01, 0.4}) {  // 20 and 800 of them fit in
    TaskTable table(batches, 2, false);
    order_if_large(table, batches, share * touched_bytes(batches), 1);
    EXPECT_EQ(table.ordered(), share < 0.1);
  }
}

TEST(TaskOrder, ABedThatFitsIsLeftInTheOrderOfSteps) {
  BedOptions o;
  o.nx = o.ny = o.nz = 6;
  for (const bool fits : {true, false}) {
    bool seen = false, was_ordered = false;
    EngineOptions engine;
    engine.batch = 16;
    engine.cache = fits ? most_ordered_cache : 1e4;
    engine.tamper = [&](TaskTable& table) { seen = true, was_ordered = table.ordered(); };
    Simulation sim(scenes::bed(o, scenes::full_law(), engine));
    sim.ensure_forces();
    EXPECT_TRUE(seen);
    EXPECT_EQ(was_ordered, !fits);
  }
}

// On one thread a graph takes exactly the order: the first task that is not done is always ready.
TEST(TaskOrder, AGraphTakesTheFirstThatIsReady) {
  Simulation sim = long_bed(64);
  sim.ensure_forces();
  const TaskTable table = ordered(sim, 6, false, touched_bytes(sim.batches()) / 4.0);
  std::size_t done = 0, out_of_order = 0;
  const TaskBody body = [&](const Task& task) {
    const Task& wanted = table.tasks()[done++];
    out_of_order += task.kind == wanted.kind && task.batch == wanted.batch && task.offset == wanted.offset ? 0 : 1;
  };
  tbb::task_arena one(1);
  one.execute([&] {
    FlowGraph graph(table, body);
    graph.run(table.steps());
  });
  EXPECT_EQ(done, table.tasks().size());
  EXPECT_EQ(out_of_order, 0u);
}

TEST(TaskOrder, AGraphRunsEveryTaskOnceAndInOrder) {
  Simulation sim = long_bed(64);
  sim.ensure_forces();
  const TaskTable table = ordered(sim, 6, false, touched_bytes(sim.batches()) / 4.0);
  for (const int steps : {1, 4, 6})
    for (const int threads : {0, 1, 2, 3}) {
      std::mutex mutex;
      std::map<Key, int> place;
      bool twice = false;
      const TaskBody body = [&](const Task& task) {
        const std::lock_guard<std::mutex> lock(mutex);
        twice = !place.emplace(key(task), static_cast<int>(place.size())).second || twice;
      };
      if (threads == 0) {
        FlowGraph(table, body).run(steps);
      } else if (threads == 1) {
        run_serially(table, steps, body);
      } else {
        run_on_plain_threads(table, steps, body, threads);
      }
      EXPECT_FALSE(twice);
      EXPECT_EQ(place.size(), sim.batches().size() * 2 * static_cast<std::size_t>(steps));
      for (std::size_t t = 0; t < table.tasks().size(); ++t) {
        if (table.tasks()[t].offset >= steps) continue;
        for (const std::int32_t next : table.successors()[t]) {
          const Task& later = table.tasks()[static_cast<std::size_t>(next)];
          if (later.offset >= steps) continue;
          EXPECT_LT(place.at(key(table.tasks()[t])), place.at(key(later)));
        }
      }
    }
}

TaskTable parted(const Simulation& sim, int steps, bool fused, int workers) {
  TaskTable table(sim.batches(), steps, fused);
  table.reorder(order_for_cache(table, sim.batches(), touched_bytes(sim.batches()) / 8.0, workers));
  return table;
}

// Each worker has a part of the bed to itself, all parts alike, and its tasks in the order of the table.
TEST(TaskOrder, WorkersHavePartsOfTheBed) {
  Simulation sim = long_bed(64);
  sim.ensure_forces();
  const std::size_t batches = sim.batches().size();
  EXPECT_TRUE(parted(sim, 6, false, 1).worker().empty());
  for (const int workers : {2, 3, 7}) {
    const TaskTable table = parted(sim, 6, false, workers);
    ASSERT_EQ(table.worker().size(), table.tasks().size());
    std::vector<int> owner(batches, -1), last(static_cast<std::size_t>(workers), -1), tasks(static_cast<std::size_t>(workers), 0);
    for (std::size_t k = 0; k < table.tasks().size(); ++k) {
      const int w = table.worker()[k];
      ASSERT_TRUE(w >= 0 && w < workers);
      int& own = owner[static_cast<std::size_t>(table.tasks()[k].batch)];
      EXPECT_TRUE(own < 0 || own == w);
      own = w;
      last[static_cast<std::size_t>(w)] = static_cast<int>(k);
      ++tasks[static_cast<std::size_t>(w)];
      for (const std::int32_t next : table.successors()[k]) EXPECT_GT(next, static_cast<std::int32_t>(k));
    }
    for (const int end : last) ASSERT_GE(end, 0);
    for (const int n : tasks) EXPECT_NEAR(n, static_cast<double>(table.tasks().size()) / workers, 0.35 * static_cast<double>(table.tasks().size()) / workers);
  }
}

// Batches of a bed of `bars` with `slices` each, one bar after the other, there and back, as the curve has them.
std::vector<Batch> bars_of_batches(int bars, int slices) {
  const auto number = [&](int bar, int slice) { return bar * slices + (bar % 2 == 0 ? slice : slices - 1 - slice); };
  std::vector<Batch> batches(static_cast<std::size_t>(bars * slices));
  for (int bar = 0; bar < bars; ++bar)
    for (int slice = 0; slice < slices; ++slice) {
      const int k = number(bar, slice);
      Batch& b = batches[static_cast<std::size_t>(k)];
      b.count = 2048, b.padded = 6400;
      b.centre[0] = slice, b.centre[1] = bar;
      for (const auto& [other_bar, other_slice] : {std::pair{bar, slice + 1}, {bar + 1, slice}}) {
        if (other_bar == bars || other_slice == slices) continue;
        b.partners.push_back(number(other_bar, other_slice));
        batches[static_cast<std::size_t>(b.partners.back())].owners.push_back(k);
      }
    }
  return batches;
}

// Halves of the curve through three bars touch along half a bar and more, and who has what there waits for the other; slabs across the bars
// touch at three batches. No cut can be faster than half of the work.
TEST(TaskOrder, PartsAreCutWhereItIsFastest) {
  const std::vector<Batch> batches = bars_of_batches(3, 27);
  std::vector<Batch> nowhere = bars_of_batches(3, 27);  // the same without centres: all cuts are those of the curve
  for (Batch& b : nowhere) std::fill(std::begin(b.centre), std::end(b.centre), 0.0);
  const TaskTable table(batches, 16, false);
  const double cache = touched_bytes(batches) / 4.0;
  const double best = order_for_cache(table, batches, cache, 2).time, of_curve = order_for_cache(table, nowhere, cache, 2).time;
  EXPECT_LT(best, 0.98 * of_curve);
  EXPECT_GE(best, 0.5 * order_for_cache(table, batches, 1e12, 1).time);
}

// Slabs across the bars cut the middle one lengthwise, and as its batches' centres are not quite in a row, every other batch is somebody else's:
// nobody waits for long, but whoever reads what another core wrote last takes longer.
TEST(TaskOrder, BordersHaveAPrice) {
  constexpr int slices = 30;
  std::vector<Batch> batches = bars_of_batches(3, slices);
  for (std::size_t k = 0; k < batches.size(); ++k) batches[k].centre[1] += 0.01 * static_cast<double>(k % 2);
  const TaskTable table(batches, 16, false);
  const double cache = touched_bytes(batches) / 4.0;
  const auto neighbours_apart = [&] {
    TaskTable ordered = table;
    ordered.reorder(order_for_cache(table, batches, cache, 2));
    const std::vector<int> worker = worker_of_batches(ordered, batches.size());
    int apart = 0;
    for (std::size_t k = 0; k + 1 < batches.size(); ++k) apart += worker[k] != worker[k + 1];
    return apart;
  };
  for (std::size_t k = 0; k < batches.size(); ++k)
    for (const int owner : batches[k].owners) batches[k].incoming.push_back({owner, 0, 600});
  EXPECT_LE(neighbours_apart(), 4);  // three bars cut once each, and a batch on the wrong side
}

// Two workers with a cache each need together no more from memory than one worker with one of them: the border costs nothing.
TEST(TaskOrder, PartsNeedNoMoreFromMemory) {
  Simulation sim = long_bed(64);
  sim.ensure_forces();
  const double all = touched_bytes(sim.batches());
  const TaskTable by_step(sim.batches(), 16, false);
  const auto brought = [&](int workers, double cache) {
    TaskTable table = by_step;
    table.reorder(order_for_cache(table, sim.batches(), cache, workers));
    return bytes_from_memory(table, sim.batches(), cache);
  };
  EXPECT_LT(brought(2, all / 6.0), 0.5 * bytes_from_memory(by_step, sim.batches(), all / 3.0));
  EXPECT_LT(brought(2, all / 6.0), 1.05 * brought(1, all / 6.0));
}

TEST(TaskOrder, MoreWorkersThanBatches) {
  for (const std::size_t count : {0u, 1u, 3u}) {
    std::vector<Batch> batches(count);
    for (Batch& b : batches) b.count = 64, b.padded = 16;
    TaskTable table(batches, 4, false);
    table.reorder(order_for_cache(table, batches, 1e3, 5));
    int done = 0;
    tbb::task_arena one(1);
    one.execute([&] { FlowGraph(table, [&](const Task&) { ++done; }).run(4); });
    EXPECT_EQ(done, static_cast<int>(8 * count));
  }
}

// A thread that has done a task goes on with its worker's first one that waits for nothing else.
TEST(TaskOrder, AThreadStaysWithItsWorker) {
  for (const bool fused : {false, true}) {
    Simulation sim = long_bed(64, fused);
    sim.ensure_forces();
    const TaskTable table = parted(sim, 6, fused, 3);
    const auto index = index_of_tasks(table);
    std::vector<std::size_t> done;
    tbb::task_arena one(1);
    one.execute([&] {
      FlowGraph graph(table, [&](const Task& task) { done.push_back(index.at(key(task))); });
      graph.run(table.steps());
    });
    ASSERT_EQ(done.size(), table.tasks().size());
    std::vector<std::int32_t> waits = table.predecessors();
    std::vector<bool> taken(waits.size(), false);
    std::size_t stayed = 0;
    for (std::size_t k = 0; k < done.size(); ++k) {
      const std::size_t t = done[k];
      EXPECT_EQ(waits[t], 0);
      taken[t] = true;
      for (const std::int32_t next : table.successors()[t]) --waits[static_cast<std::size_t>(next)];
      std::size_t seen = 0;
      for (std::size_t own = 0; own < waits.size() && seen < WorkerTasks::window; ++own) {
        if (table.worker()[own] != table.worker()[t] || (seen == 0 && taken[own])) continue;  // the window begins with one that is not taken
        ++seen;
        if (taken[own] || waits[own] > 0) continue;
        EXPECT_EQ(done[k + 1], own);
        ++stayed;
        break;
      }
    }
    EXPECT_GT(2 * stayed, done.size());
  }
}

TEST(TaskOrder, ManyThreadsTakeTheParts) {
  Simulation sim = long_bed(64);
  sim.ensure_forces();
  const TaskTable table = parted(sim, 6, false, 3);
  const auto index = index_of_tasks(table);
  for (const int steps : {1, 4, 6})
    for (int repetition = 0; repetition < 20; ++repetition) {
      std::mutex mutex;
      std::vector<std::size_t> place(table.tasks().size(), 0), done;
      tbb::task_arena many(3);
      many.execute([&] {
        FlowGraph(table, [&](const Task& task) {
          const std::lock_guard<std::mutex> lock(mutex);
          done.push_back(index.at(key(task)));
          place[done.back()] = done.size();
        }).run(steps);
      });
      EXPECT_EQ(done.size(), sim.batches().size() * 2 * static_cast<std::size_t>(steps));
      for (const std::size_t t : done) {
        for (const std::int32_t next : table.successors()[t])
          EXPECT_TRUE(place[static_cast<std::size_t>(next)] == 0 || place[t] < place[static_cast<std::size_t>(next)]);
      }
    }
}

}  // namespace
}  // namespace platen
