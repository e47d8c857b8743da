// In which order the tasks of a bed that no cache holds are run.
//
// Step by step, every array comes from memory twice a step: once for the contacts, once for the integration. But a batch may go
// on as soon as those around it are where it needs them. So those that a cache holds take several steps, and a wave goes through
// the bed. For batches in a row, and steps instead of their two halves:
//
//     step 4 | 10                       number: when a task runs. Each needs three of the step before: its own batch's and
//          3 |  6   9                   the neighbours'. Step by step all of the lowest row would come first.
//          2 |  3   5   8
//          1 |  1   2   4   7   11 ...
//            +---a---b---c---d---e--->
#pragma once

#include <cstdint>
#include <vector>

#include "core/cache_model.h"
#include "core/neighbours.h"
#include "core/step_graph.h"

namespace platen {

// What a cache that forgets what was not touched for longest takes in from memory, if the tasks run as the table has them [bytes];
// of such caches, one for each worker, where the tasks have workers.
double bytes_from_memory(const TaskTable& table, const std::vector<Batch>& batches, double cache);

// An order of the table's tasks that keeps all edges. Greedy: of the batches that may go on
// the one with the lowest price, which rises with what it needs from memory in a cache of so many bytes, falls with the share of
// its neighbours that the cache holds, since those let each other go on, and rises a little with how far ahead it is.
// Takes about two to five times (tasks) x (batches in the cache and around it) operations, and one look at all batches for each group
// far from the others.
//
// Several workers have a part of the bed each, of equally many bytes, and a cache of their own: cores do
// not always share one. Each has its own sequence of tasks; one waits for another's only at the border of their parts, and who
// would have to wait how long is foreseen by the time that tasks should take, longer at a border. By the same forecast the parts are chosen: slabs across an
// axis, or stretches of the curve. With one worker tasks are anybody's.
TaskOrder order_for_cache(const TaskTable& table, const std::vector<Batch>& batches, double bytes, int workers = 1, const ParallelFor& parallel = in_turn);

// Puts the tasks into such an order where the batches have more than twice the bytes; not where they are so small that hundreds
// fit in, for which nobody asks but a case file's `batch`: the search would take longer than it saves. Workers with too few batches to have
// a part of their own take what comes next; of more than two each counts on less than `bytes`. What each counts on; 0 where the table is left as it is.
double order_if_large(TaskTable& table, const std::vector<Batch>& batches, double bytes, int workers, const ParallelFor& parallel = in_turn);

// Gives each worker a stretch of the curve, of about the same work, in the order of the table: for beds in the caches.
void deal_out(TaskTable& table, const std::vector<Batch>& batches, int workers);

}  // namespace platen
