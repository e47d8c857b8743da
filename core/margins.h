// How far each sphere may move until lists must be made anew.
//
// A list of all pairs closer than R_i + R_j + m_i + m_j holds as long as every sphere k has moved by at most m_k since it
// was made. Each sphere has its own margin, by its own speed: a few fast ones between many at rest do not widen the
// lists of all, nor make them anew more often.
//
// Whenever lists are looked at, what a sphere has moved since the last look is taken off: what is left is its room. Single precision
// will do, always rounded down: margins change no bits.
#pragma once

#include "core/aligned.h"

namespace platen {

struct Margins {
  AlignedArray<float> of;  // per particle [m]
  double largest = 0.0;    // of outer ones, which the search needs [m]
};

// A number of single precision not above x >= 0, the largest or the one or two next to it.
inline float rounded_down(double x) { return static_cast<float>(x * (1.0 - 0x1p-23)); }

}  // namespace platen
