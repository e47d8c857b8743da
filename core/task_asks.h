// What tasks ask for ahead of others.
//
// In the order for a cache [core/task_order.h] one task in four comes upon a batch that has left it. Which ones is known
// beforehand; so the contacts of the few batches before ask for a part of it each, and memory works all the time instead of a quarter of it:
//
//     tasks of a worker    contacts 7   integrate 8   contacts 8   contacts 3   integrate 9 ...      (9: in no cache)
//     asks for parts of    state 9                    state 9      state 9
#pragma once

#include <cstdint>
#include <vector>

#include "core/batches.h"
#include "core/step_graph.h"

namespace platen {

// A part of what a batch has: of its state, or of its contacts.
struct Asked {
  std::int32_t batch;
  bool contacts;
  double from, to;  // shares of each of its arrays, 0 to 1
  int offset;       // step of the task that needs it: runs may be shorter than the table
};

// What the order for a cache counts on is part of one; tasks ask for what this many times as much would not hold either.
inline constexpr double asked_beyond = 2.0;
inline constexpr std::size_t most_asked = 4;  // parts that one task asks for
using TaskAsks = std::vector<std::vector<Asked>>;  // of each task of a table

// What a cache of so many bytes for each worker will not hold when it is needed, dealt out to the tasks with contacts that the same
// worker takes last before.
TaskAsks asks_of_tasks(const TaskTable& table, const std::vector<Batch>& batches, double bytes);

}  // namespace platen
