// How far each sphere may move until lists must be made anew.
//
// A list of all pairs closer than R_i + R_j + m_i + m_j holds as long as every sphere k has moved by at most m_k since it
// was made. Each sphere has its own margin, by its own speed: a few fast ones between many at rest do not widen the
// lists of all, nor make them anew more often.
#pragma once

#include "core/aligned.h"

namespace platen {

struct Margins {
  AlignedArray<double> of;  // per particle [m]
  double largest = 0.0;     // [m]
};

}  // namespace platen
