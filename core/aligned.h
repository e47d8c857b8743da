// Arrays for vector loads: 64-byte aligned, on huge pages where they are large and the system has them, each with its
// own start within a page so that arrays of equal length do not fight for the same cache sets (those of the pool as its blocks start).
#pragma once

#include <sys/mman.h>

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <new>
#include <type_traits>

#include "core/huge_pool.h"

namespace platen {

// A growing array of plain numbers. Growing keeps the old content; new elements are zero.
template <class T>
class AlignedArray {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  AlignedArray() = default;
  AlignedArray(const AlignedArray&) = delete;
  AlignedArray& operator=(const AlignedArray&) = delete;
  AlignedArray(AlignedArray&& other) noexcept { swap(other); }
  AlignedArray& operator=(AlignedArray&& other) noexcept {
    swap(other);
    return *this;
  }
  ~AlignedArray() { release(); }

  void swap(AlignedArray& other) noexcept {
    std::swap(block_, other.block_);
    std::swap(pooled_, other.pooled_);
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
    std::swap(capacity_, other.capacity_);
  }

  // Sets the size; elements from the old size on are zero.
  void resize(std::size_t size) {
    reserve(size);
    if (size > size_) std::fill(data_ + size_, data_ + size, T{});
    size_ = size;
  }
  // The same, but those from the old size on have no value yet.
  void resize_to_overwrite(std::size_t size) {
    reserve(size);
    size_ = size;
  }
  void assign(std::size_t size, T value) {
    if (size > capacity_) *this = AlignedArray();  // first: what is there serves nobody any more
    size_ = 0;
    reserve(size);
    std::fill(data_, data_ + size, value);
    size_ = size;
  }
  // The same for what lists hold: in memory of that size, not in what a longer list has left.
  void renew(std::size_t size, T value) {
    if (capacity_ > size + size / 8 + 64) *this = AlignedArray();
    assign(size, value);
  }
  void reserve(std::size_t capacity) {
    if (capacity > capacity_) grow(capacity);
  }

  T* data() { return data_; }
  const T* data() const { return data_; }
  std::size_t size() const { return size_; }
  std::size_t capacity() const { return capacity_; }
  bool empty() const { return size_ == 0; }
  T& operator[](std::size_t k) { return data_[k]; }
  const T& operator[](std::size_t k) const { return data_[k]; }
  T* begin() { return data_; }
  T* end() { return data_ + size_; }
  const T* begin() const { return data_; }
  const T* end() const { return data_ + size_; }

 private:
  // An array of its own takes whole huge pages: half a page too much on average, which is little from eight pages on.
  static constexpr std::size_t huge_page = std::size_t{1} << 21, smallest_pooled = 2048;
  static_assert(largest_pooled == 8 * huge_page);
  void grow(std::size_t capacity) {
    const std::size_t bytes = capacity * sizeof(T);
    const bool large = bytes >= largest_pooled, pooled = pools && !large && bytes >= smallest_pooled;
    void* block = nullptr;
    std::size_t stagger = 0;
    std::size_t of_pool = 0;
    if (pooled) {
      const PoolBlock from_pool = take_from_pool(bytes);
      block = from_pool.memory, of_pool = from_pool.bytes, capacity = of_pool / sizeof(T);
    } else {
      const std::size_t alignment = large ? huge_page : 64;
      stagger = large ? 64 * (next_start() % 61) : 0;
      const std::size_t whole = (bytes + stagger + alignment - 1) / alignment * alignment;
      block = std::aligned_alloc(alignment, whole);
      if (block == nullptr) throw std::bad_alloc();
      if (large) madvise(block, whole, MADV_HUGEPAGE);  // a wish: without huge pages everything still works
      capacity = (whole - stagger) / sizeof(T);
    }
    T* data = reinterpret_cast<T*>(static_cast<char*>(block) + stagger);
    std::copy(data_, data_ + size_, data);
    release();
    block_ = block, data_ = data, capacity_ = capacity, pooled_ = of_pool;
  }
  void release() {
    if (pooled_ > 0)
      give_to_pool({block_, pooled_});
    else
      std::free(block_);
  }
  static unsigned next_start() {
    static std::atomic<unsigned> counter{0};
    return counter.fetch_add(7, std::memory_order_relaxed);
  }

  void* block_ = nullptr;
  std::size_t pooled_ = 0;  // bytes of the pool's block; 0: from the heap
  T* data_ = nullptr;
  std::size_t size_ = 0, capacity_ = 0;
};

}  // namespace platen
