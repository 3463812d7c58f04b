#pragma once
// What a person at a terminal sees and does: progress with time left, Ctrl-C.
#include <atomic>
#include <functional>
#include <string>

namespace limn {

// A flag that the first Ctrl-C, SIGTERM or SIGHUP sets; a second one, half a second later or more,
// ends the program at once.
const std::atomic<bool>& interrupt_flag();
void watch_interrupt();

// A progress callback that redraws one line on standard error; does nothing unless that is a
// terminal and not `quiet`.
std::function<void(double)> progress_bar(const std::string& label, bool quiet);

}  // namespace limn
