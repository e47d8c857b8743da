// Checks that need more than one section of a case.
#include <algorithm>
#include <fstream>
#include <iterator>

#include <fmt/format.h>

#include "core/particles.h"
#include "protocol/case_sections.h"
#include "protocol/particle_file.h"
#include "protocol/sphere_facts.h"
#include "protocol/stages/draw_radii.h"
#include "protocol/stages/rain.h"

namespace platen {
namespace {

constexpr double auto_skin = 0.3;  // of the largest radius: the widest that "auto" chooses

// Spheres of a rain with a duration: not denser than where all fall at once, and not for ever.
std::string rain_problem(const Case& c, const StageSpec& rain) {
  const double least = solid_volume(c) / (c.box.width * c.box.depth * rain.drop_speed * rain_solid_fraction), most = 1000.0 * c.box.height / rain.drop_speed;
  if (*rain.duration < least)
    return fmt::format("duration = {:g} s is too short for {} spheres to come out at {:g} m/s; allowed: at least {:.3g} s, a larger drop_speed, or no "
                       "duration, where all fall at once", *rain.duration, c.particles.count, rain.drop_speed, least);
  if (*rain.duration > std::max(most, least))
    return fmt::format("duration = {:g} s makes a column of spheres above 1000 times as high as the box; allowed: at most {:.3g} s, or a smaller drop_speed",
                       *rain.duration, std::max(most, least));
  return "";
}

// Spheres that are grown need a bed as high as the largest of them. Draws no more of them than it takes to know.
std::string grow_problem(const Case& c, double porosity) {
  const SizeDistribution& sizes = c.particles.sizes;
  const double floor = c.box.width * c.box.depth * (1.0 - porosity);
  RandomSource random(c.seed);
  double height = 0.0, largest = 0.0;
  for (std::int64_t k = 0; k < c.particles.count && height < 2.001 * sizes.largest(); ++k) {
    const double R = draw_radius(sizes, random);
    height += sphere_mass(R, 1.0) / floor, largest = std::max(largest, R);
  }
  if (height >= 2.001 * largest) return "";
  return fmt::format("{} spheres make a bed of {:.4g} m, less than a diameter; allowed: beds of {:.4g} m and more, by more spheres or a smaller width or depth", c.particles.count, height, 2.001 * largest);
}

bool any_stage(const Case& c, const CaseFacts& facts, StageKind kind) {
  for (std::size_t i = 0; i < c.stages.size(); ++i) {
    if (facts.stage_good[i] && c.stages[i].kind == kind) return true;
  }
  return false;
}

// Particles come from a file or from a first stage `fill`, not from both.
void check_source(const Case& c, const CaseFacts& facts, Problems& problems) {
  for (std::size_t i = 0; i < c.stages.size(); ++i) {
    if (!facts.stage_good[i] || c.stages[i].kind != StageKind::fill) continue;
    if (facts.has_file) {
      problems.add(facts.stage[i], facts.stage_path[i],
                   "fill makes particles, but particles.file gives them already; allowed: one of the two");
    }
    if (i > 0) {
      problems.add(facts.stage[i], facts.stage_path[i], "fill is not the first stage; allowed: fill only as the first");
    }
  }
  const bool all_good = std::all_of(facts.stage_good.begin(), facts.stage_good.end(), [](bool good) { return good; });
  if (facts.has_count && !facts.has_file && !c.stages.empty() && all_good && !any_stage(c, facts, StageKind::fill)) {
    problems.add(
        facts.count, "particles.count",
        "nothing makes the particles; allowed: a first stage of kind \"fill\", or particles.file instead of count");
  }
}

void check_box(const Case& c, const CaseFacts& facts, Problems& problems) {
  const bool plates = c.plates.top || c.plates.bottom;
  const bool written = facts.width_good || facts.depth_good || facts.height_good;
  if (facts.plates_good && !facts.box_present && plates) {
    problems.add(facts.box, "box",
                 "is missing; allowed: [box] with width, depth, height, or no plates "
                 "(plates.top = false and plates.bottom = false)");
  }
  if (facts.plates_good && facts.box_present && facts.sides_good && c.box.sides == Sides::open && plates && !written) {
    for (const char* const key : {"width", "depth", "height"}) {
      problems.add(facts.box, fmt::format("box.{}", key),
                   "is missing; allowed: a length > 0, to be left out only with open sides and no plates");
    }
  }
  if (!facts.sides_good || !facts.sizes_good || !facts.box_present) return;
  const double R_max = c.particles.sizes.largest();
  const double skin = c.engine.skin.value_or(auto_skin * R_max);
  const double narrowest = c.box.sides == Sides::periodic ? 4.0 * R_max + 2.0 * skin : 2.0 * R_max;
  const auto check_length = [&](bool good, double length, const Position& where, const char* key) {
    if (!good || length >= narrowest) return;
    if (c.box.sides == Sides::periodic) {
      problems.add(where, key,
                   fmt::format("{:.6g} m is too narrow for a periodic box, a sphere would meet itself or one "
                               "partner twice; allowed: >= 4 R_max + 2 skin = {:.6g} m (R_max = {:.6g} m)",
                               length, narrowest, R_max));
    } else if (c.box.sides == Sides::walls || !facts.has_file) {
      problems.add(where, key,
                   fmt::format("{:.6g} m is narrower than the largest sphere; allowed: >= 2 R_max = {:.6g} m (R_max = {:.6g} m)", length,
                               narrowest, R_max));
    }
  };
  check_length(facts.width_good, c.box.width, facts.width, "box.width");
  check_length(facts.depth_good, c.box.depth, facts.depth, "box.depth");
}

// Walks through the stages as the run will.
void check_stages(const Case& c, const CaseFacts& facts, Problems& problems) {
  Sides sides = c.box.sides;
  bool strain_known = false;
  for (std::size_t i = 0; i < c.stages.size(); ++i) {
    if (!facts.stage_good[i]) continue;
    const StageSpec& stage = c.stages[i];
    const char* const kind = to_string(stage.kind);
    const auto refuse = [&](const std::string& what) { problems.add(facts.stage[i], facts.stage_path[i], what); };
    const bool needs_top = stage.kind == StageKind::compress || stage.kind == StageKind::unload ||
                           stage.kind == StageKind::hold || stage.kind == StageKind::crush;
    if (needs_top && facts.plates_good && !c.plates.top) {
      refuse(fmt::format("{} moves the top plate, but there is none; allowed: plates.top = true", kind));
    }
    if (stage.kind == StageKind::vibrate && facts.plates_good && !c.plates.bottom) {
      refuse("vibrate moves the bottom plate, but there is none; allowed: plates.bottom = true");
    }
    if (stage.kind == StageKind::fill && stage.method == FillMethod::rain) {
      if (facts.gravity_good && c.gravity == 0.0) {
        refuse("fill by rain needs gravity; allowed: environment.gravity > 0, or method = \"grow\"");
      }
      if (facts.plates_good && !c.plates.bottom) {
        refuse("fill by rain needs the bottom plate; allowed: plates.bottom = true, or method = \"grow\"");
      }
      if (stage.duration && facts.has_count && facts.sizes_good && facts.width_good && facts.depth_good && facts.height_good && stage.drop_speed > 0.0)
        if (const std::string problem = rain_problem(c, stage); !problem.empty()) refuse(problem);
    }
    if (stage.kind == StageKind::fill && facts.sides_good) {
      if (!facts.box_present && !c.plates.top && !c.plates.bottom) {
        refuse("fill needs [box], the region to fill; allowed: [box] with width, depth, height");
      } else if (stage.method == FillMethod::grow && facts.box_present && sides == Sides::open) {
        refuse("fill by growth needs closed sides; allowed: box.sides = \"periodic\" or \"walls\"");
      } else if (stage.method == FillMethod::grow && stage.porosity && facts.has_count && c.particles.count > 0 && facts.sizes_good && facts.width_good && facts.depth_good) {
        if (const std::string problem = grow_problem(c, *stage.porosity); !problem.empty()) refuse(problem);
      }
    }
    if (stage.kind == StageKind::release) {
      if (facts.sides_good && sides == Sides::open) {
        refuse("the sides are open already; allowed: one release, with box.sides = \"periodic\" or \"walls\"");
      }
      sides = Sides::open;
    }
    const Until& until = stage.until;
    if (until.porosity && facts.sides_good && sides == Sides::open) {
      refuse("until.porosity needs sides, without which a bed has no volume; allowed: before `release`, with box.sides = \"periodic\" or \"walls\"");
    }
    if (stage.kind == StageKind::unload && until.strain && !until.stress && !until.displacement && !until.duration &&
        !strain_known) {
      refuse(
          "strain has no zero before a compress or crush stage, so this stage can never end; allowed: until = { stress "
          "| displacement | duration }");
    }
    strain_known = strain_known || stage.kind == StageKind::compress || stage.kind == StageKind::crush;
  }
}

// Reads the particle file; its own errors stand behind those of the case, as file:line.
void check_particles(Case& c, const CaseFacts& facts, Problems& problems) {
  const std::filesystem::path path = facts.folder / c.particles.file;
  std::error_code error;
  const bool is_file = std::filesystem::is_regular_file(path, error) || std::filesystem::is_fifo(path, error);
  std::ifstream in;
  if (is_file) in.open(path, std::ios::binary);
  if (!is_file || !in) {
    problems.add(facts.particle_file, "particles.file",
                 fmt::format("\"{}\" {}; allowed: a readable file, relative to the case file", path.string(),
                             !std::filesystem::exists(path, error) ? "does not exist"
                             : is_file                             ? "cannot be read"
                                                                   : "is not a file"));
    return;
  }
  const std::string bytes((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  if (in.bad()) {
    problems.add(facts.particle_file, "particles.file", fmt::format("\"{}\" cannot be read to its end", path.string()));
    return;
  }
  const auto known = [](double value) { return value > 0.0 ? std::optional(value) : std::nullopt; };
  ParticleFile file =
      parse_particle_file(bytes, path.string(), known(c.particles.sizes.radius), known(c.particles.density));
  std::vector<std::string> found = file.problems;
  if (found.empty() && facts.sides_good && facts.plates_good) {
    found = check_particle_positions(file, path.string(), c.box, c.plates.bottom, c.plates.top);
  }
  for (const std::string& problem : found) problems.add_line(problem);
  if (!found.empty()) return;
  c.particles.count = static_cast<std::int64_t>(file.table.size());
  // The sizes of the case are those of the file from here on.
  SizeDistribution& sizes = c.particles.sizes;
  const auto [least, most] = std::minmax_element(file.table.radius.begin(), file.table.radius.end());
  sizes = SizeDistribution{};
  sizes.radius = *most;
  if (*least < *most) {
    sizes.kind = SizeDistribution::Kind::list;
    sizes.radii = {*least, *most};
  }
  c.particles.table = std::move(file.table);
}

}  // namespace

void check_case(Case& c, const CaseFacts& reading, Problems& problems) {
  CaseFacts facts = reading;
  if (facts.use == CaseUse::law_only) return;
  if (!facts.box_present && facts.plates_good && !c.plates.top && !c.plates.bottom) c.box.sides = Sides::open;
  // The particle file first: it says how large the spheres are.
  if (facts.use == CaseUse::run && facts.has_file && !c.particles.file.empty()) {
    check_particles(c, facts, problems);
    facts.sizes_good = c.particles.table.has_value();
  }
  check_source(c, facts, problems);
  check_box(c, facts, problems);
  check_stages(c, facts, problems);
}

}  // namespace platen
