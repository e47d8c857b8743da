// What room each sphere of a batch has left until a list no longer holds, and how soon it may use it up
// [core/simulation_lists.cpp, Simulation::look].
#pragma once

#include "kernels/vec3.h"
#include "kernels/views.h"

namespace platen {

template <class I>
PLATEN_INLINE typename I::Real length_of(const Vec3<I>& d) {
  return I::sqrt((d.x * d.x + d.y * d.y) + d.z * d.z);
}

// How far spheres are from where they were, but for the drift that all have in common.
template <class I>
PLATEN_INLINE typename I::Real way_since(const Vec3<I>& now, const Vec3<I>& then, const LookConstants& c) {
  return length_of<I>({nearest_image<I>(now.x - then.x - I::set(c.drift[0]), c.width, c.inverse_width),
                       nearest_image<I>(now.y - then.y - I::set(c.drift[1]), c.depth, c.inverse_depth), now.z - then.z - I::set(c.drift[2])});
}

// No room is less than none. Returns what is left of the inner one.
template <class I>
PLATEN_INLINE typename I::Real take_off_room(float* inner, float* outer, const typename I::Real& way) {
  using Real = typename I::Real;
  const Real zero = I::set(0.0), downwards = I::set(1.0 - 0x1p-23);  // so that single precision rounds to no more than it is
  const auto less = [&](float* room) {
    const Real left = (I::load_floats(room) - way) * downwards, some = I::where(left < zero, zero, left);
    I::store_floats(room, some);
    return some;
  };
  less(outer);
  return less(inner);
}

// Takes what each sphere has moved off its room and clears `speed2`. What fills up the last vector has all the room there is.
template <class I>
void look_kernel(const LookBatch& b, const LookConstants& c, LookTotals& totals) noexcept {
  using Real = typename I::Real;
  const Real zero = I::set(0.0), one = I::set(1.0), tiny = I::set(1e-100);
  double lanes[I::width];
  for (int lane = 0; lane < I::width; ++lane) lanes[lane] = lane;
  const Real lane_numbers = I::load(lanes);
  Real fastest = zero, closest = zero;
  for (std::int32_t k = 0; k < b.count; k += I::width) {
    Real left;
    if (b.then_x != nullptr)
      left = take_off_room<I>(b.inner + k, b.outer + k,
                              way_since<I>({I::load(b.x + k), I::load(b.y + k), I::load(b.z + k)}, {I::load(b.then_x + k), I::load(b.then_y + k), I::load(b.then_z + k)}, c));
    else
      left = I::load_floats(b.inner + k);
    const Real speed = length_of<I>({I::load(b.vx + k) - I::set(c.mean[0]), I::load(b.vy + k) - I::set(c.mean[1]), I::load(b.vz + k) - I::set(c.mean[2])});
    const auto exists = lane_numbers < I::set(b.particles - k);
    // Finite where no room is left, so that a speed of 0 times it is a number.
    const Real inverse = one / I::where(left < tiny, tiny, left);
    if (b.particles - k < I::width) I::store_floats(b.inner + k, I::where(exists, left, I::set(c.boundless)));
    I::store_floats(b.speed2 + k, zero);
    // What is no number leaves the second operand as it is.
    fastest = I::max(I::where(exists, speed * inverse, zero), fastest);
    closest = I::max(I::where(exists, inverse, zero), closest);
  }
  totals = {I::largest(fastest), I::largest(closest)};
}

}  // namespace platen
