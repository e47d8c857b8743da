// Requests to stop, as the system and the user send them.
#pragma once

#include <atomic>

namespace platen {

// From now on SIGTERM, SIGINT, SIGHUP and SIGXCPU store their number in the returned flag (0 before), where the run
// looks at it between steps. A second SIGINT ends the program at once, as if it had not been caught. SIGHUP stays ignored
// where it was (nohup). SIGUSR1 asks for a checkpoint. SIGXFSZ and SIGPIPE are ignored, so that a size limit and a closed terminal are
// errors of a write instead of the end of the run. A note goes to standard error at the first request unless `quiet`.
const std::atomic<int>& catch_stop_signals(bool quiet);

// Grows with every SIGUSR1.
const std::atomic<int>& checkpoint_requests();

}  // namespace platen
