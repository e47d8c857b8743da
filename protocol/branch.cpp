#include "protocol/branch.h"

#include <fmt/format.h>

#include "protocol/output/files.h"
#include "protocol/output/output_error.h"

namespace platen {

namespace fs = std::filesystem;

void refuse_other_history(const Case& c, const Checkpoint& checkpoint, std::size_t stages, const fs::path& run) {
  const Case before = parse_case(checkpoint.case_text, (run / "case.toml").string(), run, {}, CaseUse::resume);
  std::string wrong;
  const auto differs = [&](bool same, const std::string& what) {
    if (!same) wrong += fmt::format("{}{}: {} is not as in {}; allowed: the same, since its bed is taken over", wrong.empty() ? "" : "\n", c.file.string(), what, run.string());
  };
  differs(c.seed == before.seed, "seed");
  const ParticleSpec &p = c.particles, &q = before.particles;
  differs(p.sizes == q.sizes && p.density == q.density && p.count == q.count && p.file == q.file, "particles");
  differs(p.law == q.law, "particles.law");
  differs(c.plates == before.plates, "plates");
  differs(c.box == before.box, "box");
  differs(c.gravity == before.gravity, "environment");
  differs(c.engine == before.engine, "engine");
  differs(c.time.step == before.time.step && c.time.safety == before.time.safety && c.time.allow_unstable == before.time.allow_unstable, "time");
  differs(c.output.energy == before.output.energy, "output.energy");
  if (c.stages.size() <= stages) wrong += fmt::format("{}{}: no stage is left: {} has done {} of its own", wrong.empty() ? "" : "\n", c.file.string(), run.string(), stages);
  bool pressed = false;
  for (std::size_t k = 0; k < std::min(stages, c.stages.size()); ++k) {
    StageSpec a = c.stages[k], b = before.stages[k];
    a.frames = b.frames = std::nullopt;
    if (!pressed) a.own_strain_zero = b.own_strain_zero = false;  // of a first compression it says nothing
    pressed = pressed || a.kind == StageKind::compress;
    differs(a == b, fmt::format("stage {} ({})", k + 1, c.stages[k].name));
  }
  if (!wrong.empty()) throw CaseError(wrong);
}

void copy_history(const fs::path& run, const Checkpoint& checkpoint, const fs::path& folder, const std::string& case_text, const std::string& start_time) try {
  for (const char* name : {"series.csv", "results.h5"}) copy_whole_file(run / name, folder / name);
  if (fs::exists(run / "frames")) {
    fs::create_directories(folder / "frames");
    for (const auto& entry : fs::directory_iterator(run / "frames")) copy_whole_file(entry.path(), folder / "frames" / entry.path().filename());
  }
  Checkpoint own = checkpoint;
  own.case_text = case_text, own.start_time = start_time;
  write_checkpoint(folder, own);  // last: without it nothing here is taken for a run that can go on
} catch (const fs::filesystem_error& error) {
  throw OutputError(fmt::format("{}: cannot take over the run in {}: {}", folder.string(), run.string(), error.code().message()));
}

}  // namespace platen
