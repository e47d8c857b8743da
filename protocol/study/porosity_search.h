// Which setting of a knob gives a bed of the wanted porosity. A pure function of what has been tried, so that a search
// that was interrupted goes on with the same tries.
//
//   knob      a whole number of small units; the porosity goes one way with it, but scatters: every setting is another
//             packing
//   bracket   the nearest settings known to be too dense and too loose. Only settings between them are tried, so scatter
//             can mislead the search but not keep it from ending
//   next      both sides of the bracket tried: linear in ln knob, never next to an end, each third try in the middle
//             one side tried: 2, 4, 8 ... times as far as the expected slope says, up to the end of the range
//             nothing known but that a bed cannot be made so dense: half way
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

namespace platen {

struct PorosityKnob {
  std::int64_t low = 1, high = 1;  // range of settings, 1 <= low <= high
  std::int64_t start = 1;          // the first try, within the range
  double slope = 1.0;              // change of porosity over that of ln knob. Its sign must be right, its size is a guess
};

struct PorosityAim {
  double porosity = 0.0;
  double tolerance = 0.0;
  int most_tries = 1;
};

struct PorosityTry {
  std::int64_t knob = 0;
  std::optional<double> porosity;  // empty: a bed cannot be made so dense
};

struct SearchStep {
  enum class Kind {
    attempt,       // try this setting
    met,           // this setting has met the aim
    out_of_range,  // even the end of the range is too dense, or too loose; this setting came nearest
    not_met        // no tries, or no settings, are left; this setting came nearest
  };
  Kind kind = Kind::attempt;
  std::int64_t knob = 0;  // 0: no try has a porosity
};

// `tries` in the order in which they were made.
SearchStep next_step(const PorosityKnob& knob, const PorosityAim& aim, const std::vector<PorosityTry>& tries);

}  // namespace platen
