#include "protocol/case_sections.h"

#include <algorithm>
#include <array>
#include <functional>
#include <numeric>
#include <stdexcept>

#include <fmt/format.h>

#include "protocol/case_alternatives.h"
#include "protocol/stages/draw_radii.h"

namespace platen {
namespace {

constexpr std::int64_t largest_integer = std::numeric_limits<std::int64_t>::max();

bool read_list(TableReader& sizes, SizeDistribution& out) {
  out.kind = SizeDistribution::Kind::list;
  const bool good = sizes.quantities("radii", Quantity::length, positive, Need::required, out.radii);
  const bool weighted = sizes.has("weights");
  const bool weights_good = weighted && sizes.numbers("weights", not_negative, Need::optional, out.weights);
  if (good && weights_good && out.weights.size() != out.radii.size()) {
    sizes.error("weights", fmt::format("has {} entries for {} radii; allowed: one weight for each radius", out.weights.size(), out.radii.size()));
  } else if (weights_good && !(std::accumulate(out.weights.begin(), out.weights.end(), 0.0) > 0.0)) {
    sizes.error("weights", "are all 0; allowed: at least one weight > 0");
  } else {
    return good && weighted == weights_good;
  }
  return false;
}

bool read_cumulative(TableReader& sizes, SizeDistribution& out) {
  out.kind = SizeDistribution::Kind::cumulative;
  const bool radii = sizes.quantities("radii", Quantity::length, positive, Need::required, out.radii);
  const bool below = sizes.numbers("below", part_or_all, Need::required, out.below);
  if (!radii || !below) return false;
  if (out.radii.size() < 2) {
    sizes.error("radii", fmt::format("has {} entries; allowed: two or more", out.radii.size()));
  } else if (out.below.size() != out.radii.size()) {
    sizes.error("below", fmt::format("has {} entries for {} radii; allowed: one part for each radius", out.below.size(), out.radii.size()));
  } else if (std::ranges::adjacent_find(out.radii, std::greater_equal{}) != out.radii.end()) {
    sizes.error("radii", "do not ascend; allowed: each larger than the one before");
  } else if (std::ranges::adjacent_find(out.below, std::greater{}) != out.below.end() || !(out.below.back() > out.below.front())) {
    sizes.error("below", "does not rise; allowed: parts from 0 to 1, none smaller than the one before, the last larger than the first");
  } else {
    return true;
  }
  return false;
}

// Whether a (log)normal distribution has anything to speak of between its min and max.
bool can_be_drawn(const SizeDistribution& sizes) {
  using Kind = SizeDistribution::Kind;
  if ((sizes.kind != Kind::lognormal && sizes.kind != Kind::normal) || !(sizes.sigma > 0.0)) return true;
  try {
    RandomSource random(1);
    draw_radius(sizes, random);
    return true;
  } catch (const std::invalid_argument&) {
    return false;
  }
}

bool read_range(TableReader& sizes, SizeDistribution::Kind kind, SizeDistribution& out) {
  out.kind = kind;
  const bool low = sizes.quantity("min", Quantity::length, positive, Need::required, out.min);
  const bool high = sizes.quantity("max", Quantity::length, positive, Need::required, out.max);
  bool good = low && high;
  if (good && !(out.min < out.max)) {
    sizes.error("min", "is not below max; allowed: min < max");
    good = false;
  }
  if (kind == SizeDistribution::Kind::uniform) return good;
  const bool log = kind == SizeDistribution::Kind::lognormal;
  std::string centre = "median";
  if (!log && !sizes.has("median")) centre = "mean";  // the median of a normal distribution is its mean: both words do
  if (!log && centre == "median" && sizes.has("mean")) sizes.error("mean", "is given beside median; allowed: one of them");
  const bool centre_good = sizes.quantity(centre, Quantity::length, positive, Need::required, out.median);
  const bool sigma_good = log ? sizes.number("sigma", positive, Need::required, out.sigma) : sizes.quantity("sigma", Quantity::length, positive, Need::required, out.sigma);
  good = good && centre_good && sigma_good;
  if (low && high && out.min < out.max && centre_good && (out.median < out.min || out.median > out.max)) {
    sizes.error(centre, fmt::format("is not between min and max; allowed: min <= {} <= max", centre));
    return false;
  } else if (good && !can_be_drawn(out)) {
    sizes.error("sigma", "leaves almost nothing of the distribution between min and max; allowed: a smaller sigma, or a wider range");
    return false;
  }
  return good;
}

bool read_sizes(TableReader& sizes, SizeDistribution& out) {
  using Kind = SizeDistribution::Kind;
  const std::vector<std::string> kinds{"lognormal", "normal", "uniform", "list", "cumulative"};
  const std::array of{Kind::lognormal, Kind::normal, Kind::uniform, Kind::list, Kind::cumulative};
  std::size_t kind = 0, basis = 0;
  if (!sizes.word("kind", kinds, Need::required, kind)) return false;
  sizes.word("basis", {"number", "volume"}, Need::optional, basis);
  out.basis = basis == 0 ? SizeDistribution::Basis::number : SizeDistribution::Basis::volume;
  const bool good = of[kind] == Kind::list         ? read_list(sizes, out)
                    : of[kind] == Kind::cumulative ? read_cumulative(sizes, out)
                                                   : read_range(sizes, of[kind], out);
  sizes.refuse_unknown(fmt::format("sizes of kind \"{}\"", kinds[kind]));
  return good;
}

void read_law(TableReader& law, ParticleSpec& particles, double gravity) {
  PairLaw& out = particles.law;
  // With another exponent the stiffnesses are N/m^n, for which there are no unit names. A bad exponent stays 1 here.
  law.number("exponent", positive, Need::optional, out.exponent);
  const auto stiffness = [&](const char* key, Range range, Need need, double& value) {
    if (is_table(law, key)) {
      std::string formula;
      const bool good = read_stiffness_alternative(law, key, particles, out.exponent, value, formula);
      if (good) particles.law_origins.emplace_back(key, formula);
      return good;
    }
    if (out.exponent == 1.0) return law.quantity(key, Quantity::stiffness, range, need, value);
    return law.number(key, range, need, value,
                      "with an exponent other than 1 stiffnesses are in N/m^n and take no unit");
  };
  const bool k1 = stiffness("k1", positive, Need::required, out.k1);
  const bool k2 = stiffness("k2", positive, Need::required, out.k2);
  stiffness("k_adh", not_negative, Need::optional, out.k_adh);
  if (k1 && k2 && out.k2 < out.k1) {
    law.error("k2", fmt::format("{:g} is smaller than k1 = {:g}; allowed: k2 >= k1", out.k2, out.k1));
  }
  if (is_table(law, "f0")) {
    std::string formula;
    if (read_f0_alternative(law, "f0", particles, gravity, out.f0, formula)) particles.law_origins.emplace_back("f0", formula);
  } else {
    law.quantity("f0", Quantity::force, not_positive, Need::optional, out.f0);
  }
  law.number("tangential_ratio", not_negative, Need::optional, out.tangential_ratio);
  law.number("restitution", proper_part, Need::optional, out.restitution);
  out.friction = 0.5;
  law.number("friction", not_negative, Need::optional, out.friction);
  law.number("rolling_friction", not_negative, Need::optional, out.rolling_friction);
  std::size_t model = 0;
  law.word("rolling_model", {"absolute", "relative"}, Need::optional, model);
  out.rolling_model = model == 0 ? RollingModel::absolute : RollingModel::relative;
  std::size_t limit = 0;
  law.word("friction_limit", {"adhesive", "normal"}, Need::optional, limit);
  out.friction_limit = limit == 0 ? FrictionLimit::adhesive : FrictionLimit::normal;
  law.refuse_unknown("particles.law");
}

void read_particles(TableReader& particles, ParticleSpec& out, double gravity, CaseFacts& facts) {
  const bool run = facts.use != CaseUse::law_only;
  facts.particles = particles.where("");
  facts.has_file = particles.has("file");
  facts.has_count = particles.has("count");
  facts.count = particles.where("count");
  facts.particle_file = particles.where("file");
  const bool has_radius = particles.has("radius"), has_sizes = particles.has("sizes");

  if (has_radius) {
    out.sizes.kind = SizeDistribution::Kind::mono;
    facts.sizes_good = particles.quantity("radius", Quantity::length, positive, Need::optional, out.sizes.radius);
  }
  if (has_sizes) {
    TableReader sizes = particles.table("sizes");
    SizeDistribution distribution;
    if (sizes.present() && read_sizes(sizes, distribution)) {
      out.sizes = distribution;
      facts.sizes_good = !has_radius;
    }
  }
  if (has_sizes && (has_radius || facts.has_file)) {
    particles.error("sizes", fmt::format("is given beside {}; allowed: exactly one of radius, sizes, file (radius may "
                                         "stand beside file)",
                                         has_radius ? "radius" : "file"));
  }
  if (run && particles.present() && !has_radius && !has_sizes && !facts.has_file) {
    particles.error("radius", "is missing; allowed: exactly one of radius, sizes, file");
  }
  if (particles.text("file", Need::optional, out.file) &&
      (out.file.empty() || out.file.find('\0') != std::string::npos)) {
    particles.error("file", "is not a file name; allowed: the path of a particle file, relative to the case file");
    out.file.clear();
  }
  if (facts.has_file && facts.has_count) {
    particles.error("count", "is given beside file; allowed: leave it out, the file says how many there are");
  }
  const Need need = run && !facts.has_file ? Need::required : Need::optional;
  particles.quantity("density", Quantity::density, positive, need, out.density);
  particles.integer("count", 1, 1'000'000'000, need, out.count);
  TableReader law = particles.table("law", Need::required);
  read_law(law, out, gravity);
  particles.refuse_unknown("particles");
}

void read_plates(TableReader& plates, PlateSpec& out, CaseFacts& facts) {
  constexpr Range poisson{-1.0, 0.5, false, true};
  const bool top = plates.flag("top", out.top) || !plates.has("top");
  const bool bottom = plates.flag("bottom", out.bottom) || !plates.has("bottom");
  facts.plates_good = top && bottom;
  PlateLaw& law = out.law;
  plates.quantity("particle_young_modulus", Quantity::stress, positive, Need::optional, law.particle_young_modulus);
  plates.number("particle_poisson_ratio", poisson, Need::optional, law.particle_poisson_ratio);
  plates.quantity("young_modulus", Quantity::stress, positive, Need::optional, law.young_modulus);
  plates.number("poisson_ratio", poisson, Need::optional, law.poisson_ratio);
  plates.number("restitution", proper_part, Need::optional, law.restitution);
  plates.number("friction", not_negative, Need::optional, law.friction);
  plates.number("rolling_friction", not_negative, Need::optional, law.rolling_friction);
  plates.refuse_unknown("plates");
}

void read_box(TableReader& box, BoxSpec& out, CaseFacts& facts) {
  facts.box = box.where("");
  facts.box_present = box.present();
  const std::vector<std::string> words{"periodic", "walls", "open"};
  std::size_t sides = 0;
  facts.sides_good = box.word("sides", words, Need::optional, sides) || !box.has("sides");
  out.sides = std::array{Sides::periodic, Sides::walls, Sides::open}[sides];
  // A box of open sides alone says nothing of lengths; whether they are needed is seen when the plates are known.
  const bool any = box.has("width") || box.has("depth") || box.has("height");
  const Need need = out.sides == Sides::open && !any ? Need::optional : Need::required;
  facts.width_good = box.quantity("width", Quantity::length, positive, need, out.width);
  facts.depth_good = box.quantity("depth", Quantity::length, positive, need, out.depth);
  facts.height_good = box.quantity("height", Quantity::length, positive, need, out.height);
  facts.width = box.where("width");
  facts.depth = box.where("depth");
  facts.height = box.where("height");
  facts.sides = box.where("sides");
  out.given = facts.width_good && facts.depth_good && facts.height_good;
  box.refuse_unknown("box");
}

void read_output(TableReader& output, OutputSpec& out) {
  output.quantity("series", Quantity::time, positive, Need::optional, out.series);
  output.quantity_or("frames", Quantity::time, positive, "off", out.frames);
  output.flag("contacts", out.contacts);
  std::optional<double> checkpoint = out.checkpoint;
  output.quantity_or("checkpoint", Quantity::time, positive, "off", checkpoint);
  out.checkpoint = checkpoint.value_or(0.0);
  std::int64_t slabs = out.slabs;
  output.integer("slabs", 1, 100'000, Need::optional, slabs);
  out.slabs = static_cast<int>(slabs);
  output.flag("energy", out.energy);
  output.refuse_unknown("output");
}

void read_engine(TableReader& engine, EngineSpec& out) {
  engine.quantity_or("skin", Quantity::length, positive, "auto", out.skin);
  engine.quantity_or("inner_gap", Quantity::length, positive, "auto", out.inner_gap);
  if (out.skin && out.inner_gap && *out.inner_gap > *out.skin) {
    engine.error("inner_gap", "is wider than skin; allowed: inner_gap <= skin");
  }
  std::optional<std::int64_t> batch;
  engine.integer_or("batch", 1, 1'000'000'000, "auto", batch);
  if (batch) out.batch = static_cast<int>(*batch);
  std::int64_t check_every = out.check_every;
  engine.integer("check_every", 1, 1'000'000, Need::optional, check_every);
  out.check_every = static_cast<int>(check_every);
  engine.refuse_unknown("engine");
}

}  // namespace

void read_sections(TableReader& root, Case& c, CaseFacts& facts, Problems& problems) {
  TableReader about = root.table("case");
  about.text("title", Need::optional, c.title);
  std::int64_t seed = 1;
  about.integer("seed", 0, largest_integer, Need::optional, seed);
  c.seed = static_cast<std::uint64_t>(seed);
  about.refuse_unknown("case");

  TableReader environment = root.table("environment");
  facts.gravity_good =
      environment.quantity("gravity", Quantity::acceleration, not_negative, Need::optional, c.gravity) ||
      !environment.has("gravity");
  environment.refuse_unknown("environment");

  TableReader particles = root.table("particles", Need::required);
  read_particles(particles, c.particles, c.gravity, facts);
  TableReader plates = root.table("plates");
  read_plates(plates, c.plates, facts);
  TableReader box = root.table("box");
  read_box(box, c.box, facts);

  TableReader time = root.table("time");
  time.quantity_or("step", Quantity::time, positive, "auto", c.time.step);
  if (c.time.step) c.time.step_where = to_string(time.where("step"));
  time.number("safety", proper_part, Need::optional, c.time.safety);
  time.flag("allow_unstable", c.time.allow_unstable);
  time.refuse_unknown("time");

  TableReader output = root.table("output");
  read_output(output, c.output);
  TableReader engine = root.table("engine");
  read_engine(engine, c.engine);
  read_stages(root.entry("stage"), c, facts, problems);
  root.refuse_unknown("a case");
}

}  // namespace platen
