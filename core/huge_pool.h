// Memory on huge pages for arrays that are too small to fill whole pages of their own (core/aligned.h says how small).
//
// A bed has dozens to hundreds of lists of ten kilobytes to a megabyte each. On pages of 4 KiB they take more of them than
// a processor keeps translations for, and every pass over the bed pays for looking them up again, twice over in a
// virtual machine.
#pragma once

#include <cstddef>

namespace platen {

struct PoolBlock {
  void* memory = nullptr;
  std::size_t bytes = 0;
};

// A block of at least `bytes`, 64-byte aligned, of which all may be used. Any thread may ask; memory that is given back is
// kept for others. Throws std::bad_alloc.
PoolBlock take_from_pool(std::size_t bytes);
void give_to_pool(const PoolBlock& block) noexcept;

}  // namespace platen
