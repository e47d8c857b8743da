// The order of tasks: what must not happen at once is ordered by edges, for the batches of real beds.
#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <mutex>
#include <set>

#include "core/flow_graph.h"
#include "tests/scenes.h"

namespace platen {
namespace {

using scenes::BedOptions;

// Real batches in different shapes.
struct Shape {
  const char* name;
  BedOptions bed;
  int batch;
};

std::vector<Shape> shapes() {
  std::vector<Shape> list;
  BedOptions cube;
  cube.nx = 6, cube.ny = 5, cube.nz = 6;
  list.push_back({"many small batches", cube, 16});
  BedOptions thin;
  thin.nx = thin.ny = 4, thin.nz = 8;
  list.push_back({"two batches, neighbours through every side", thin, 64});
  BedOptions flat;
  flat.nx = 8, flat.ny = 4, flat.nz = 2;
  list.push_back({"two batches across the box", flat, 32});
  BedOptions open = cube;
  open.periodic = false;
  list.push_back({"open sides", open, 24});
  list.push_back({"one batch", thin, 4096});
  return list;
}

// reach[t] holds every task that must come after t.
using Reach = std::vector<std::vector<bool>>;

Reach closure(const TaskTable& table) {
  const std::size_t n = table.tasks().size();
  Reach reach(n, std::vector<bool>(n, false));
  for (std::size_t t = n; t-- > 0;)  // edges go up, so successors are finished
    for (const std::int32_t next : table.successors()[t]) {
      const auto s = static_cast<std::size_t>(next);
      reach[t][s] = true;
      for (std::size_t k = s; k < n; ++k)
        if (reach[s][k]) reach[t][k] = true;
    }
  return reach;
}

// Pairs of tasks that use the same resource, one of them writing.
std::vector<std::pair<std::size_t, std::size_t>> conflicts(const TaskTable& table) {
  std::vector<std::vector<Access>> uses;
  for (const Task& task : table.tasks()) uses.push_back(table.accesses(task));
  std::vector<std::pair<std::size_t, std::size_t>> list;
  for (std::size_t a = 0; a < uses.size(); ++a)
    for (std::size_t b = a + 1; b < uses.size(); ++b) {
      bool conflict = false;
      for (const Access& x : uses[a])
        for (const Access& y : uses[b]) conflict = conflict || (x.resource == y.resource && (x.writes || y.writes));
      if (conflict) list.emplace_back(a, b);
    }
  return list;
}

std::size_t unordered(const TaskTable& table, const std::vector<std::pair<std::size_t, std::size_t>>& pairs) {
  const Reach reach = closure(table);
  std::size_t count = 0;
  for (const auto& [a, b] : pairs) count += reach[a][b] || reach[b][a] ? 0 : 1;
  return count;
}

template <class Body>
void for_each_table(int steps, const Body& body) {
  for (const Shape& shape : shapes())
    for (const bool fused : {false, true}) {
      SCOPED_TRACE(std::string(shape.name) + (fused ? ", fused" : ", split"));
      EngineOptions engine;
      engine.batch = shape.batch, engine.fused = fused;
      Simulation sim(scenes::bed(shape.bed, scenes::full_law(), engine));
      sim.set_time_step(1e-5);
      scenes::add_plates(sim, scenes::height_of(shape.bed), 0.0);
      sim.ensure_forces();
      body(sim, TaskTable(sim.batches(), steps, fused));
    }
}

TEST(TaskGraph, ConflictsAreOrdered) {
  for_each_table(3, [](const Simulation& sim, const TaskTable& table) {
    const auto pairs = conflicts(table);
    EXPECT_GE(pairs.size(), table.tasks().size() - 1);  // every batch alone conflicts with itself
    if (sim.batches().size() > 1) {
      bool across = false;
      for (const auto& [a, b] : pairs) across = across || table.tasks()[a].batch != table.tasks()[b].batch;
      EXPECT_TRUE(across);
    }
    EXPECT_EQ(unordered(table, pairs), 0u);
  });
}

TEST(TaskGraph, EdgesGoForwardAndOnce) {  // a doubled edge would make a flow graph wait for ever
  for_each_table(4, [](const Simulation&, const TaskTable& table) {
    std::vector<int> incoming(table.tasks().size(), 0);
    for (std::size_t t = 0; t < table.tasks().size(); ++t) {
      const auto& next = table.successors()[t];
      EXPECT_EQ(std::set<std::int32_t>(next.begin(), next.end()).size(), next.size());
      for (const std::int32_t s : next) {
        EXPECT_GT(s, static_cast<std::int32_t>(t));
        EXPECT_GE(table.tasks()[static_cast<std::size_t>(s)].offset, table.tasks()[t].offset);
        ++incoming[static_cast<std::size_t>(s)];
      }
    }
    for (std::size_t t = 0; t < incoming.size(); ++t) EXPECT_EQ(incoming[t], table.predecessors()[t]);
  });
}

TEST(TaskGraph, AMissingEdgeIsSeen) {
  BedOptions bed;
  bed.nx = bed.ny = 4, bed.nz = 5;
  for (const bool fused : {false, true}) {
    EngineOptions engine;
    engine.batch = 16, engine.fused = fused;
    Simulation sim(scenes::bed(bed, scenes::full_law(), engine));
    sim.ensure_forces();
    const TaskTable whole(sim.batches(), 2, fused);
    const auto pairs = conflicts(whole);
    int edges = 0, seen = 0;
    for (std::size_t t = 0; t < whole.tasks().size(); ++t)
      for (const std::int32_t next : whole.successors()[t]) {
        TaskTable table = whole;
        table.remove_edge(static_cast<std::int32_t>(t), next);
        ++edges;
        seen += unordered(table, pairs) > 0 ? 1 : 0;
      }
    EXPECT_GT(seen, edges / 4) << edges << " edges";  // the others are implied by what is left
  }
}

// Fused, two batches that own pairs of each other would read positions of two different steps.
TEST(TaskGraph, FusedTasksNeedListsByColour) {
  BedOptions bed;
  bed.nx = 8, bed.ny = 4, bed.nz = 2;
  EngineOptions engine;
  engine.batch = 32;
  Simulation sim(scenes::bed(bed, scenes::full_law(), engine));
  sim.ensure_forces();
  ASSERT_EQ(sim.batches().size(), 2u);
  EXPECT_NO_THROW(TaskTable(sim.batches(), 2, false));
  EXPECT_THROW(TaskTable(sim.batches(), 2, true), std::logic_error);
}

// What the lists of the batches touch is what the tasks declare.
TEST(TaskGraph, AccessesAreThoseOfTheLists) {
  for_each_table(1, [](const Simulation& sim, const TaskTable& table) {
    const std::vector<Batch>& batches = sim.batches();
    BatchOf batch_of;
    for (const Batch& b : batches) batch_of.starts.push_back(b.first);
    const auto declares = [&](TaskKind kind, int batch, int of, Resource what, bool writes) {
      for (const Access& a : table.accesses({table.fused() ? TaskKind::step : kind, batch, 0}))
        if (a.resource == of * resource_count + what && (a.writes || !writes)) return true;
      return false;
    };
    std::size_t foreign = 0;
    for (int k = 0; k < static_cast<int>(batches.size()); ++k) {
      const Batch& b = batches[static_cast<std::size_t>(k)];
      EXPECT_TRUE(declares(TaskKind::integrate, k, k, resource_state, true));
      EXPECT_TRUE(declares(TaskKind::integrate, k, k, resource_sums, true));
      EXPECT_TRUE(declares(TaskKind::contacts, k, k, resource_halo, true));
      EXPECT_TRUE(declares(TaskKind::contacts, k, k, resource_history, true));
      for (std::int32_t m = 0; m < b.used; ++m) {
        EXPECT_EQ(batch_of(b.i(static_cast<std::size_t>(m))), k);
        const int other = batch_of(b.j(static_cast<std::size_t>(m)));
        EXPECT_TRUE(declares(TaskKind::contacts, k, other, resource_state, false)) << k << " reads " << other;
        foreign += other != k ? 1 : 0;
      }
      for (const Incoming& in : b.incoming)
        EXPECT_TRUE(declares(TaskKind::integrate, k, in.batch, resource_halo, false)) << k << " reads halo of " << in.batch;
    }
    EXPECT_EQ(foreign > 0, batches.size() > 1);
  });
}

// Whoever sets several tasks free goes on with that of the batch it has just worked on.
TEST(TaskGraph, AThreadStaysWithItsBatch) {
  for_each_table(3, [](const Simulation&, const TaskTable& table) {
    std::vector<std::int32_t> waits = table.predecessors();
    const auto number = [&](const Task& task) {
      const auto same = [&](const Task& t) { return t.kind == task.kind && t.batch == task.batch && t.offset == task.offset; };
      return static_cast<std::size_t>(std::find_if(table.tasks().begin(), table.tasks().end(), same) - table.tasks().begin());
    };
    int wanted = -1, left = 0;  // the task that should come now; times that another one came
    const TaskBody body = [&](const Task& task) {
      const std::size_t t = number(task);
      left += wanted >= 0 && wanted != static_cast<int>(t) ? 1 : 0;
      wanted = -1;
      for (const std::int32_t next : table.successors()[t])
        if (--waits[static_cast<std::size_t>(next)] == 0 && table.tasks()[static_cast<std::size_t>(next)].batch == task.batch) wanted = next;
    };
    tbb::task_arena one(1);
    one.execute([&] { FlowGraph(table, body).run(table.steps()); });
    EXPECT_EQ(left, 0);
  });
}

TEST(TaskGraph, EveryExecutorRunsEveryTaskOnceInOrder) {
  for_each_table(3, [](const Simulation&, const TaskTable& table) {
    for (const int steps : {1, 3})
      for (const int threads : {0, 1, 3}) {
        std::mutex mutex;
        std::vector<Task> ran;
        const TaskBody body = [&](const Task& task) {
          const std::lock_guard<std::mutex> lock(mutex);
          ran.push_back(task);
        };
        if (threads == 0) {
          FlowGraph graph(table, body);
          graph.run(steps);
        } else {
          run_on_plain_threads(table, steps, body, threads);
        }
        std::vector<int> place(table.tasks().size(), -1);
        for (std::size_t k = 0; k < ran.size(); ++k)
          for (std::size_t t = 0; t < table.tasks().size(); ++t) {
            const Task& task = table.tasks()[t];
            if (task.kind != ran[k].kind || task.batch != ran[k].batch || task.offset != ran[k].offset) continue;
            EXPECT_EQ(place[t], -1) << "twice";
            place[t] = static_cast<int>(k);
          }
        for (std::size_t t = 0; t < place.size(); ++t) {
          ASSERT_EQ(place[t] >= 0, table.tasks()[t].offset < steps);
          for (const std::int32_t next : table.successors()[t]) {
            const int later = place[static_cast<std::size_t>(next)];
            EXPECT_TRUE(later < 0 || place[t] < later);
          }
        }
      }
  });
}

}  // namespace
}  // namespace platen
