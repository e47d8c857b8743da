// What tasks that have workers [core/task_order.h] must wait for of the others.
//
// A worker takes its tasks one after the other, so of all that a task needs from another worker only the latest counts, and nothing
// that an earlier task of its own, or what that one waited for, has already waited for:
//
//     worker 0   a0 --- a1 --- a2 --- a3          a3 needs b1 and b2: it waits for b2 alone
//                                 \               b4 needs a1 and a2: for a2
//     worker 1   b0 --- b1 --- b2  \  b3 --- b4   b3 needs a1 as well, and b4 comes later: for nothing but its own b3 and a2
#pragma once

#include <cstdint>
#include <vector>

#include "core/step_graph.h"

namespace platen {

struct Need {
  std::int32_t task;    // the one to wait for
  std::int32_t worker;  // who takes it
  std::int32_t done;    // tasks of that worker that are done once it is
};

// Of each task of a table whose tasks have workers.
std::vector<std::vector<Need>> needs_of_others(const TaskTable& table);

}  // namespace platen
