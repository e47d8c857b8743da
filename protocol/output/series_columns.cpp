// The table of output quantities. A new one is one line here; names, units and order are those of docs/output.md.
#include <array>
#include <stdexcept>
#include <string>

#include "protocol/output/series_csv.h"

namespace platen {

namespace {

using Kind = SeriesColumn::Kind;

constexpr std::array columns{
    SeriesColumn{"time", "s", "simulated time since the run began", Kind::real,
                 [](const SeriesRow& r) { return r.measures.time; }},
    SeriesColumn{"step", "-", "time steps since the run began", Kind::count,
                 [](const SeriesRow& r) { return static_cast<double>(r.measures.step); }},
    SeriesColumn{"stage", "-", "stage of the protocol", Kind::stage, nullptr},
    SeriesColumn{"height", "m", "gap between the plates; highest point of a sphere before the top plate touches",
                 Kind::real, [](const SeriesRow& r) { return r.measures.height; }},
    SeriesColumn{"strain", "-",
                 "engineering strain (h0 - height) / h0, compression positive, from the height h0 at which the stage's "
                 "strain zero was reached",
                 Kind::real, [](const SeriesRow& r) { return r.strain; }},
    SeriesColumn{"stress_top", "Pa", "normal force on the top plate, damping included, over width x depth; compression "
                 "positive, instantaneous", Kind::real, [](const SeriesRow& r) { return r.measures.stress_top; }},
    SeriesColumn{"stress_bottom", "Pa", "normal force on the bottom plate, damping included, over width x depth; "
                 "compression positive, instantaneous", Kind::real,
                 [](const SeriesRow& r) { return r.measures.stress_bottom; }},
    SeriesColumn{"porosity", "-", "1 - volume of the spheres / volume between the plates, overlaps not subtracted",
                 Kind::real, [](const SeriesRow& r) { return r.measures.porosity; }},
    SeriesColumn{"coordination_number", "-", "2 x touching sphere pairs / spheres", Kind::real,
                 [](const SeriesRow& r) { return r.measures.coordination_number; }},
    SeriesColumn{"contacts", "-", "touching sphere pairs", Kind::count,
                 [](const SeriesRow& r) { return static_cast<double>(r.measures.contacts); }},
    SeriesColumn{"kinetic_energy", "J", "kinetic energy with rotation", Kind::real,
                 [](const SeriesRow& r) { return r.measures.kinetic_energy; }},
    SeriesColumn{"potential_energy", "J", "sum of m g (z - z of the bottom plate)", Kind::real,
                 [](const SeriesRow& r) { return r.measures.potential_energy; }},
    SeriesColumn{"kinetic_to_potential", "-", "kinetic over potential energy", Kind::real,
                 [](const SeriesRow& r) { return r.kinetic_to_potential; }},
    SeriesColumn{"inertial_number", "-", "strain rate x mean diameter x sqrt(density / stress)", Kind::real,
                 [](const SeriesRow& r) { return r.inertial_number; }},
    SeriesColumn{"energy_residual", "J", "what the energy ledger does not account for", Kind::real,
                 [](const SeriesRow& r) { return r.measures.energy_residual; }},
    SeriesColumn{"elastic_energy", "J", "stored in the normal springs of pairs", Kind::real,
                 [](const SeriesRow& r) { return r.measures.ledger.elastic_energy; }},
    SeriesColumn{"adhesion_energy", "J", "f0 x overlap, summed over pairs", Kind::real,
                 [](const SeriesRow& r) { return r.measures.ledger.adhesion_energy; }},
    SeriesColumn{"tangential_energy", "J", "stored in the tangential springs of pairs", Kind::real,
                 [](const SeriesRow& r) { return r.measures.ledger.tangential_energy; }},
    SeriesColumn{"plate_energy", "J", "stored in contacts with plates and walls", Kind::real,
                 [](const SeriesRow& r) { return r.measures.ledger.plate_energy; }},
    SeriesColumn{"plastic_dissipation", "J", "lost in plastic and adhesive loading, since the run began", Kind::real,
                 [](const SeriesRow& r) { return r.measures.ledger.plastic_dissipation; }},
    SeriesColumn{"viscous_dissipation", "J", "lost in dashpots, since the run began", Kind::real,
                 [](const SeriesRow& r) { return r.measures.ledger.viscous_dissipation; }},
    SeriesColumn{"sliding_dissipation", "J", "lost in sliding and in springs of opening contacts, since the run began",
                 Kind::real, [](const SeriesRow& r) { return r.measures.ledger.sliding_dissipation; }},
    SeriesColumn{"rolling_dissipation", "J", "lost in rolling friction, since the run began", Kind::real,
                 [](const SeriesRow& r) { return r.measures.ledger.rolling_dissipation; }},
    SeriesColumn{"plate_model_work", "J", "energy of tangential springs whose stiffness changes with overlap, work of no force, since the run began",
                 Kind::real, [](const SeriesRow& r) { return r.measures.ledger.plate_model_work; }},
    SeriesColumn{"plate_work", "J", "work of the moving plates on the bed, since the run began", Kind::real,
                 [](const SeriesRow& r) { return r.measures.ledger.plate_work; }},
    SeriesColumn{"inserted_energy", "J", "energy of the spheres when they were put in, since the run began",
                 Kind::real, [](const SeriesRow& r) { return r.measures.ledger.inserted_energy; }},
    SeriesColumn{"removed_energy", "J", "stored in contacts that were deleted by release, since the run began",
                 Kind::real, [](const SeriesRow& r) { return r.measures.ledger.removed_energy; }},
};

}  // namespace

std::span<const SeriesColumn> series_columns() { return columns; }

std::size_t series_column(std::string_view name) {
  for (std::size_t c = 0; c < columns.size(); ++c)
    if (name == columns[c].name) return c;
  throw std::logic_error("no column " + std::string(name));
}

}  // namespace platen
