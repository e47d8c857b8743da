#include "core/stress_tensor.h"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "core/plates.h"

namespace platen {

namespace {

using Vector = Eigen::Vector3d;
using Matrix = Eigen::Matrix3d;

Vector row(const std::vector<double>& v, std::size_t k) { return {v[3 * k], v[3 * k + 1], v[3 * k + 2]}; }

std::size_t index_of(const ParticleFields& p, std::int64_t id) {
  return static_cast<std::size_t>(std::lower_bound(p.id.begin(), p.id.end(), id) - p.id.begin());
}

// sqrt(3/2 s:s), s the deviator of a symmetric tensor.
double deviator_of(const Matrix& m) {
  const Matrix s = m - m.trace() / 3.0 * Matrix::Identity();
  return std::sqrt(1.5 * s.squaredNorm());
}

Tensor tensor_of(const Matrix& m) {
  Tensor t;
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b < 3; ++b) t[static_cast<std::size_t>(a)][static_cast<std::size_t>(b)] = m(a, b);
  return t;
}

}  // namespace

BedStress bed_stress(const Snapshot& snapshot, double width, double depth) {
  BedStress r;
  r.volume = width * depth * (snapshot.z_top - snapshot.z_bottom);
  if (!(r.volume > 0.0)) throw std::invalid_argument("bed_stress: no volume");
  const ParticleFields& p = snapshot.particles;
  Matrix moment = Matrix::Zero(), fabric = Matrix::Zero();
  const ContactFields& c = snapshot.contacts;
  for (std::size_t k = 0; k < c.size(); ++k) {
    const std::size_t i = index_of(p, c.pair[2 * k]), j = index_of(p, c.pair[2 * k + 1]);
    const Vector shift(c.image[2 * k] * width, c.image[2 * k + 1] * depth, 0.0);
    const Vector l = row(p.position, i) - (row(p.position, j) + shift), n = l.normalized();
    const Vector F = (c.normal_force[k] + c.damping_force[k]) * n + row(c.tangential_force, k);
    moment += F * l.transpose();
    fabric += n * n.transpose();
    const double overlap = c.overlap[k] / (p.radius[i] + p.radius[j]);
    r.mean_overlap += overlap;
    r.largest_overlap = std::max(r.largest_overlap, overlap);
  }
  const PlateContactFields& plates = snapshot.plate_contacts;
  for (std::size_t k = 0; k < plates.size(); ++k) {
    const Plane shape = plane_shape(plates.plate[k]);
    Vector l = Vector::Zero();
    l[shape.axis] = shape.sign * (p.radius[index_of(p, plates.id[k])] - plates.overlap[k]);
    moment += row(plates.force, k) * l.transpose();
  }
  r.pairs = static_cast<std::int64_t>(c.size());
  if (r.pairs > 0) fabric /= static_cast<double>(r.pairs), r.mean_overlap /= static_cast<double>(r.pairs);
  const Matrix stress = moment / r.volume, symmetric = 0.5 * (stress + stress.transpose());
  r.stress = tensor_of(stress), r.fabric = tensor_of(fabric);
  r.pressure = stress.trace() / 3.0;
  r.deviator = deviator_of(symmetric), r.fabric_deviator = deviator_of(fabric);
  const Eigen::SelfAdjointEigenSolver<Matrix> solver(symmetric);
  for (int a = 0; a < 3; ++a) r.principal[static_cast<std::size_t>(a)] = solver.eigenvalues()[2 - a];
  const Vector direction = solver.eigenvectors().col(2);
  for (int a = 0; a < 3; ++a) r.principal_direction[static_cast<std::size_t>(a)] = (direction[2] < 0.0 ? -1.0 : 1.0) * direction[a];
  return r;
}

}  // namespace platen
