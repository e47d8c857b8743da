// How much of the processor's third cache the order of tasks counts on.
#pragma once

#include <string>

namespace platen {

// At most, in bytes: more brings little [docs/decisions.md, "Several steps while the cache holds a batch"].
inline constexpr double most_ordered_cache = 12 << 20;

// Three eighths of a third cache of `bytes`, since threads, other programs and what the count leaves out want some too, and no more than
// that; where nobody knows how large it is (0), that [docs/decisions.md, "The cache is asked how large it is"].
double ordered_cache_of(double bytes);

// Of the first processor, as the kernel tells [bytes]. Only speed depends on it.
double ordered_cache();

// "8192K" -> 8 MiB; 0 where that is no size.
double cache_size(const std::string& text);

}  // namespace platen
