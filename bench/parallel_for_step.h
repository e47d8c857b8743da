// Another yardstick: the same kernels and batches as the program, run by two tbb::parallel_for a step with a barrier
// after each, instead of the flow graph. On few quiet cores the graph must not fall below it.
#pragma once

#include <tbb/task_arena.h>

#include "bench/list_copies.h"

namespace platen::bench {

class ParallelForStep {
 public:
  // Takes over state and lists of `sim` as they are after Simulation::rebuild_now(); they are never made anew, so the
  // motion of the spheres must stay small (a bed at rest), or the result is wrong though the time is right.
  ParallelForStep(const Simulation& sim, const PairLaw& law, double gravity, int threads);

  void advance(int steps);

  // Mean times of a batch's two tasks over `steps` steps, all on this thread [s].
  struct BatchTimes {
    double integrate = 0.0, contacts = 0.0;
  };
  std::vector<BatchTimes> times(int steps);
  // What a step must move at least: indices, history and sums of contacts, rows, columns [bytes].
  double bytes() const;

  // Whether positions and velocities have the same bits as those of `sim`, which must not have sorted since.
  bool same_bits(const Simulation& sim) const;

 private:
  void merge(BatchCopy& b);
  void integrate(int batch);
  void contacts(int batch);

  StateCopy state_;
  std::vector<BatchCopy> batches_;
  std::vector<PairTotals> totals_;
  KernelTable kernels_;
  LawConstants law_;
  PlateConstants plate_law_;
  MotionConstants motion_;
  std::vector<PlaneMotion> planes_;
  std::int64_t step_;
  bool merged_ = true;  // of the state that was taken over
  tbb::task_arena arena_;
};

}  // namespace platen::bench
