// Long arrays in pieces that the pool has room for: what a rebuild needs for a while takes the memory of what runs of steps would go back
// to, instead of more of the system's.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "core/aligned.h"

namespace platen {

template <class T>
class ChunkedArray {
 public:
  static constexpr std::size_t piece = 4096;  // elements

  // Elements have no value yet.
  void resize_to_overwrite(std::size_t size) {
    pieces_.clear();
    pieces_.resize((size + piece - 1) / piece);
    for (std::size_t k = 0; k < pieces_.size(); ++k) pieces_[k].resize_to_overwrite(std::min(piece, size - k * piece));
    size_ = size;
  }
  void assign(const std::vector<T>& from) {
    resize_to_overwrite(from.size());
    for (std::size_t k = 0; k < pieces_.size(); ++k) std::copy_n(from.data() + k * piece, pieces_[k].size(), pieces_[k].data());
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
  std::vector<AlignedArray<T>> pieces_;
  std::size_t size_ = 0;
};

// Records of spheres [kernels/views.h] lie in one piece each.
static_assert(ChunkedArray<double>::piece % 8 == 0);

}  // namespace platen
