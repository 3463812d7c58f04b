#pragma once
// The commands: a file of its own each, and one row.

#include "tools/limn/command.h"

namespace limn {

std::unique_ptr<Command> make_info_command();
std::unique_ptr<Command> make_render_command();
std::unique_ptr<Command> make_gradient_command();
std::unique_ptr<Command> make_backward_command();
std::unique_ptr<Command> make_fit_command();
std::unique_ptr<Command> make_merge_command();
std::unique_ptr<Command> make_check_command();
std::unique_ptr<Command> make_compare_command();
std::unique_ptr<Command> make_reject_command();
std::unique_ptr<Command> make_methods_command();
std::unique_ptr<Command> make_reconstruct_command();
std::unique_ptr<Command> make_bake_command();
std::unique_ptr<Command> make_relight_command();

using CommandMaker = std::unique_ptr<Command> (*)();
inline constexpr CommandMaker kCommands[] = {
    make_info_command,   make_render_command,  make_gradient_command,    make_backward_command,
    make_fit_command,    make_merge_command,   make_check_command,       make_compare_command,
    make_reject_command, make_methods_command, make_reconstruct_command, make_bake_command,
    make_relight_command};

}  // namespace limn
