// Long arrays in pieces that the pool has room for: what a rebuild needs for a while takes the memory of what runs of steps would go back
// to, instead of more of the system's; and what they go back to fits into the gaps that lists have left.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "core/aligned.h"

namespace platen {

template <class T, std::size_t elements_of_piece = 4096>
class ChunkedArray {
 public:
  static constexpr std::size_t piece = elements_of_piece;

  // Elements have no value.
  void resize_to_overwrite(std::size_t size) {
    pieces_.resize((size + piece - 1) / piece);
    for (std::size_t k = 0; k < pieces_.size(); ++k) {
      const std::size_t of_this = std::min(piece, size - k * piece);
      if (pieces_[k].size() == of_this) continue;
      pieces_[k] = {};
      pieces_[k].resize_to_overwrite(of_this);
    }
    size_ = size;
  }
  void release() { pieces_.clear(), size_ = 0; }
  // Copies `count` elements to those from `at` on, or from them.
  void put(std::size_t at, const T* from, std::size_t count) {
    for_each_part(at, count, [&](std::size_t to, std::size_t of_this) { std::copy_n(from, of_this, &(*this)[to]), from += of_this; });
  }
  void get(std::size_t at, T* to, std::size_t count) const {
    for_each_part(at, count, [&](std::size_t from, std::size_t of_this) { to = std::copy_n(&(*this)[from], of_this, to); });
  }
  void assign(const std::vector<T>& from) {
    resize_to_overwrite(from.size());
    put(0, from.data(), from.size());
  }
  std::vector<T> in_a_row() const {
    std::vector<T> all;
    all.reserve(size_);
    for (const AlignedArray<T>& of : pieces_) all.insert(all.end(), of.begin(), of.end());
    return all;
  }
  std::size_t size() const { return size_; }
  T& operator[](std::size_t k) { return pieces_[k / piece][k % piece]; }
  const T& operator[](std::size_t k) const { return pieces_[k / piece][k % piece]; }

 private:
  template <class Visit>
  static void for_each_part(std::size_t at, std::size_t count, const Visit& visit) {
    while (count > 0) {
      const std::size_t of_this = std::min(count, piece - at % piece);
      visit(at, of_this);
      at += of_this, count -= of_this;
    }
  }

  std::vector<AlignedArray<T>> pieces_;
  std::size_t size_ = 0;
};

// Records of spheres [kernels/views.h] lie in one piece each.
static_assert(ChunkedArray<double>::piece % 8 == 0);

}  // namespace platen
