#include "core/huge_pool.h"

#include <sys/mman.h>

#include <algorithm>
#include <cstdlib>
#include <map>
#include <mutex>
#include <new>
#include <vector>

namespace platen {

namespace {

constexpr std::size_t huge_page = std::size_t{1} << 21, largest_slab = std::size_t{1} << 25;

class HugePool {
 public:
  PoolBlock take(std::size_t bytes) {
    const std::size_t size = size_class(bytes);
    const std::lock_guard lock(mutex_);
    // Lists of the next rebuild are a little longer or shorter than those before: a block half as large again will do.
    for (auto of_size = free_.lower_bound(size); of_size != free_.end() && of_size->first <= size + size / 2; ++of_size) {
      std::vector<void*>& free = of_size->second.free;
      if (free.empty()) continue;
      const PoolBlock block{free.back(), of_size->first};
      free.pop_back();
      return block;
    }
    Class& of_size = free_[size];
    // Room for every block of this size, so that giving one back never asks for memory.
    if (of_size.free.capacity() <= of_size.blocks) of_size.free.reserve(2 * of_size.blocks + 1);
    if (left_ < size) {  // the rest of the old slab stays unused: less than one block
      const std::size_t slab = std::max(next_slab_, (size + huge_page - 1) / huge_page * huge_page);
      void* memory = std::aligned_alloc(huge_page, slab);
      if (memory == nullptr) throw std::bad_alloc();
      madvise(memory, slab, MADV_HUGEPAGE);  // a wish: without huge pages everything still works
      at_ = static_cast<char*>(memory), left_ = slab;
      next_slab_ = std::min(2 * next_slab_, largest_slab);
    }
    char* block = at_;
    at_ += size, left_ -= size, ++of_size.blocks;
    return {block, size};
  }
  void give(const PoolBlock& block) noexcept {
    const std::lock_guard lock(mutex_);
    free_.find(block.bytes)->second.free.push_back(block.memory);
  }

 private:
  // Eight sizes from one power of two to the next; not a multiple of 4 KiB, so that blocks of one size do not start at
  // the same place of the first cache.
  static std::size_t size_class(std::size_t bytes) {
    std::size_t step = 64;
    while (16 * step <= bytes) step *= 2;
    const std::size_t size = (bytes + step - 1) / step * step;
    return size % 4096 == 0 ? size + 64 : size;
  }

  struct Class {
    std::vector<void*> free;
    std::size_t blocks = 0;  // free or in use
  };

  std::mutex mutex_;
  std::map<std::size_t, Class> free_;
  char* at_ = nullptr;
  std::size_t left_ = 0, next_slab_ = huge_page;
};

HugePool& pool() {
  static HugePool* the_pool = new HugePool;  // outlives every array, also those of static objects
  return *the_pool;
}

}  // namespace

PoolBlock take_from_pool(std::size_t bytes) { return pool().take(bytes); }
void give_to_pool(const PoolBlock& block) noexcept { pool().give(block); }

}  // namespace platen
