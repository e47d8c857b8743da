// A model of the workers' caches while they take a bed's tasks: what they hold, and what comes from memory.
#pragma once

#include <cstdint>
#include <vector>

#include "core/batches.h"
#include "core/step_graph.h"

namespace platen {

// Of each sphere: its row, which alone holds the state while steps have an order, its sums and speed [bytes].
double state_bytes(const Batch& batch);
// Of each contact: its history and lists [bytes].
double contact_bytes(const Batch& batch);
// What a step of a bed that moves in its rows touches of these batches [bytes].
double touched_bytes(const std::vector<Batch>& batches);
// The same with columns, by which it is decided whether it is large.
double touched_bytes_with_columns(const std::vector<Batch>& batches);

// What part of a batch a task needs that no cache holds.
struct Missing {
  double state = 0.0, contacts = 0.0;  // [bytes]
  double all() const { return state + contacts; }
};

// Batches with numbers 0, 1, ..., some of which belong to it; adding, removing and looking at all take little.
class Subset {
 public:
  explicit Subset(std::size_t of) : place_(of, -1) {}
  const std::vector<int>& members() const { return members_; }
  void add(int b) {
    if (place_[static_cast<std::size_t>(b)] >= 0) return;
    place_[static_cast<std::size_t>(b)] = static_cast<int>(members_.size());
    members_.push_back(b);
  }
  void remove(int b) {
    const int place = place_[static_cast<std::size_t>(b)];
    if (place < 0) return;
    members_[static_cast<std::size_t>(place)] = members_.back();
    place_[static_cast<std::size_t>(members_.back())] = place;
    members_.pop_back();
    place_[static_cast<std::size_t>(b)] = -1;
  }

 private:
  std::vector<int> members_;
  std::vector<int> place_;
};

// What the workers' caches hold of their batches: states (2b) and contacts (2b + 1).
class CacheModel {
 public:
  // `worker`: who has each batch; `bytes` of each cache.
  CacheModel(const std::vector<Batch>& batches, const std::vector<int>& worker, double bytes);

  // Batches of a worker that are in its cache or have a neighbour in any.
  const std::vector<int>& around(std::size_t worker) const { return around_[worker].members(); }
  Missing missing(const Task& task) const {
    const auto state = 2 * static_cast<std::size_t>(task.batch);
    return {holds(state) ? 0.0 : size_[state], task.kind == TaskKind::integrate || holds(state + 1) ? 0.0 : size_[state + 1]};
  }
  // Of whichever cache: those let each other go on.
  double share_of_neighbours(int batch) const {
    const auto b = static_cast<std::size_t>(batch);
    return neighbours_[b].empty() ? 0.0 : near_[b] / static_cast<double>(neighbours_[b].size());
  }
  double taken_in() const { return taken_in_; }
  void use(const Task& task) {
    const auto state = 2 * static_cast<std::size_t>(task.batch);
    touch(state);
    if (task.kind != TaskKind::integrate) touch(state + 1);
  }

 private:
  struct Cache {
    double held = 0.0;
    std::vector<std::size_t> uses;
    std::size_t oldest = 0;
  };
  bool holds(std::size_t what) const { return last_use_[what] >= 0; }
  void touch(std::size_t what);
  void tell_neighbours(int batch, int change);
  void update_around(int batch);

  double capacity_, taken_in_ = 0.0;
  std::vector<int> worker_;             // of each batch
  std::vector<double> size_;
  std::vector<std::int64_t> last_use_;  // place in its cache's uses; -1: not held
  std::vector<Cache> one_;              // of each worker
  std::vector<std::vector<int>> neighbours_;
  std::vector<int> near_;               // neighbours whose states are held
  std::vector<Subset> around_;          // of each worker
};

}  // namespace platen
