#include "core/worker_needs.h"

#include <algorithm>
#include <functional>

namespace platen {

std::vector<std::vector<Need>> needs_of_others(const TaskTable& table) {
  const std::vector<std::int32_t>& worker = table.worker();
  const std::size_t tasks = worker.size();
  const auto workers = static_cast<std::size_t>(worker_count(table));
  std::vector<std::vector<std::int32_t>> before(tasks);
  for (std::size_t t = 0; t < tasks; ++t)
    for (const std::int32_t next : table.successors()[t]) before[static_cast<std::size_t>(next)].push_back(static_cast<std::int32_t>(t));

  // So many tasks of each worker are known to be done when a task ends; of its own, the task included.
  std::vector<std::int32_t> known(tasks * workers, 0), done(workers, 0), last(workers, -1);
  const auto of = [&](std::int32_t task) { return known.data() + static_cast<std::size_t>(task) * workers; };
  const auto learn = [&](std::int32_t* now, std::int32_t from) {
    for (std::size_t w = 0; w < workers; ++w) now[w] = std::max(now[w], of(from)[w]);
  };
  std::vector<std::vector<Need>> needs(tasks);
  for (std::size_t t = 0; t < tasks; ++t) {
    const auto own = static_cast<std::size_t>(worker[t]);
    std::int32_t* const now = of(static_cast<std::int32_t>(t));
    if (last[own] >= 0) learn(now, last[own]);
    // The latest first: what those waited for, earlier ones need not be waited for again.
    std::sort(before[t].begin(), before[t].end(), std::greater<>());
    for (const std::int32_t task : before[t]) {
      const std::int32_t other = worker[static_cast<std::size_t>(task)];
      const std::int32_t there = of(task)[other];
      if (now[other] >= there) continue;
      learn(now, task);
      needs[t].push_back({task, other, there});
    }
    now[own] = ++done[own];
    last[own] = static_cast<std::int32_t>(t);
  }
  return needs;
}

}  // namespace platen
