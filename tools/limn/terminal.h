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
// terminal and not `quiet`. What is left is shown once it can be known: after three seconds and a
// hundredth.
std::function<void(double)> progress_bar(const std::string& label, bool quiet);
// Before other text: takes away the line of progress, which may be half of it.
void clear_progress();
// That line: "fit:  25 %, 9s left" after `spent` seconds, as progress_bar() has it.
std::string progress_line(const std::string& label, double done, double spent);

}  // namespace limn
