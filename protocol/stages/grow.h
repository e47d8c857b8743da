// A bed at a given porosity without time steps: spheres grow at random places and push each other away.
#pragma once

#include <vector>

#include "protocol/stages/random_source.h"

namespace platen {

struct GrownBed {
  std::vector<double> position;  // N x 3 [m], in order of the radii; 0 <= x < width, 0 <= y < depth when periodic
  double height = 0.0;           // plates at z = 0 and z = height [m]
  double largest_overlap = 0.0;  // of two spheres, or of one with a plate or wall, over the smaller sphere's radius [-]
  bool reached = false;          // largest_overlap <= 1e-3
};

// Bed of height V_s/(width depth (1 - porosity)) between two hard plates; periodic in x and y, else between hard
// walls. Starts from random points with the radii of a loose bed, enlarges all radii by the same factor in steps and
// after each lowers the energy of the overlaps, taken as linear springs, by the method FIRE [Bitzek2006]. The final
// radii are aimed at with 0.05 % to spare, so a bed that is reached usually has no overlap at all.
//
// Random equal spheres jam at a porosity of about 0.36 [OHern2003], earlier between close plates or walls; what cannot
// be had is reported by `reached`. Serial, and nothing of libm but square roots: same seed, same bits.
//
// Throws std::invalid_argument for a porosity outside (0, 1), and for a bed or box narrower than the largest sphere (a
// periodic box: than two of them).
GrownBed grow_bed(const std::vector<double>& radii, double width, double depth, bool periodic, double porosity,
                  RandomSource& random);

}  // namespace platen
