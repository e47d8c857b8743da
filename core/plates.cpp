#include "core/plates.h"

#include <cmath>

namespace platen {

namespace {
constexpr double two_pi = 6.28318530717958647692;
}

double PlaneMotion::position_at(std::int64_t step) const {
  const double t = static_cast<double>(step - start) * dt;
  double p = origin + velocity * t;
  const double shaken = vibrated + t;
  if (amplitude != 0.0 && shaken < vibration_end) p += amplitude * std::sin(two_pi * frequency * shaken);
  return p;
}

double PlaneMotion::velocity_at(std::int64_t step) const {
  const double t = static_cast<double>(step - start) * dt;
  double v = velocity;
  const double shaken = vibrated + t;
  if (amplitude != 0.0 && shaken < vibration_end)
    v += amplitude * (two_pi * frequency) * std::cos(two_pi * frequency * shaken);
  return v;
}

double PlaneMotion::largest_speed() const { return std::fabs(velocity) + amplitude * two_pi * frequency; }

Plane plane_shape(int plate) {
  Plane plane;
  switch (plate) {
    case plate_bottom: plane.axis = 2, plane.sign = 1.0; break;
    case plate_top: plane.axis = 2, plane.sign = -1.0; break;
    case wall_x_low: plane.axis = 0, plane.sign = 1.0; break;
    case wall_x_high: plane.axis = 0, plane.sign = -1.0; break;
    case wall_y_low: plane.axis = 1, plane.sign = 1.0; break;
    default: plane.axis = 1, plane.sign = -1.0; break;
  }
  return plane;
}

}  // namespace platen
