// Which tasks wait for each task of a table: one list behind the other, since a large bed has tens of thousands of them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace platen {

class TaskSuccessors {
 public:
  TaskSuccessors() = default;
  // The same seen from those who wait: `waits_for[t]` of the tasks in `before`, one task's behind the other's. Lists ascend.
  TaskSuccessors(const std::vector<std::int32_t>& before, const std::vector<std::int32_t>& waits_for) : start_(waits_for.size() + 1, 0), all_(before.size()) {
    for (const std::int32_t task : before) ++start_[static_cast<std::size_t>(task) + 1];
    for (std::size_t t = 1; t < start_.size(); ++t) start_[t] += start_[t - 1];
    std::vector<std::int32_t> next(start_.begin(), start_.end() - 1);
    std::size_t k = 0;
    for (std::size_t t = 0; t < waits_for.size(); ++t)
      for (std::int32_t n = 0; n < waits_for[t]; ++n) all_[static_cast<std::size_t>(next[static_cast<std::size_t>(before[k++])]++)] = static_cast<std::int32_t>(t);
  }
  std::size_t size() const { return start_.size() - 1; }
  std::span<const std::int32_t> operator[](std::size_t task) const { return {all_.data() + start_[task], all_.data() + start_[task + 1]}; }
  // The list of the next task, whoever has none yet.
  template <class Each>
  void add(std::span<const std::int32_t> tasks, const Each& renamed) {
    for (const std::int32_t task : tasks) all_.push_back(renamed(task));
    start_.push_back(static_cast<std::int32_t>(all_.size()));
  }
  void reserve(std::size_t tasks, std::size_t edges) { start_.reserve(tasks + 1), all_.reserve(edges); }
  std::size_t edges() const { return all_.size(); }
  // Whether there was one.
  bool remove(std::int32_t from, std::int32_t to) {
    for (std::int32_t k = start_[static_cast<std::size_t>(from)]; k < start_[static_cast<std::size_t>(from) + 1]; ++k) {
      if (all_[static_cast<std::size_t>(k)] != to) continue;
      all_.erase(all_.begin() + k);
      for (auto t = static_cast<std::size_t>(from) + 1; t < start_.size(); ++t) --start_[t];
      return true;
    }
    return false;
  }

 private:
  std::vector<std::int32_t> start_ = {0}, all_;
};

}  // namespace platen
