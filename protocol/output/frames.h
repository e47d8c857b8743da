// Frames: the bed at one instant for ParaView and VTK, one file each, and the list with their times.
//
//   frames/000000.hdf     VTKHDF 1.0, UnstructuredGrid. Points are centres; cells are first one vertex for each sphere, then one line
//                         for each contact. Where a contact reaches through a periodic side its second end is a point of its
//                         own behind the spheres, of radius 0, so that no line crosses the box.
//   frames.hdf.series     names and times, what one opens
//
// Point data: id (-1 for such ends), radius, velocity, angular_velocity, coordination_number. Cell data: contact (0 sphere, 1
// contact), overlap, normal_force, tangential_force (sizes), branch; 0 for spheres.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/snapshot.h"

namespace platen {

struct Frame {
  std::string name;   // relative to the run folder
  double time = 0.0;  // [s]
};

// Writes one frame; `width`, `depth` [m] of the periodic box. Throws OutputError.
void write_frame(const std::filesystem::path& path, const Snapshot& snapshot, bool contacts, double width, double depth);

// frames.hdf.series, whole. Throws OutputError.
void write_frame_series(const std::filesystem::path& path, const std::vector<Frame>& frames);

}  // namespace platen
