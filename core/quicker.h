// Which of two ways to do the same work is the quicker on this machine and now, found by trying both.
#pragma once

#include <cstdint>
#include <vector>

namespace platen {

// One after the other, a few runs of each, and once more unless every run of the one took clearly less than every run of the other; the first
// run of each block does not count, since caches are not yet what they will be. Then the quicker one, until others may have become faster.
// Nothing but time may depend on the way.
class Quicker {
 public:
  int way() const { return way_; }
  // A run in this way took so long per step.
  void took(double seconds) {
    ++runs_;
    if (trying_) {
      if (runs_ > 1) times_[way_].push_back(seconds);
      if (runs_ == runs_of_block) next_block();
    } else if (runs_ == runs_between) {
      trying_ = true, runs_ = 0, blocks_ = 0;
      times_[0].clear(), times_[1].clear();
    }
  }
  bool trying() const { return trying_; }

  static constexpr int runs_of_block = 6, blocks_of_trial = 4, runs_between = 4000;

 private:
  void next_block();
  bool clearly_quicker(int way) const;

  bool trying_ = true;
  int way_ = 0, runs_ = 0, blocks_ = 0;
  std::vector<double> times_[2];
};

}  // namespace platen
