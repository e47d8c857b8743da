// Memory on huge pages for arrays that are too small to fill whole pages of their own (core/aligned.h says how small).
//
// A bed has dozens to hundreds of lists of ten kilobytes to a megabyte each. On pages of 4 KiB they take more of them than
// a processor keeps translations for, and every pass over the bed pays for looking them up again, twice over in a
// virtual machine.
#pragma once

#include <cstddef>
#include <cstdlib>
#include <new>
#include <utility>
#include <vector>

namespace platen {

struct PoolBlock {
  void* memory = nullptr;
  std::size_t bytes = 0;
};

struct PoolUse {
  std::size_t held = 0, in_use = 0;  // by the pool, resident or not; by those who took blocks of it [bytes]
};

// A block of at least `bytes`, 64-byte aligned, of which all may be used. Any thread may ask; memory that is given back is
// kept for others, joined with what is free next to it. Throws std::bad_alloc.
PoolBlock take_from_pool(std::size_t bytes);
void give_to_pool(const PoolBlock& block) noexcept;
PoolUse pool_use();
// Whole huge pages that nobody uses go back to the system, until they are taken again.
void trim_pool() noexcept;

// Whole huge pages of the system's, or what the heap has where that is too much; for std::free. Throws std::bad_alloc.
void* take_huge_pages(std::size_t bytes);

// Blocks of this size and more are not kept: they would fill memory that is needed between rebuilds.
inline constexpr std::size_t largest_pooled = std::size_t{1} << 24;
#if defined(__SANITIZE_ADDRESS__)
inline constexpr bool pools = false;  // AddressSanitizer guards blocks of its own
#else
inline constexpr bool pools = true;
#endif

// For vectors that every rebuild makes anew. From the heap they went back to the system each time, which had to clear their
// pages again for the next one: a fifth of a rebuild. New elements of plain types have no value until they are given one, so that
// whoever does so is the first to touch them.
template <class T>
struct PoolAllocator {
  using value_type = T;
  PoolAllocator() = default;
  template <class U>
  PoolAllocator(const PoolAllocator<U>&) {}
  T* allocate(std::size_t count) {
    // The block's size stands before it: it may be larger than what was asked for.
    const std::size_t bytes = count * sizeof(T) + header;
    if (!pools || bytes >= largest_pooled) return static_cast<T*>(take_huge_pages(count * sizeof(T)));
    const PoolBlock block = take_from_pool(bytes);
    *static_cast<std::size_t*>(block.memory) = block.bytes;
    return reinterpret_cast<T*>(static_cast<char*>(block.memory) + header);
  }
  void deallocate(T* p, std::size_t count) noexcept {
    if (!pools || count * sizeof(T) + header >= largest_pooled) return std::free(p);
    void* const memory = reinterpret_cast<char*>(p) - header;
    give_to_pool({memory, *static_cast<std::size_t*>(memory)});
  }
  template <class U>
  void construct(U* p) noexcept {
    ::new (static_cast<void*>(p)) U;
  }
  template <class U, class... Arguments>
  void construct(U* p, Arguments&&... arguments) {
    ::new (static_cast<void*>(p)) U(std::forward<Arguments>(arguments)...);
  }
  friend bool operator==(const PoolAllocator&, const PoolAllocator&) { return true; }

 private:
  static constexpr std::size_t header = 64;
};
template <class T>
using PooledVector = std::vector<T, PoolAllocator<T>>;

}  // namespace platen
