#include "core/huge_pool.h"

#include <sys/mman.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <iterator>
#include <map>
#include <mutex>
#include <new>
#include <set>
#include <utility>

namespace platen {

namespace {

constexpr std::size_t huge_page = std::size_t{1} << 21, largest_slab = std::size_t{1} << 25;

// Free blocks by place, to be joined with free neighbours, and by size: the smallest that will do is taken, and what is
// left of it stays free. Lists of a rebuild are never exactly as long as those before.
class HugePool {
 public:
  PoolBlock take(std::size_t bytes) {
    const std::size_t size = whole(bytes);
    const std::lock_guard lock(mutex_);
    auto found = by_size_.lower_bound({size, nullptr});
    if (found == by_size_.end()) {
      add_slab(size);
      found = by_size_.lower_bound({size, nullptr});
    }
    const auto [free, at] = *found;
    if (free > size) add_free(at + size, free - size);  // first: it may find no memory to note it in
    by_size_.erase({free, at});
    by_place_.erase(at);
    in_use_ += size;
    return {at, size};
  }
  void give(const PoolBlock& block) noexcept {
    const std::lock_guard lock(mutex_);
    char* at = static_cast<char*>(block.memory);
    std::size_t size = block.bytes;
    in_use_ -= size;
    auto next = by_place_.lower_bound(at);
    if (next != by_place_.end() && next->first == at + size) {
      size += next->second;
      next = forget(next);
    }
    if (next != by_place_.begin()) {
      const auto before = std::prev(next);
      if (before->first + before->second == at) {
        at = before->first, size += before->second;
        forget(before);
      }
    }
    try {
      add_free(at, size);
    } catch (const std::bad_alloc&) {  // no memory for a note of it: it serves nobody any more, nor does what is free next to it
    }
  }
  void trim() noexcept {
    const std::lock_guard lock(mutex_);
    for (const auto& [at, size] : by_place_) {
      const auto begin = (reinterpret_cast<std::uintptr_t>(at) + huge_page - 1) / huge_page * huge_page;
      const auto end = (reinterpret_cast<std::uintptr_t>(at) + size) / huge_page * huge_page;
      if (begin < end) madvise(reinterpret_cast<void*>(begin), end - begin, MADV_DONTNEED);
    }
  }
  PoolUse use() {
    const std::lock_guard lock(mutex_);
    return {held_, in_use_};
  }

 private:
  using ByPlace = std::map<char*, std::size_t>;

  // An odd number of lines, so that blocks of one size, next to each other, start at all the places of a page in turn: else they
  // would fight for the same sets of the first cache.
  static std::size_t whole(std::size_t bytes) {
    const std::size_t lines = (std::max<std::size_t>(bytes, 1) + 63) / 64;
    return 64 * (lines | 1);
  }
  void add_slab(std::size_t size) {
    const std::size_t slab = std::max(next_slab_, (size + huge_page - 1) / huge_page * huge_page);
    void* memory = std::aligned_alloc(huge_page, slab);
    if (memory == nullptr) throw std::bad_alloc();
    madvise(memory, slab, MADV_HUGEPAGE);  // a wish: without huge pages everything still works
    try {
      add_free(static_cast<char*>(memory), slab);
    } catch (...) {
      std::free(memory);
      throw;
    }
    held_ += slab;
    next_slab_ = std::min(2 * next_slab_, largest_slab);
  }
  void add_free(char* at, std::size_t size) {
    const auto noted = by_place_.emplace(at, size).first;
    try {
      by_size_.emplace(size, at);
    } catch (...) {
      by_place_.erase(noted);
      throw;
    }
  }
  ByPlace::iterator forget(ByPlace::iterator block) noexcept {
    by_size_.erase({block->second, block->first});
    return by_place_.erase(block);
  }

  std::mutex mutex_;
  ByPlace by_place_;
  std::set<std::pair<std::size_t, char*>> by_size_;
  std::size_t next_slab_ = huge_page, held_ = 0, in_use_ = 0;
};

HugePool& pool() {
  static HugePool* the_pool = new HugePool;  // outlives every array, also those of static objects
  return *the_pool;
}

}  // namespace

void* take_huge_pages(std::size_t bytes) {
  const bool large = bytes >= huge_page;  // smaller only where nothing is pooled
  const std::size_t alignment = large ? huge_page : 64;
  void* memory = std::aligned_alloc(alignment, (std::max<std::size_t>(bytes, 1) + alignment - 1) / alignment * alignment);
  if (memory == nullptr) throw std::bad_alloc();
  if (large) madvise(memory, bytes, MADV_HUGEPAGE);  // a wish: without huge pages everything still works
  return memory;
}
PoolBlock take_from_pool(std::size_t bytes) { return pool().take(bytes); }
void give_to_pool(const PoolBlock& block) noexcept { pool().give(block); }
PoolUse pool_use() { return pool().use(); }
void trim_pool() noexcept { pool().trim(); }

}  // namespace platen
