// Where in memory what a task asks for lies [core/task_asks.h].
#pragma once

#include <array>
#include <cstddef>

#include "kernels/views.h"

namespace platen {

// Stretches of memory, in whole lines of a cache. Those that find no place are left out: nothing depends on who is asked.
class StretchesOfLines {
 public:
  // The part of an array between two shares of it.
  template <class T>
  void add(const T* array, std::size_t size, double from, double to) {
    const double lines = static_cast<double>(size * sizeof(T)) / line;
    const auto first = static_cast<std::int64_t>(from * lines), end = static_cast<std::int64_t>(to * lines);
    if (array == nullptr || end <= first || count_ == stretches_.size()) return;
    stretches_[count_++] = {reinterpret_cast<const char*>(array) + line * first, end - first};
    lines_ += end - first;
  }
  // Has a pass over contacts ask for them, as many with each of its chunks.
  void put_into(PairBatch& pairs) const {
    pairs.lines = stretches_.data(), pairs.stretches = static_cast<std::int32_t>(count_);
    const std::int64_t chunks = (pairs.count + chunk_size - 1) / chunk_size;
    pairs.lines_of_chunk = static_cast<std::int32_t>(chunks > 0 ? (lines_ + chunks - 1) / chunks : 0);
  }
  std::int64_t lines() const { return lines_; }

 private:
  static constexpr std::int64_t line = 64;
  std::array<AskedLines, 128> stretches_;
  std::size_t count_ = 0;
  std::int64_t lines_ = 0;
};

}  // namespace platen
