// How many pairs of a list each sphere of a batch owns, in the order of both: mostly a byte each.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "core/huge_pool.h"

namespace platen {

class OwnedCounts {
 public:
  // Of the next sphere.
  void add(std::int32_t pairs) {
    for (; pairs >= more; pairs -= more) bytes_.push_back(more);
    bytes_.push_back(static_cast<std::uint8_t>(pairs));
  }
  void fit() { bytes_.shrink_to_fit(); }
  // Writes down whose each pair is, spheres counted from `first`; up to `beyond` places behind the last are written too.
  void name_owners(std::int32_t first, std::int32_t* owner) const {
    for (const std::uint8_t byte : bytes_) {
      for (std::int32_t k = 0; k == 0 || k < byte; k += 4) std::fill_n(owner + k, 4, first);  // seldom more than once: no branch goes wrong
      owner += byte;
      first += byte == more ? 0 : 1;
    }
  }
  static constexpr std::size_t beyond = 4;  // places
  // Calls visit(sphere, first, end) for each sphere with its pairs, counted from 0.
  template <class Visit>
  void for_each(const Visit& visit) const {
    std::int32_t sphere = 0, first = 0, end = 0;
    for (const std::uint8_t byte : bytes_) {
      end += byte;
      if (byte == more) continue;
      visit(sphere++, first, end);
      first = end;
    }
  }

 private:
  static constexpr std::uint8_t more = 255;  // so many, and what the next byte says
  PooledVector<std::uint8_t> bytes_;
};

}  // namespace platen
