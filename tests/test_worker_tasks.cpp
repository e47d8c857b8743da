// Which tasks workers take next [core/worker_tasks.h].
#include <gtest/gtest.h>

#include <tbb/info.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <random>
#include <stdexcept>
#include <thread>

#include "core/flow_graph.h"
#include "core/task_order.h"
#include "core/worker_tasks.h"
#include "tests/scenes.h"

namespace platen {
namespace {

Simulation bed(bool fused) {
  scenes::BedOptions o;
  o.nx = 16, o.ny = 16, o.nz = 16;
  EngineOptions engine;
  engine.batch = 16, engine.fused = fused;
  return Simulation(scenes::bed(o, scenes::full_law(), engine));
}

TaskTable dealt_out(const Simulation& sim, bool fused, int workers) {
  TaskTable table(sim.batches(), 4, fused);
  deal_out(table, sim.batches(), workers);
  return table;
}

bool keeps_edges(const TaskTable& table, const std::vector<std::int32_t>& order) {
  std::vector<std::size_t> place(order.size());
  for (std::size_t k = 0; k < order.size(); ++k) place[static_cast<std::size_t>(order[k])] = k;
  for (std::size_t t = 0; t < place.size(); ++t)
    for (const std::int32_t next : table.successors()[t])
      if (place[t] >= place[static_cast<std::size_t>(next)]) return false;
  return true;
}

TaskTable in_order_for_a_cache(const Simulation& sim, int workers) {
  TaskTable table(sim.batches(), 4, false);
  table.reorder(order_for_cache(table, sim.batches(), touched_bytes(sim.batches()) / 8.0, workers));
  return table;
}

// Tasks that have been taken and are not done yet; whoever is picked takes one or ends one, as chance has it. In which order they began and ended.
struct Played {
  std::vector<std::int32_t> began, ended;
};
Played play(WorkerTasks& tasks, std::mt19937& random, bool from_others) {
  Played played;
  std::vector<std::int32_t> in_hand(tasks.workers(), -1);
  tasks.start();
  for (int idle = 0; idle < 100000; ++idle) {
    const std::size_t w = random() % tasks.workers();
    if (in_hand[w] < 0) {
      in_hand[w] = tasks.take(w);
      if (in_hand[w] < 0 && from_others) in_hand[w] = tasks.take_from_others(w);
      if (in_hand[w] >= 0) played.began.push_back(in_hand[w]), idle = 0;
    } else {
      tasks.done(in_hand[w]);
      played.ended.push_back(in_hand[w]);
      in_hand[w] = -1, idle = 0;
    }
    if (!tasks.have_left() && std::all_of(in_hand.begin(), in_hand.end(), [](std::int32_t t) { return t < 0; })) break;
  }
  return played;
}

// Whether each task was taken once, and only when all that it waits for was done.
bool plays_by_the_rules(const TaskTable& table, WorkerTasks& tasks, std::mt19937& random, bool from_others) {
  const Played played = play(tasks, random, from_others);
  const std::size_t count = table.tasks().size();
  if (played.began.size() != count || played.ended.size() != count) return false;
  std::vector<std::int32_t> sorted = played.began;
  std::sort(sorted.begin(), sorted.end());
  if (std::adjacent_find(sorted.begin(), sorted.end()) != sorted.end()) return false;
  return keeps_edges(table, played.began) && keeps_edges(table, played.ended);
}

TEST(WorkerTasks, KeepAllEdgesWhoeverIsFast) {
  std::mt19937 random(3);
  for (const bool fused : {false, true}) {
    Simulation sim = bed(fused);
    sim.ensure_forces();
    for (const int workers : {1, 2, 3, 7}) {
      const TaskTable table = dealt_out(sim, fused, workers);
      WorkerTasks tasks(table);
      for (int repetition = 0; repetition < 30; ++repetition) EXPECT_TRUE(plays_by_the_rules(table, tasks, random, repetition % 2 == 0));
    }
  }
}

// The order of a large bed, whose tasks are not step by step.
TEST(WorkerTasks, OfATableInAnotherOrder) {
  std::mt19937 random(4);
  Simulation sim = bed(false);
  sim.ensure_forces();
  const TaskTable table = in_order_for_a_cache(sim, 3);
  ASSERT_EQ(worker_count(table), 3);
  WorkerTasks tasks(table);
  for (int repetition = 0; repetition < 30; ++repetition) EXPECT_TRUE(plays_by_the_rules(table, tasks, random, repetition % 2 == 0));
}

// Nobody takes a task while one that it waits for is under way: not one edge can be left out.
TEST(WorkerTasks, WaitForEveryEdge) {
  Simulation sim = bed(false);
  sim.ensure_forces();
  const TaskTable table = dealt_out(sim, false, 3);
  WorkerTasks tasks(table);
  std::vector<std::vector<std::int32_t>> before(table.tasks().size());
  for (std::size_t t = 0; t < before.size(); ++t)
    for (const std::int32_t next : table.successors()[t]) before[static_cast<std::size_t>(next)].push_back(static_cast<std::int32_t>(t));
  for (std::size_t t = 0; t < before.size(); ++t) {
    for (const std::int32_t late : before[t]) {
      // All but one are done at once, as soon as they may be; what needs that one waits with it.
      tasks.start();
      bool taken = false;
      for (bool more = true; more;) {
        more = false;
        for (std::size_t w = 0; w < tasks.workers(); ++w)
          for (std::int32_t task = tasks.take(w); task >= 0; task = tasks.take(w)) {
            more = true, taken = taken || task == static_cast<std::int32_t>(t);
            if (task != late) tasks.done(task);
          }
      }
      EXPECT_FALSE(taken) << "task " << t << " did not wait for " << late;
    }
  }
}

// A worker's first task that can go on, past others by no more than the window; from others the last one.
TEST(WorkerTasks, AreTakenInOrder) {
  std::mt19937 random(5);
  Simulation sim = bed(false);
  sim.ensure_forces();
  const TaskTable table = in_order_for_a_cache(sim, 2);
  WorkerTasks tasks(table);
  std::vector<std::vector<std::int32_t>> own(2);
  for (std::size_t t = 0; t < table.tasks().size(); ++t) own[static_cast<std::size_t>(table.worker()[t])].push_back(static_cast<std::int32_t>(t));
  std::vector<std::int32_t> waits = table.predecessors();
  std::vector<bool> taken(waits.size(), false);
  const auto can = [&](std::int32_t t) { return !taken[static_cast<std::size_t>(t)] && waits[static_cast<std::size_t>(t)] == 0; };
  const auto window_of = [&](std::size_t w) {
    const auto first = std::find_if(own[w].begin(), own[w].end(), [&](std::int32_t t) { return !taken[static_cast<std::size_t>(t)]; });
    return std::pair{first, first + std::min(own[w].end() - first, static_cast<std::ptrdiff_t>(WorkerTasks::window))};
  };
  std::size_t past = 0, others = 0;
  for (int idle = 0; tasks.have_left();) {
    ASSERT_LT(idle++, 10000);
    const std::size_t w = random() % 8 == 0 ? 1 : 0;  // one of them is slow
    auto [first, last] = window_of(w);
    const auto wanted = std::find_if(first, last, can);
    std::int32_t task = tasks.take(w);
    EXPECT_EQ(task, wanted == last ? -1 : *wanted);
    past += task >= 0 && task != *first;
    if (task < 0) {
      auto [from, to] = window_of(1 - w);
      const auto last_of_other = std::find_if(std::make_reverse_iterator(to), std::make_reverse_iterator(from), can);
      task = tasks.take_from_others(w);
      EXPECT_EQ(task, last_of_other.base() == from ? -1 : *last_of_other);
      others += task >= 0;
    }
    if (task < 0) continue;
    idle = 0;
    taken[static_cast<std::size_t>(task)] = true;
    tasks.done(task);
    for (const std::int32_t next : table.successors()[static_cast<std::size_t>(task)]) --waits[static_cast<std::size_t>(next)];
  }
  EXPECT_GT(past, 0u);
  EXPECT_GT(others, 0u);
}

// Whoever has a task that waits is told of; nobody else.
TEST(WorkerTasks, KnowWhoWaits) {
  Simulation sim = bed(false);
  sim.ensure_forces();
  const TaskTable table = dealt_out(sim, false, 3);
  const WorkerTasks tasks(table);
  for (std::size_t t = 0; t < table.tasks().size(); ++t) {
    std::vector<std::int32_t> wanted;
    for (const std::int32_t next : table.successors()[t]) wanted.push_back(table.worker()[static_cast<std::size_t>(next)]);
    std::sort(wanted.begin(), wanted.end());
    wanted.erase(std::unique(wanted.begin(), wanted.end()), wanted.end());
    std::vector<std::int32_t> told = tasks.who_waits_for(static_cast<std::int32_t>(t));
    std::sort(told.begin(), told.end());
    EXPECT_EQ(told, wanted);
  }
}

// Plain threads, without any lock of their own: what a task wrote is seen by those that wait for it, whoever takes them.
TEST(WorkerTasks, OfThreadsSideBySide) {
  Simulation sim = bed(false);
  sim.ensure_forces();
  for (const bool large : {false, true}) {
    const TaskTable table = large ? in_order_for_a_cache(sim, 3) : dealt_out(sim, false, 3);
    std::vector<std::vector<std::int32_t>> before(table.tasks().size());
    for (std::size_t t = 0; t < before.size(); ++t)
      for (const std::int32_t next : table.successors()[t]) before[static_cast<std::size_t>(next)].push_back(static_cast<std::int32_t>(t));
    for (int repetition = 0; repetition < 10; ++repetition) {
      std::vector<std::int64_t> depth(before.size(), 0);  // of each task: one more than the deepest that it waits for
      const auto deepest_before = [&](std::size_t t) {
        std::int64_t deepest = 0;
        for (const std::int32_t p : before[t]) deepest = std::max(deepest, depth[static_cast<std::size_t>(p)]);
        return deepest;
      };
      run_on_plain_threads(table, table.steps(), [&](const Task& task) {
        const auto t = static_cast<std::size_t>(task.number);
        depth[t] = deepest_before(t) + 1;
      }, 3);
      for (std::size_t t = 0; t < before.size(); ++t) EXPECT_EQ(depth[t], deepest_before(t) + 1);
    }
  }
}

// One graph, run again and again: each task once, in order, and no steps that a run does not have. Also with more workers than threads, where
// they are sent for.
TEST(WorkerTasks, AGraphOfWorkersRunsManyTimes) {
  for (const bool fused : {false, true}) {
    Simulation sim = bed(fused);
    sim.ensure_forces();
    for (const auto& [threads, workers] : {std::pair{1, 2}, {2, 2}, {2, 5}, {4, 4}}) {
      const TaskTable table = dealt_out(sim, fused, workers);
      std::mutex mutex;
      std::vector<std::int32_t> order;
      tbb::task_arena arena(threads);
      arena.execute([&] {
        FlowGraph graph(table, [&](const Task& task) {
          const std::lock_guard<std::mutex> lock(mutex);
          order.push_back(task.number);
        }, Takers::workers);
        for (const int steps : {4, 1, 3, 4, 2, 4}) {
          order.clear();
          graph.run(steps);
          std::vector<std::int32_t> place(table.tasks().size(), -1);
          for (std::size_t k = 0; k < order.size(); ++k) place[static_cast<std::size_t>(order[k])] = static_cast<std::int32_t>(k);
          for (std::size_t t = 0; t < place.size(); ++t) {
            EXPECT_EQ(place[t] >= 0, table.tasks()[t].offset < steps);
            for (const std::int32_t next : table.successors()[t])
              EXPECT_TRUE(place[static_cast<std::size_t>(next)] < 0 || place[t] < place[static_cast<std::size_t>(next)]);
          }
          EXPECT_EQ(order.size() * 4, table.tasks().size() * static_cast<std::size_t>(steps));
        }
      });
    }
  }
}

// Stretches of the curve, of equal work to a batch, in the order of the table.
TEST(WorkerTasks, WorkIsDealtOutEvenly) {
  Simulation sim = bed(false);
  sim.ensure_forces();
  for (const int workers : {2, 3, 5}) {
    const TaskTable table = dealt_out(sim, false, workers);
    const std::vector<int> worker = worker_of_batches(table, sim.batches().size());
    EXPECT_TRUE(std::is_sorted(worker.begin(), worker.end()));
    std::vector<double> work(static_cast<std::size_t>(workers), 0.0);
    double all = 0.0, largest = 0.0;
    for (std::size_t k = 0; k < worker.size(); ++k) {
      const auto own = static_cast<double>(work_of(sim.batches()[k]));
      work[static_cast<std::size_t>(worker[k])] += own, all += own, largest = std::max(largest, own);
    }
    for (const double of : work) EXPECT_NEAR(of, all / workers, 1.01 * largest);
    EXPECT_FALSE(table.ordered());
    const TaskTable plain(sim.batches(), 4, false);
    for (std::size_t t = 0; t < table.tasks().size(); ++t) EXPECT_EQ(table.tasks()[t].batch, plain.tasks()[t].batch);
  }
}

// Two workers of which one is held up in its first task: it stays there until the other one's thread has done one of its tasks.
TEST(WorkerTasks, AGraphLetsWorkersHelpEachOther) {
  if (tbb::info::default_concurrency() < 2) GTEST_SKIP() << "one core: workers do not help each other";
  Simulation sim = bed(false);
  sim.ensure_forces();
  const TaskTable table = dealt_out(sim, false, 2);
  std::mutex mutex;
  std::condition_variable helped;
  std::vector<int> times(table.tasks().size(), 0);
  std::thread::id held_up;  // whose thread
  bool help_came = false;
  tbb::task_arena two(2);
  two.execute([&] {
    FlowGraph graph(table, [&](const Task& task) {
      const auto t = static_cast<std::size_t>(task.number);
      std::unique_lock<std::mutex> lock(mutex);
      ++times[t];
      if (table.worker()[t] != 0) return;
      if (held_up == std::thread::id()) {
        held_up = std::this_thread::get_id();
        helped.wait_for(lock, std::chrono::seconds(30), [&] { return help_came; });
      } else if (held_up != std::this_thread::get_id()) {
        help_came = true;
        helped.notify_all();
      }
    }, Takers::workers);
    graph.run(4);
  });
  EXPECT_TRUE(help_came);
  for (const int of_task : times) EXPECT_EQ(of_task, 1);
}

// Whoever waits for what will never be done ends too, and soon.
TEST(WorkerTasks, AGraphEndsWhenATaskThrows) {
  Simulation sim = bed(false);
  sim.ensure_forces();
  for (const int workers : {1, 2, 5}) {
    const TaskTable table = dealt_out(sim, false, workers);
    tbb::task_arena two(2);
    two.execute([&] {
      for (std::int32_t bad = 0; bad < static_cast<std::int32_t>(table.tasks().size()); bad += 97) {
        FlowGraph graph(table, [&](const Task& task) {
          if (task.number == bad) throw std::runtime_error("a task");
        }, Takers::workers);
        EXPECT_THROW(graph.run(4), std::runtime_error);
      }
    });
  }
}

TEST(WorkerTasks, AGraphOfWorkersNeedsWorkers) {
  Simulation sim = bed(false);
  sim.ensure_forces();
  const TaskTable plain(sim.batches(), 4, false);
  EXPECT_THROW(FlowGraph(plain, [](const Task&) {}, Takers::workers), std::logic_error);
  EXPECT_NO_THROW(FlowGraph(plain, [](const Task&) {}, Takers::anybody));
  EXPECT_THROW(WorkerTasks{plain}, std::logic_error);
}

}  // namespace
}  // namespace platen
