// Ids of the spheres, ascending. Where they follow each other, which is the rule, no more is kept than the first of them.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <utility>
#include <vector>

namespace platen {

class Ids {
 public:
  Ids() = default;
  explicit Ids(std::vector<std::int64_t> ascending) : first_(ascending.empty() ? 0 : ascending.front()), size_(ascending.size()) {
    const auto gap = std::adjacent_find(ascending.begin(), ascending.end(), [](std::int64_t a, std::int64_t b) { return a + 1 != b; });
    if (gap != ascending.end()) ids_ = std::move(ascending);
  }
  std::size_t size() const { return size_; }
  std::int64_t operator[](std::size_t rank) const { return ids_.empty() ? first_ + static_cast<std::int64_t>(rank) : ids_[rank]; }
  std::vector<std::int64_t> all() const {
    if (!ids_.empty()) return ids_;
    std::vector<std::int64_t> all(size_);
    std::iota(all.begin(), all.end(), first_);
    return all;
  }

 private:
  std::int64_t first_ = 0;
  std::size_t size_ = 0;
  std::vector<std::int64_t> ids_;  // empty where they follow each other
};

}  // namespace platen
