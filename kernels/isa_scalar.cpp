#include "kernels/isa_kernels.h"

namespace platen {

KernelTable kernels_scalar(const KernelRequest& request) { return kernels_of<Scalar>(InstructionSet::scalar, request); }

}  // namespace platen
