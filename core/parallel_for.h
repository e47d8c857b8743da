// Loops that may be shared among threads.
#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>

namespace platen {

// Calls body(k) for k = 0 .. count-1, in any order, on any thread.
using ParallelFor = std::function<void(int count, const std::function<void(int)>& body)>;
// One after the other, on the calling thread.
inline void in_turn(int count, const std::function<void(int)>& body) {
  for (int k = 0; k < count; ++k) body(k);
}

// How many stretches 0 .. n-1 is cut into where it is shared: one where it is not worth it. Does not depend on threads.
inline int stretches_of(std::size_t n) { return static_cast<int>(std::clamp<std::size_t>(n / 8192, 1, 64)); }
struct IndexRange {
  std::size_t first, last;  // one past the end
};
inline IndexRange stretch(std::size_t n, int k) {
  const auto parts = static_cast<std::size_t>(stretches_of(n)), part = static_cast<std::size_t>(k);
  return {n * part / parts, n * (part + 1) / parts};
}
// Calls body(k) for each of 0 .. n-1, stretch by stretch.
template <class Body>
void for_each_in_stretches(std::size_t n, const ParallelFor& parallel, const Body& body) {
  parallel(stretches_of(n), [&](int part) {
    const IndexRange range = stretch(n, part);
    for (std::size_t k = range.first; k < range.last; ++k) body(k);
  });
}

}  // namespace platen
