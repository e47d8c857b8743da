// How HDF5 reaches the disk when platen writes.
//
// HDF5 does not survive a failed write: when the disk fills up, closing the file leaves damaged structures behind and
// the process dies of a segmentation fault (measured with 1.10.8, default driver). Hence this driver: the first failed
// write is remembered and from then on writes are only pretended, so that HDF5 unwinds as usual; whoever made the file
// looks at the memory before giving it its final name.
#pragma once

#include <hdf5.h>

namespace platen {

// What went wrong on the disk. Lives longer than the file that uses it.
struct WriteFault {
  int error_number = 0;  // errno of the first failure; 0 = everything is on disk once the file is closed
};

// Sets the driver on a file access property list. The file is synced when it is closed; `fault` is written to until
// then. Returns a negative number on failure, as HDF5 does.
herr_t use_fault_driver(hid_t file_access, WriteFault* fault);

}  // namespace platen
