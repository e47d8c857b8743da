// Which task the workers of a table take next, while they run side by side.
//
// A worker goes through its own in the order of the table, and past those that still wait for somebody: its neighbours are now a little behind
// and now ahead, and whoever waited at each border would wait as long as the slower of two in every stretch of time.
//
//     worker 0   a0  b0  a1  b1  a2            a1 needs c0, which worker 1 has not done yet: worker 0 takes b1 first, if that can go on.
//                ok  ok  ..  next
//     worker 1   c0  d0  c1  d1                who has nothing left that can go on may take d0 from it: the last that can, farthest from what
//                now                           worker 1 does next
//
// Of a batch's tasks each waits for the one before, so how many of them are done says which.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <vector>

#include "core/step_graph.h"

namespace platen {

class WorkerTasks {
 public:
  // std::logic_error for a table whose tasks have no workers.
  explicit WorkerTasks(const TaskTable& table);
  std::size_t workers() const { return queues_.size(); }
  // None is taken and none is done. Not while anybody takes tasks.
  void start();
  // The first of a worker's next tasks that waits for nothing; -1 where there is none. Each task is taken once.
  std::int32_t take(std::size_t worker);
  // One of another worker's.
  std::int32_t take_from_others(std::size_t worker);
  void done(std::int32_t task);
  bool can_take(std::size_t worker);  // whether there is one now
  // Whether one of the worker's, or of anybody's, is not taken yet.
  bool has_left(std::size_t worker);
  bool have_left();
  // Workers that have a task which waits for this one.
  const std::vector<std::int32_t>& who_waits_for(std::int32_t task) const { return who_waits_[static_cast<std::size_t>(task)]; }

  // How far past a task that cannot go on a worker looks: what it takes too early its cache may not hold any more when its neighbours want it.
  static constexpr std::size_t window = 32;

 private:
  struct Want {
    std::int32_t place;  // in progress_, of a batch
    std::int32_t done;   // tasks of that batch that must be
  };
  struct alignas(128) Queue {  // on lines of its own
    std::atomic<std::size_t> first{0};  // all before are taken
    std::vector<std::int32_t> tasks;
    std::unique_ptr<std::atomic<bool>[]> taken;  // of each of them
  };
  static constexpr int counters_of_a_line = 32;
  struct alignas(128) Line {  // processors fetch them in pairs
    std::atomic<std::int32_t> counters[counters_of_a_line] = {};
  };
  std::atomic<std::int32_t>& progress(std::int32_t place) { return progress_[static_cast<std::size_t>(place / counters_of_a_line)].counters[place % counters_of_a_line]; }
  struct Range {
    std::size_t first, end;
  };
  static Range window_of(Queue& queue);
  bool is_ready(std::int32_t task);
  bool try_to_take(Queue& queue, std::size_t k);

  std::vector<Queue> queues_;                    // of each worker
  std::vector<Line> progress_;                   // tasks of each batch that are done; each worker's batches have lines of their own
  std::vector<std::int32_t> place_, nth_;        // of each task: its batch's place in progress_, how many of the batch come before
  std::vector<std::int32_t> first_want_;         // of each task, and one more
  std::vector<Want> wants_;
  std::vector<std::vector<std::int32_t>> who_waits_;  // of each task
};

}  // namespace platen
