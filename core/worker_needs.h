// What tasks that have workers [core/task_order.h] must wait for of the others.
//
// A worker takes its tasks one after the other, so of all that a task needs from another worker only the latest counts, and nothing
// that is known to be done: by what an earlier task of its own waited for, or what that one's worker had waited for, and so on.
//
//     worker 0   a0 --- a1 --- a2              b2 needs a0 and a1: it waits for a1 alone.
//                         \                    b3 needs a1 too: its own b2 has waited for that.
//     worker 1   b0 --- b1 --- b2 --- b3       c1 needs b2, and a1: only for b2, which came after a1.
//                                '.
//     worker 2   c0 -------------- c1
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
