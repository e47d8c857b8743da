// The yardstick: a plain scalar time step with the same physics as platen's (EEPA with n = 1, friction, rolling, plates,
// energy ledger), written as a textbook would: one pair at a time over a half list, Newton's third law, spheres in
// Morton order. What platen is better by than this is what its engine is worth. It takes nothing from kernels/ but the
// constants of the laws.
#pragma once

#include <cstdint>
#include <vector>

#include "bench/beds.h"
#include "bench/scalar_loops.h"

namespace platen::bench {

class ScalarStep {
 public:
  // A periodic bed of equal spheres with exponent 1. Throws std::invalid_argument for other scenes.
  ScalarStep(const Bed& bed, const BenchScene& scene);

  void advance(std::int64_t steps);

  std::vector<double> positions() const;  // N x 3 in the order of the bed [m]
  const ScalarLedger& ledger() const { return ledger_; }
  std::int64_t contacts() const { return touching_; }
  std::int64_t listed() const { return static_cast<std::int64_t>(partner_.size()); }
  std::int64_t rebuilds() const { return rebuilds_; }

  // Whether the processor can run its loops, which are compiled for AVX2 and FMA.
  static bool available();

 private:
  void rebuild();
  double displaced() const;  // largest displacement since the rebuild [m]
  void forces(double dt);
  ScalarBed view();

  ScalarConstants c_{};
  std::vector<std::int32_t> order_;  // order_[place] = number in the bed
  std::vector<ScalarSphere> spheres_;
  std::vector<ScalarSum> sums_;
  std::vector<double> rolling_strength_;  // of plates [N]
  std::vector<std::int32_t> start_, partner_;
  std::vector<ScalarHistory> history_;
  std::vector<ScalarPlateContact> plate_contacts_[2];
  bool plates_ = false;
  double plate_origin_[2] = {0, 0}, plate_velocity_[2] = {0, 0};
  std::int64_t step_ = 0, touching_ = 0, rebuilds_ = 0;
  double last_drift_ = 0.0, moved_ = 0.0, plate_moved_ = 0.0, skin_ = 0.0;
  std::vector<double> at_rebuild_;
  ScalarLedger ledger_;
};

// Largest difference of positions after `steps` steps of platen (widest instruction set) and of the yardstick, over R.
double scalar_difference(const Bed& bed, const BenchScene& scene, int steps);

}  // namespace platen::bench
