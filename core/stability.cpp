#include "core/stability.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <numbers>
#include <stdexcept>
#include <string>

namespace platen {

namespace {

// x seen through the springs (weight_k = dt^2 or 1) and dashpots (weight_c = 2 dt or 0) of all contacts, with masses
// taken out: y = M^-1/2 (weight_k K + weight_c C) M^-1/2 x, which has the eigenvalues of M^-1 (...) and is symmetric.
// Vectors have six numbers a body: displacement, turn.
class NetworkOperator {
 public:
  NetworkOperator(const std::vector<NetworkBody>& bodies, const std::vector<StiffContact>& contacts)
      : contacts_(contacts), scale_(2 * bodies.size()), moved_(6 * bodies.size()) {
    for (std::size_t b = 0; b < bodies.size(); ++b) {
      const double m = bodies[b].mass, R = bodies[b].radius;
      scale_[2 * b] = 1.0 / std::sqrt(m);
      scale_[2 * b + 1] = 1.0 / std::sqrt(0.4 * m * R * R);
    }
  }

  void weigh(double weight_k, double weight_c) { weight_k_ = weight_k, weight_c_ = weight_c; }
  std::size_t size() const { return moved_.size(); }
  int passes() const { return passes_; }

  void apply(const std::vector<double>& x, std::vector<double>& y) {
    ++passes_;
    for (std::size_t k = 0; k < x.size(); ++k) moved_[k] = scale_[k / 3] * x[k];
    std::fill(y.begin(), y.end(), 0.0);
    for (const StiffContact& c : contacts_) {
      const std::array<double, 3> F = force(c);
      const double* n = c.n;
      const double T[3] = {n[1] * F[2] - n[2] * F[1], n[2] * F[0] - n[0] * F[2], n[0] * F[1] - n[1] * F[0]};  // n x F
      double* y_i = &y[6 * static_cast<std::size_t>(c.i)];
      for (int k = 0; k < 3; ++k) y_i[k] += F[static_cast<std::size_t>(k)], y_i[3 + k] -= c.a_i * T[k];
      if (c.j < 0) continue;
      double* y_j = &y[6 * static_cast<std::size_t>(c.j)];
      for (int k = 0; k < 3; ++k) y_j[k] -= F[static_cast<std::size_t>(k)], y_j[3 + k] -= c.a_j * T[k];
    }
    for (std::size_t k = 0; k < y.size(); ++k) y[k] *= scale_[k / 3];
  }

  // The contact whose share u_c.F of the quadratic form of x is largest.
  int stiffest(const std::vector<double>& x) {
    for (std::size_t k = 0; k < x.size(); ++k) moved_[k] = scale_[k / 3] * x[k];
    int found = -1;
    double most = -1.0;
    for (std::size_t c = 0; c < contacts_.size(); ++c) {
      const std::array<double, 3> u = slip(contacts_[c]), F = force(contacts_[c]);
      const double energy = u[0] * F[0] + u[1] * F[1] + u[2] * F[2];
      if (energy > most) most = energy, found = static_cast<int>(c);
    }
    return found;
  }

 private:
  std::array<double, 3> slip(const StiffContact& c) const {
    const double* i = &moved_[6 * static_cast<std::size_t>(c.i)];
    const double* n = c.n;
    double u[3] = {i[0], i[1], i[2]}, w[3] = {c.a_i * i[3], c.a_i * i[4], c.a_i * i[5]};
    if (c.j >= 0) {
      const double* j = &moved_[6 * static_cast<std::size_t>(c.j)];
      for (int k = 0; k < 3; ++k) u[k] -= j[k], w[k] += c.a_j * j[3 + k];
    }
    return {u[0] - (w[1] * n[2] - w[2] * n[1]), u[1] - (w[2] * n[0] - w[0] * n[2]), u[2] - (w[0] * n[1] - w[1] * n[0])};
  }

  std::array<double, 3> force(const StiffContact& c) const {
    const std::array<double, 3> u = slip(c);
    const double normal = weight_k_ * c.k_n + weight_c_ * c.c_n, tangential = weight_k_ * c.k_t + weight_c_ * c.c_t;
    const double along = (normal - tangential) * (u[0] * c.n[0] + u[1] * c.n[1] + u[2] * c.n[2]);
    return {tangential * u[0] + along * c.n[0], tangential * u[1] + along * c.n[1], tangential * u[2] + along * c.n[2]};
  }

  const std::vector<StiffContact>& contacts_;
  std::vector<double> scale_;  // per body 1/sqrt(m), 1/sqrt(I)
  std::vector<double> moved_;  // scratch, 6 per body
  double weight_k_ = 1.0, weight_c_ = 0.0;
  int passes_ = 0;
};

double dot(const std::vector<double>& x, const std::vector<double>& y) {
  double sum = 0.0;
  for (std::size_t k = 0; k < x.size(); ++k) sum += x[k] * y[k];
  return sum;
}

// Symmetric tridiagonal matrix: diagonal alpha[0..m), off-diagonal beta[0..m-1).
struct Tridiagonal {
  std::vector<double> alpha, beta;

  // Number of eigenvalues above x, by the signs of the pivots of T - x (Sturm's sequence) [Parlett1998, ch. 3].
  int above(double x) const {
    int count = 0;
    double pivot = 1.0;
    for (std::size_t k = 0; k < alpha.size(); ++k) {
      pivot = alpha[k] - x - (k > 0 ? beta[k - 1] * beta[k - 1] / pivot : 0.0);
      if (pivot == 0.0) pivot = -1e-300;
      if (pivot > 0.0) ++count;
    }
    return count;
  }

  // The rank-th largest eigenvalue (from 1), by bisection within Gershgorin's bound, to 1e-13 of that.
  double eigenvalue(int rank) const {
    double high = 0.0;
    for (std::size_t k = 0; k < alpha.size(); ++k)
      high = std::max(high, std::abs(alpha[k]) + (k > 0 ? beta[k - 1] : 0.0) + (k + 1 < alpha.size() ? beta[k] : 0.0));
    double low = -high;
    for (int halving = 0; halving < 44; ++halving) {
      const double middle = 0.5 * (low + high);
      (above(middle) >= rank ? low : high) = middle;
    }
    return high;
  }

  // Unit eigenvector of the largest eigenvalue, from its last component backwards: there it grows, so errors do not.
  std::vector<double> top_vector(double theta) const {
    const std::size_t m = alpha.size();
    std::vector<double> s(m, 0.0);
    s[m - 1] = 1.0;
    double squares = 1.0;
    for (std::size_t k = m - 1; k-- > 0;) {
      const double beyond = k + 2 < m ? beta[k + 1] * s[k + 2] : 0.0;
      s[k] = ((theta - alpha[k + 1]) * s[k + 1] - beyond) / beta[k];
      squares += s[k] * s[k];
      if (squares > 1e200) {  // long before overflow
        for (std::size_t l = k; l < m; ++l) s[l] *= 1e-100;
        squares *= 1e-200;
      }
    }
    const double inverse = 1.0 / std::sqrt(squares);
    for (double& value : s) value *= inverse;
    return s;
  }
};

// A value in [-1, 1) that looks random and belongs to an id and a component (mixing of splitmix64 [Steele2014]).
double hashed(std::uint64_t id, std::uint64_t component) {
  std::uint64_t x = 6 * id + component + 1;
  x *= 0x9e3779b97f4a7c15u;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
  x ^= x >> 31;
  return static_cast<double>(x >> 11) * 0x1p-52 - 1.0;
}

constexpr int least_iterations = 24;

class LargestEigenvalue {
 public:
  LargestEigenvalue(NetworkOperator& network, std::vector<double> start, const StepLimitOptions& options)
      : network_(network),
        start_(std::move(start)),
        options_(options),
        q_(start_.size()),
        previous_(start_.size()),
        w_(start_.size()) {}

  // lambda_max of weight_k K + weight_c C, rounded up by an error bound.
  double find(double weight_k, double weight_c) {
    network_.weigh(weight_k, weight_c);
    T_ = {};
    begin();
    double estimate = 0.0;
    const int most = std::max(1, options_.max_iterations);
    for (int m = 1; m <= most; ++m) {
      const double beta = advance(m > 1 ? T_.beta.back() : 0.0, nullptr);
      theta_ = T_.eigenvalue(1);
      // |A x - theta x| for Ritz vector x: an eigenvalue lies within it, and within its square divided by the distance
      // to the rest of the spectrum, for which the next Ritz value stands [Parlett1998, ch. 11 and 13].
      const double residual = beta * std::abs(T_.top_vector(theta_).back());
      const double gap = m > 1 ? theta_ - T_.eigenvalue(2) : 0.0;
      const double error = residual < gap ? residual * residual / gap : residual;
      estimate = theta_ + error;
      // Nothing is left outside the space spanned so far: the value is exact.
      if (beta <= 1e-12 * theta_) return theta_;
      // Not sooner, however small the error seems: with many modes nearly as fast as the fastest, a Ritz value lingers
      // at a slower one for a dozen iterations (2 % short of dt_limit in 1 of 40 beds when stopped at 16).
      if (m >= least_iterations && error <= options_.tolerance * theta_ && residual <= 0.1 * theta_) break;
      if (m < most) step_to_next(beta);
    }
    return estimate;
  }

  // Ritz vector of the last find, by running it once more.
  std::vector<double> mode() {
    const Tridiagonal T = T_;
    const std::vector<double> s = T.top_vector(theta_);
    std::vector<double> x(start_.size(), 0.0);
    T_ = {};
    begin();
    for (std::size_t k = 0; k < s.size(); ++k) {
      const double beta = advance(k > 0 ? T.beta[k - 1] : 0.0, &x, s[k]);
      if (k + 1 < s.size()) step_to_next(beta);
    }
    return x;
  }

 private:
  void begin() {
    q_ = start_;
    std::fill(previous_.begin(), previous_.end(), 0.0);
  }

  // w = A q minus its parts along q and the vector before; returns its length.
  double advance(double beta_before, std::vector<double>* sum, double share = 0.0) {
    if (sum)
      for (std::size_t k = 0; k < q_.size(); ++k) (*sum)[k] += share * q_[k];
    network_.apply(q_, w_);
    const double alpha = dot(q_, w_);
    T_.alpha.push_back(alpha);
    double squares = 0.0;
    for (std::size_t k = 0; k < w_.size(); ++k) {
      w_[k] -= alpha * q_[k] + beta_before * previous_[k];
      squares += w_[k] * w_[k];
    }
    return std::sqrt(squares);
  }

  void step_to_next(double beta) {
    T_.beta.push_back(beta);
    const double inverse = 1.0 / beta;
    for (std::size_t k = 0; k < w_.size(); ++k) {
      previous_[k] = q_[k];
      q_[k] = w_[k] * inverse;
    }
  }

  NetworkOperator& network_;
  std::vector<double> start_;
  StepLimitOptions options_;
  std::vector<double> q_, previous_, w_;
  Tridiagonal T_;
  double theta_ = 0.0;
};

void check(const std::vector<NetworkBody>& bodies, const std::vector<StiffContact>& contacts, std::size_t ids) {
  const auto fail = [](const char* what, std::size_t index) {
    throw std::invalid_argument(std::string("step_limits: ") + what + " " + std::to_string(index));
  };
  if (ids != 0 && ids != bodies.size()) throw std::invalid_argument("step_limits: one id per body, or none");
  for (std::size_t b = 0; b < bodies.size(); ++b)
    if (!(bodies[b].mass > 0.0 && bodies[b].radius > 0.0 && std::isfinite(bodies[b].mass * bodies[b].radius)))
      fail("mass or radius of body", b);
  const auto count = static_cast<std::int64_t>(bodies.size());
  for (std::size_t k = 0; k < contacts.size(); ++k) {
    const StiffContact& c = contacts[k];
    if (c.i < 0 || c.i >= count || c.j >= count || c.i == c.j) fail("bodies of contact", k);
    if (!(std::min({c.k_n, c.k_t, c.c_n, c.c_t}) >= 0.0)) fail("stiffness or dashpot of contact", k);
    if (!std::isfinite(c.k_n + c.k_t + c.c_n + c.c_t + c.a_i + c.a_j + c.n[0] + c.n[1] + c.n[2]))
      fail("numbers of contact", k);
  }
}

// Unit start vector made of ids.
std::vector<double> start_vector(std::size_t bodies, const std::vector<std::int64_t>& ids) {
  std::vector<double> x(6 * bodies);
  for (std::size_t b = 0; b < bodies; ++b)
    for (std::size_t k = 0; k < 6; ++k)
      x[6 * b + k] = hashed(static_cast<std::uint64_t>(ids.empty() ? static_cast<std::int64_t>(b) : ids[b]), k);
  const double inverse = 1.0 / std::sqrt(dot(x, x));
  for (double& value : x) value *= inverse;
  return x;
}

// Largest dt with lambda_max[dt^2 K + 2 dt C] <= 4. For a fixed mode lambda/dt is a straight line in dt, p dt + 2 q
// with its share p of the springs and q of the dashpots; over all modes it is the upper envelope of such lines. So
// each round solves p dt^2 + 2 q dt = 4 with the slope seen last, which converges in two or three rounds; no logarithm
// is needed.
double damped_limit(LargestEigenvalue& largest, const std::vector<StiffContact>& contacts, double lambda_K,
                    double dt_guess) {
  double k_sum = 0.0, c_sum = 0.0;
  for (const StiffContact& c : contacts) k_sum += c.k_n + 2.0 * c.k_t, c_sum += c.c_n + 2.0 * c.c_t;
  if (!(lambda_K > 0.0)) return 4.0 / largest.find(0.0, 2.0);

  const auto solve = [](double p, double q) { return 4.0 / (q + std::sqrt(q * q + 4.0 * p)); };
  const double dt_crit = solve(lambda_K, 0.0);
  if (!(c_sum > 0.0)) return dt_crit;
  // Without a guess: as if every contact had the mean ratio of dashpot to spring.
  double dt = dt_guess > 0.0 ? std::min(dt_guess, dt_crit) : solve(lambda_K, lambda_K * c_sum / k_sum);
  double p = lambda_K, dt_before = 0.0, line_before = 0.0;
  for (int round = 0; round < 6; ++round) {
    const double lambda = largest.find(dt * dt, 2.0 * dt), line = lambda / dt;
    if (round > 0 && dt != dt_before) p = (line - line_before) / (dt - dt_before);
    p = std::clamp(p, 0.0, std::min(lambda_K, line / dt));
    dt_before = dt, line_before = line;
    dt = solve(p, 0.5 * (line - p * dt));
    if (std::abs(lambda - 4.0) <= 0.02) break;
  }
  return std::min(dt, dt_crit);
}

// 27 equal spheres in hexagonal close packing, radius 1: three layers of three rows of three, 88 contacts.
std::vector<StiffContact> close_packing(double k2, double k_t, double c_n, double c_t) {
  std::array<std::array<double, 3>, 27> centre{};
  const double root3 = std::numbers::sqrt3;
  for (int b = 0; b < 27; ++b) {
    const int column = b % 3, row = b / 3 % 3, layer = b / 9;
    centre[static_cast<std::size_t>(b)] = {2.0 * column + row % 2 + layer % 2, root3 * row + layer % 2 / root3,
                                           2.0 * std::sqrt(6.0) / 3.0 * layer};
  }
  std::vector<StiffContact> contacts;
  for (int i = 0; i < 27; ++i)
    for (int j = 0; j < i; ++j) {
      const auto &x = centre[static_cast<std::size_t>(i)], &y = centre[static_cast<std::size_t>(j)];
      const double d[3] = {x[0] - y[0], x[1] - y[1], x[2] - y[2]};
      const double length = std::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
      if (length < 2.001)
        contacts.push_back({i, j, {d[0] / length, d[1] / length, d[2] / length}, 1.0, 1.0, k2, k_t, c_n, c_t});
    }
  return contacts;
}

}  // namespace

StepLimits step_limits(const std::vector<NetworkBody>& bodies, const std::vector<StiffContact>& contacts,
                       const std::vector<std::int64_t>& ids, const StepLimitOptions& options) {
  check(bodies, contacts, ids.size());
  StepLimits limits;
  if (contacts.empty()) return limits;
  NetworkOperator network(bodies, contacts);
  LargestEigenvalue largest(network, start_vector(bodies.size(), ids), options);
  const double lambda_K = largest.find(1.0, 0.0);
  limits.omega_max = std::sqrt(lambda_K);
  if (lambda_K > 0.0) limits.dt_crit = 2.0 / limits.omega_max;
  limits.dt_limit = options.damped ? damped_limit(largest, contacts, lambda_K, options.dt_guess) : limits.dt_crit;
  if (options.find_ruling) {
    const std::vector<double> x = largest.mode();
    double most = -1.0;
    for (std::size_t b = 0; b < bodies.size(); ++b) {
      double squares = 0.0;
      for (std::size_t k = 6 * b; k < 6 * b + 6; ++k) squares += x[k] * x[k];
      if (squares > most) most = squares, limits.ruling_body = static_cast<int>(b);
    }
    limits.ruling_contact = network.stiffest(x);
  }
  limits.operator_passes = network.passes();
  limits.dt_pairs = limits.dt_crit;
  if (options.pairs_alone) {
    std::vector<StiffContact> pairs;
    std::copy_if(contacts.begin(), contacts.end(), std::back_inserter(pairs), [](const StiffContact& c) { return c.j >= 0; });
    if (pairs.size() < contacts.size()) {
      const StepLimits alone = step_limits(bodies, pairs, ids, {.max_iterations = options.max_iterations, .tolerance = options.tolerance, .damped = false});
      // Both are rounded down by an error bound of their own.
      limits.dt_pairs = std::max(limits.dt_crit, alone.dt_crit);
      limits.operator_passes += alone.operator_passes;
    }
  }
  return limits;
}

StepLimits free_limits(double m_min, double k2, double k_t, double c_n, double c_t) {
  // A radius of 1 is as good as any: only lever/radius counts.
  const std::vector<NetworkBody> spheres(27, {m_min, 1.0});
  StepLimits limits = step_limits(spheres, close_packing(k2, k_t, c_n, c_t));
  // The cluster has 0.806 sqrt(m/k2) at k_t = 2/7 k1 = 2/35 k2; the worst place of random beds of 17,000 equal
  // spheres, 0.76 [own].
  const double margin = 0.934;
  const double usual = 0.75 * std::sqrt(m_min / k2), cluster = limits.dt_crit;
  limits.dt_crit = std::min(usual, margin * cluster);
  limits.dt_limit *= limits.dt_crit / cluster;
  limits.dt_pairs = limits.dt_crit;
  limits.omega_max = 2.0 / limits.dt_crit;
  limits.ruling_body = limits.ruling_contact = -1;
  return limits;
}

double floor_to_grid(double dt) {
  if (!(dt > 0.0) || !std::isfinite(dt)) return dt;
  // 2^(k/16)/2, correctly rounded.
  static constexpr double grid[16] = {
      0x1.0000000000000p-1, 0x1.0b5586cf9890fp-1, 0x1.172b83c7d517bp-1, 0x1.2387a6e756238p-1,
      0x1.306fe0a31b715p-1, 0x1.3dea64c123422p-1, 0x1.4bfdad5362a27p-1, 0x1.5ab07dd485429p-1,
      0x1.6a09e667f3bcdp-1, 0x1.7a11473eb0187p-1, 0x1.8ace5422aa0dbp-1, 0x1.9c49182a3f090p-1,
      0x1.ae89f995ad3adp-1, 0x1.c199bdd85529cp-1, 0x1.d5818dcfba487p-1, 0x1.ea4afa2a490dap-1};
  int exponent = 0;
  const double fraction = std::frexp(dt, &exponent);  // in [0.5, 1)
  const double* above = std::upper_bound(std::begin(grid), std::end(grid), fraction);
  return std::ldexp(*(above - 1), exponent);
}

}  // namespace platen
