// How many pairs of a list each sphere of a batch owns, in the order of both: mostly a byte each.
#pragma once

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
