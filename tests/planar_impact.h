// One planar collision of a sphere with a plane or with another sphere, integrated on its own: the second opinion for
// the Chung & Ooi tests. Shares nothing with kernels/, core/ or reference_contact.h. The normal does not turn while they
// touch; the step is so small (see `steps`) that its error does not show.
//
//   F_n = 4/3 E* sqrt(R*) d^1.5 + c_n d'        S_n = 2 E* sqrt(R* d)     S_t = 8 G* sqrt(R* d)
//   c = 2 sqrt(5/6) sqrt(z m* S)                friction limit: mu times the spring part of F_n
//   total form (planes):        f = -S_t xi - c_t s,   xi' = s            [EDEM]
//   incremental form (pairs):   f = -T - c_t s,        T' = S_t s         [Thakur2016, Eq. 5-9]
// with the slip velocity s = v_1 - a_1 w_1 - v_2 - a_2 w_2; no dashpot while sliding.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

namespace platen::verification {

struct Material {
  double E, nu, rho;
  double G() const { return E / (2.0 * (1.0 + nu)); }
};

struct Impact {
  double R1 = 0.0, R2 = 0.0;  // [m]; R2 = 0: a plane
  Material first{}, second{}; // second: the plane or the other sphere
  double e = 1.0, mu = 0.0;
  double v_n = 0.0;           // approach speed [m/s]
  double v_t = 0.0;           // of body 1 [m/s]
  double w1 = 0.0, w2 = 0.0;  // spins, positive where they roll body 1 along v_t [rad/s]

  bool plane() const { return R2 == 0.0; }
  double E_star() const { return 1.0 / ((1.0 - first.nu * first.nu) / first.E + (1.0 - second.nu * second.nu) / second.E); }
  double G_star() const { return 1.0 / ((2.0 - first.nu) / first.G() + (2.0 - second.nu) / second.G()); }
  double R_star() const { return plane() ? R1 : R1 * R2 / (R1 + R2); }
  double m1() const { return 4.0 / 3.0 * std::numbers::pi * R1 * R1 * R1 * first.rho; }
  double m2() const { return 4.0 / 3.0 * std::numbers::pi * R2 * R2 * R2 * second.rho; }
  double m_star() const { return plane() ? m1() : m1() * m2() / (m1() + m2()); }
  // Hertz, without dashpot.
  double duration() const { return 2.8683 * std::pow(m_star() * m_star() / (R_star() * E_star() * E_star() * v_n), 0.2); }
  double delta_max() const { return std::pow(15.0 * m_star() * v_n * v_n / (16.0 * E_star() * std::sqrt(R_star())), 0.4); }
};

struct Rebound {
  double v_n = 0.0;           // separation speed [m/s]
  double v1 = 0.0, v2 = 0.0;  // tangential [m/s]
  double w1 = 0.0, w2 = 0.0;  // [rad/s]
  double delta_max = 0.0, F_max = 0.0, duration = 0.0;
  double slip = 0.0;          // tangential velocity of the contact point of body 1 against body 2, levers R [m/s]
};

class PlanarImpact {
 public:
  explicit PlanarImpact(const Impact& c) : c_(c), m_(c.m_star()) {
    const double l = std::log(c.e);
    z_ = l * l / (l * l + std::numbers::pi * std::numbers::pi);
  }

  // Midpoint rule with `steps` steps per undamped contact time.
  Rebound run(int steps) const {
    const double h = c_.duration() / steps;
    State y{0.0, c_.v_n, c_.v_t, c_.w1, 0.0, c_.w2, 0.0};
    Rebound r;
    for (double t = 0.0; t < 20.0 * c_.duration(); t += h) {
      const State middle = add(y, rate(y, 0.5 * h), 0.5 * h);
      State next = add(y, rate(middle, 0.5 * h), h);
      next.spring = held(next.spring, next.d);
      r.delta_max = std::max(r.delta_max, next.d);
      r.F_max = std::max(r.F_max, hertz(next.d));
      if (next.d <= 0.0 && next.rate_d < 0.0) {
        r.duration = t + h * y.d / (y.d - next.d);
        y = next;
        break;
      }
      y = next;
    }
    r.v_n = -y.rate_d, r.v1 = y.v1, r.v2 = y.v2, r.w1 = y.w1, r.w2 = y.w2;
    r.slip = y.v1 - y.v2 - c_.R1 * y.w1 - c_.R2 * y.w2;
    return r;
  }

 private:
  struct State {
    double d, rate_d, v1, w1, v2, w2, spring;  // spring: xi (total form) or T (incremental)
  };

  double root(double d) const { return std::sqrt(c_.R_star() * std::max(d, 0.0)); }
  double hertz(double d) const { return 4.0 / 3.0 * c_.E_star() * root(d) * std::max(d, 0.0); }
  double longest(double d) const {
    const double limit = c_.mu * hertz(d), S_t = 8.0 * c_.G_star() * root(d);
    return c_.plane() ? (S_t > 0.0 ? limit / S_t : 0.0) : limit;
  }
  double held(double spring, double d) const { return std::clamp(spring, -longest(d), longest(d)); }

  State rate(const State& y, double h) const {
    const double S_n = 2.0 * c_.E_star() * root(y.d), S_t = 8.0 * c_.G_star() * root(y.d);
    const double c = 2.0 * std::sqrt(5.0 / 6.0 * z_ * m_);
    const double F = hertz(y.d) + (y.d > 0.0 ? c * std::sqrt(S_n) * y.rate_d : 0.0);
    const double a1 = c_.R1 - (c_.plane() ? y.d : 0.5 * y.d), a2 = c_.plane() ? 0.0 : c_.R2 - 0.5 * y.d;
    const double slip = y.v1 - a1 * y.w1 - y.v2 - a2 * y.w2;
    const double grows = c_.plane() ? slip : S_t * slip;
    const bool cut = std::fabs(y.spring + h * grows) >= longest(y.d + h * y.rate_d);
    const double spring = held(y.spring, y.d);
    const double f = -(c_.plane() ? S_t * spring : spring) - (cut || y.d <= 0.0 ? 0.0 : c * std::sqrt(S_t) * slip);
    const double I1 = 0.4 * c_.m1() * c_.R1 * c_.R1, I2 = 0.4 * c_.m2() * c_.R2 * c_.R2;
    return {y.rate_d, -F / m_, f / c_.m1(), -a1 * f / I1, c_.plane() ? 0.0 : -f / c_.m2(), c_.plane() ? 0.0 : -a2 * f / I2, grows};
  }

  static State add(const State& y, const State& k, double h) {
    return {y.d + h * k.d,   y.rate_d + h * k.rate_d, y.v1 + h * k.v1,        y.w1 + h * k.w1,
            y.v2 + h * k.v2, y.w2 + h * k.w2,         y.spring + h * k.spring};
  }

  Impact c_;
  double m_, z_;
};

}  // namespace platen::verification
