// The stages of the experiment. Each is a struct with
//
//   begin(stand)         puts planes and sides as the stage wants them
//   update(stand, look)  on the check grid: servo, and whatever the stage remembers
//   done(stand, look)    on the check grid: why the stage ends, or nothing
//   last_step(stand)     the step at which it ends whatever else happens, where that is exact
//   end(stand, result)   leaves the bed as the next stage expects it, adds its own figures to the result
//
// Equations: docs/laws.md, "What is measured".
#pragma once

#include <cstdint>
#include <deque>
#include <limits>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "core/simulation.h"
#include "protocol/case_file.h"
#include "protocol/records.h"

namespace platen {

// A sample that keeps less of its height than this when its sides go fell over or to pieces: what a crush finds then is not its strength.
inline constexpr double standing = 0.8;

// A drop counts once the peak was this many times the stress at which strain counts: before, a plate just meets single spheres.
inline constexpr double least_peak_of_drop = 10.0;

// What stages work on and hand to each other.
struct Stand {
  Simulation& sim;
  const Case& c;
  const StageSpec& spec;
  std::int64_t first_step = 0;    // of the stage
  double first_time = 0.0;        // [s]
  std::optional<double> strain_zero_height;  // [m]; kept from compress to unload and hold
  // Where the present time step began to hold: what is counted from here does not depend on when somebody looks.
  std::int64_t dt_step = 0;
  double dt_time = 0.0;           // of the stage [s]
  double stage_time() const { return sim.time() - first_time; }
  void time_step_changed() { dt_step = sim.step(), dt_time = stage_time(); }
  std::int64_t step_at(double stage_seconds) const;        // nearest step to a time of the stage
  std::int64_t step_not_before(double stage_seconds) const;
};

// One look at the bed on the check grid; no stored energies.
struct Look {
  Measures m;
  double strain = std::numeric_limits<double>::quiet_NaN();
};

// What the goals of a stage are and where the bed stands: "stress 5.1 kPa of 40 kPa"; "" for a stage that ends by time.
std::string what_is_missing(const Stand& stand, const Measures& m);

// A stage that waits for rest: settle and release [A27].
struct RestWatch {
  struct Sample {
    double time, coordination_number;
    bool quiet;
  };
  void begin(Stand& stand);
  std::optional<std::string> done(Stand& stand, const Look& look);
  std::deque<Sample> samples;
  double kinetic_at_start = 0.0;
  bool from_rest = false;        // nothing moved at the start: kinetic_at_start is the most that was seen since
};

struct FillStage {
  std::optional<double> landed_since;  // [s]
  std::int64_t in_outlet = 0;          // spheres that have not begun to fall
  bool landed(const Stand& stand, const Measures& m) const;
  void begin(Stand& stand);
  void update(Stand& stand, const Look& look);
  std::optional<std::string> done(Stand& stand, const Look& look);
  std::optional<std::int64_t> last_step(const Stand&) const { return std::nullopt; }
  void end(Stand& stand, StageResult& result);
};

struct VibrateStage {
  void begin(Stand& stand);
  void update(Stand&, const Look&) {}
  std::optional<std::string> done(Stand&, const Look&) { return std::nullopt; }
  std::optional<std::int64_t> last_step(const Stand& stand) const;
  void end(Stand& stand, StageResult& result);
};

struct SettleStage {
  RestWatch rest;
  void begin(Stand& stand) { rest.begin(stand); }
  void update(Stand&, const Look&) {}
  std::optional<std::string> done(Stand& stand, const Look& look) { return rest.done(stand, look); }
  std::optional<std::int64_t> last_step(const Stand&) const { return std::nullopt; }
  void end(Stand&, StageResult&) {}
};

// Moves the top plate: compress (down), unload (up).
struct PressStage {
  double direction = -1.0;  // of the plate
  double start_position = 0.0;
  void begin(Stand& stand);
  void update(Stand& stand, const Look& look);
  std::optional<std::string> done(Stand& stand, const Look& look);
  std::optional<std::int64_t> last_step(const Stand& stand) const;
  void end(Stand& stand, StageResult& result);
};

struct HoldStage {
  double modulus = 0.0;           // of the bed as it answers at the moment [Pa]
  double window_begin = 0.0;      // means over a few looks: that time [s], sums, and the means before
  double stress_sum = 0.0, height_sum = 0.0;
  int looks = 0;
  double stress_before = std::numeric_limits<double>::quiet_NaN(), height_before = 0.0;
  void begin(Stand& stand);
  void update(Stand& stand, const Look& look);
  std::optional<std::string> done(Stand&, const Look&) { return std::nullopt; }
  std::optional<std::int64_t> last_step(const Stand& stand) const;
  void end(Stand& stand, StageResult& result);
};

struct ReleaseStage {
  RestWatch rest;
  double height_before = 0.0;     // of the bed, with its sides [m]
  void begin(Stand& stand);
  void update(Stand&, const Look&) {}
  std::optional<std::string> done(Stand& stand, const Look& look) { return rest.done(stand, look); }
  std::optional<std::int64_t> last_step(const Stand&) const { return std::nullopt; }
  void end(Stand& stand, StageResult& result);
};

// Unconfined compression to failure: PressStage with a peak to find.
struct CrushStage {
  PressStage press;
  struct Point {
    double time, strain, stress;  // stress: as read
  };
  std::vector<Point> curve;       // from the strain zero on
  double window_sum = 0.0;        // of the stresses of the last 5 ms
  std::size_t window_begin = 0;
  std::vector<double> smooth;     // 5 ms means, one per point [Pa]
  double peak = 0.0, peak_strain = 0.0;
  double low_since = std::numeric_limits<double>::quiet_NaN();  // strain since which the stress has been below the drop
  bool dropped = false;
  void begin(Stand& stand);
  void update(Stand& stand, const Look& look);
  std::optional<std::string> done(Stand& stand, const Look& look);
  std::optional<std::int64_t> last_step(const Stand& stand) const { return press.last_step(stand); }
  void end(Stand& stand, StageResult& result);
};

struct RunStage {
  void begin(Stand&) {}
  void update(Stand&, const Look&) {}
  std::optional<std::string> done(Stand&, const Look&) { return std::nullopt; }
  std::optional<std::int64_t> last_step(const Stand& stand) const;
  void end(Stand&, StageResult&) {}
};

using Stage = std::variant<FillStage, VibrateStage, SettleStage, PressStage, HoldStage, ReleaseStage, CrushStage, RunStage>;

Stage make_stage(const StageSpec& spec);

// A pressure or length as people write it, for end reasons.
std::string pretty(double value, const char* unit);

}  // namespace platen
