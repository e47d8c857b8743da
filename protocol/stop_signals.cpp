#include "protocol/stop_signals.h"

#include <signal.h>
#include <unistd.h>

#include <cerrno>
#include <string_view>

namespace platen {
namespace {

std::atomic<int> stop_signal{0};
std::atomic<int> checkpoint_signal{0};
std::atomic<bool> silent{false};
static_assert(std::atomic<int>::is_always_lock_free, "a signal handler may not wait");

// Only calls that POSIX allows in a handler.
extern "C" void on_stop_signal(int number) {
  const int saved = errno;
  if (number == SIGINT && stop_signal.load() == SIGINT) {
    signal(SIGINT, SIG_DFL);
    raise(SIGINT);
  }
  const bool first = stop_signal.exchange(number) == 0;
  if (first && !silent.load()) {
    constexpr std::string_view by_key = "\nstopping after the present steps; Ctrl-C once more leaves at once\n";
    constexpr std::string_view by_system = "\nstopping after the present steps\n";
    const std::string_view text = number == SIGINT ? by_key : by_system;
    [[maybe_unused]] const auto written = write(STDERR_FILENO, text.data(), text.size());
  }
  errno = saved;
}

extern "C" void on_checkpoint_signal(int) { checkpoint_signal.fetch_add(1); }

}  // namespace

const std::atomic<int>& checkpoint_requests() { return checkpoint_signal; }

const std::atomic<int>& catch_stop_signals(bool quiet) {
  silent = quiet;
  struct sigaction action = {};
  action.sa_handler = on_stop_signal;
  action.sa_flags = SA_RESTART;
  sigemptyset(&action.sa_mask);
  for (const int number : {SIGTERM, SIGINT, SIGXCPU}) sigaction(number, &action, nullptr);
  struct sigaction before = {};
  sigaction(SIGHUP, nullptr, &before);
  if (before.sa_handler != SIG_IGN) sigaction(SIGHUP, &action, nullptr);
  for (const int number : {SIGXFSZ, SIGPIPE}) signal(number, SIG_IGN);
  action.sa_handler = on_checkpoint_signal;
  sigaction(SIGUSR1, &action, nullptr);
  return stop_signal;
}

}  // namespace platen
