// The program: reads the command line, calls a command.
#include <fmt/format.h>

#include <CLI/CLI.hpp>

#include "limn/core/error.h"
#include "limn/edgetree/edge_sampler.h"
#include "limn/integrators/derivative_method.h"
#include "tools/limn/command_reject.h"
#include "tools/limn/commands.h"
#include "tools/limn/version.h"

namespace {

using limn::CommonOptions;
using limn::CompareCommand;
using limn::GradientCommand;

void add_input(CLI::App& command, CommonOptions& common, std::vector<std::string>& defines,
               const std::string& text, const std::string& type) {
  command.add_option("scene", common.scene, text)->required()->type_name(type);
  command.add_option("-D", defines, "Value of a $name in the scene")
      ->type_name("NAME=VALUE")
      ->allow_extra_args(false);
  command.add_option("--seed", common.seed, "Seed of all random numbers (default: the scene's)")
      ->check(CLI::NonNegativeNumber);
  command.add_option("--threads", common.threads, "Threads (default: all cores)")
      ->check(CLI::Range(1, 4096));
  command.add_flag("--quiet", common.quiet, "Print nothing but errors and warnings");
}

void add_common(CLI::App& command, CommonOptions& common, std::vector<std::string>& defines) {
  add_input(command, common, defines, "Scene file (Mitsuba 3 XML)", "SCENE");
  command.add_option("--spp", common.spp, "Samples per pixel (default: the scene's)")
      ->check(CLI::Range(1, 1 << 30));
  command.add_option("--json", common.json, "Write the figures for machines to this file");
  command
      .add_option("--shading", common.shading,
                  "How interpolated normals shade: continuous, or as Mitsuba does (its jumps are "
                  "missing from gradients)")
      ->check(CLI::IsMember({"continuous", "mitsuba"}))
      ->capture_default_str();
}

void add_gradient_options(CLI::App& command, GradientCommand& gradient) {
  command.add_option("--wrt", gradient.parameters, "Parameter to differentiate (repeatable)")
      ->required()
      ->type_name("PARAM")
      ->allow_extra_args(false);
  command.add_option("--terms", gradient.terms, "Terms to compute: interior,camera,boundary")
      ->capture_default_str();
  std::string samplers;
  for (const auto& type : limn::edge_sampler_types()) {
    samplers += (samplers.empty() ? "" : ", ") + type.name;
  }
  command
      .add_option("--sampler", gradient.sampler, "How shading points choose an edge: " + samplers)
      ->capture_default_str();
  command
      .add_option("--samples", gradient.samples,
                  "What a sample per pixel holds: paths for the interior, camera samples (may be "
                  "less than 1), edges per vertex of one path for the boundary; auto: the best for "
                  "the time by a short pilot, or 1,1,1 if --spp is less than 16")
      ->capture_default_str()
      ->type_name("I,C,B");
}

void add_compare_options(CLI::App& command, CompareCommand& compare) {
  command.add_option("--wrt", compare.parameter, "Parameter to differentiate")
      ->required()
      ->type_name("PARAM");
  std::string names;
  for (const auto& method : limn::method_names()) names += method.name + ", ";
  command
      .add_option("--methods", compare.methods,
                  "Methods to compare, the first is the measure of the others: " + names +
                      "mitsuba (where Mitsuba 3 is installed)")
      ->delimiter(',')
      ->required()
      ->type_name("A,B,...");
  command.add_option("--time", compare.time, "Seconds of each run, set-up included")
      ->required()
      ->check(CLI::PositiveNumber)
      ->type_name("SECONDS");
  command
      .add_option("--sweep", compare.rungs,
                  "Error against time: this many times, each twice the one before, up to --time "
                  "(5 if no number is given)")
      ->expected(0, 1)
      ->default_str("5")
      ->check(CLI::Range(1, 30))
      ->type_name("N");
  command.add_option("--repeats", compare.repeats, "Runs of each method and time, for error bars")
      ->check(CLI::Range(1, 1 << 20))
      ->capture_default_str();
  command
      .add_option("--reference", compare.reference,
                  "Reference that limn compare wrote for the same scene and parameter (default: "
                  "that of the folder, or a new one)")
      ->type_name("FILE.exr");
  command
      .add_option("--reference-time", compare.reference_time,
                  "Seconds for a new reference (default: four times all runs of one method)")
      ->check(CLI::PositiveNumber)
      ->type_name("SECONDS");
  command.add_option("--terms", compare.terms, "Terms to compute: interior,camera,boundary")
      ->capture_default_str();
  command
      .add_option("--samples", compare.samples,
                  "Samples of each term, as in `limn gradient` (finite differences have none)")
      ->capture_default_str();
  command
      .add_option("--step", compare.step,
                  "Step of finite differences (default: found by a short pilot)")
      ->check(CLI::PositiveNumber);
  command.add_option("-o,--output", compare.output, "Folder to write")
      ->required()
      ->type_name("FOLDER");
  command.add_flag("!--no-report", compare.report, "Do not make report.html");
}

// What was typed, for a shell.
std::string command_line(int argc, char** argv) {
  const std::string plain =
      "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-+=.,:/@%";
  std::string line = "limn";
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (!word.empty() && word.find_first_not_of(plain) == std::string::npos) {
      line += " " + word;
      continue;
    }
    line += " '";
    for (const char c : word) line += c == '\'' ? "'\\''" : std::string(1, c);
    line += "'";
  }
  return line;
}

std::map<std::string, std::string> parse_defines(const std::vector<std::string>& defines) {
  std::map<std::string, std::string> parsed;
  for (const std::string& define : defines) {
    const size_t equals = define.find('=');
    if (equals == std::string::npos || equals == 0) {
      throw limn::InputError("-D " + define + ": expected NAME=VALUE");
    }
    parsed[define.substr(0, equals)] = define.substr(equals + 1);
  }
  return parsed;
}

// CLI11 alone would say no more than that a command is needed.
void check_command(const CLI::App& app, int argc, char** argv) {
  const std::string first = argc > 1 ? argv[1] : "";
  if (first.starts_with('-')) return;
  std::string known;
  for (const CLI::App* command : app.get_subcommands(nullptr)) {
    if (command->get_name() == first) return;
    known += (known.empty() ? "" : ", ") + command->get_name();
  }
  throw limn::InputError(
      (first.empty() ? "limn: a command is needed" : "limn " + first + ": no such command") +
      " (known: " + known + "; limn --help tells more)");
}

int run(int argc, char** argv) {
  CLI::App app("limn: a path tracer that also computes how its image changes when the scene moves");
  app.require_subcommand(1);
  app.set_version_flag("--version", limn::version_text(), "Print version, commit and build type");
  CommonOptions common;
  GradientCommand command;
  command.sampler = limn::edge_sampler_types().front().name;
  std::vector<std::string> defines;

  CLI::App* info =
      app.add_subcommand("info", "What the scene holds, and what can be differentiated");
  add_common(*info, common, defines);
  CLI::App* render = app.add_subcommand("render", "Render the image");
  add_common(*render, common, defines);
  render
      ->add_option("-o,--output", command.output, "Image to write (.exr; a .png is put beside it)")
      ->required();
  CLI::App* gradient = app.add_subcommand("gradient", "Derivative images, with standard errors");
  add_common(*gradient, common, defines);
  add_gradient_options(*gradient, command);
  gradient
      ->add_option("-o,--output", command.output,
                   "Image to write (.exr; _stderr.exr and .png are put beside it)")
      ->required();
  CLI::App* check = app.add_subcommand("check", "Compare a gradient with finite differences");
  add_common(*check, common, defines);
  add_gradient_options(*check, command);
  check
      ->add_option("--step", command.step, "Step of the differences (default: the parameter's own)")
      ->check(CLI::PositiveNumber);
  check
      ->add_option("--block", command.block,
                   "Compare blocks of this many pixels (default: an eighth of the longer side)")
      ->check(CLI::Range(1, 1 << 20));
  CLI::App* compare = app.add_subcommand(
      "compare", "Derivative images of several methods at equal time, with a report");
  CompareCommand comparison;
  add_common(*compare, common, defines);
  add_compare_options(*compare, comparison);
  CLI::App* reject = app.add_subcommand(
      "reject", "Pictures and figures of what edge samplers reject, accept and wrongly accept");
  limn::RejectCommand rejection;
  add_input(*reject, common, defines, "Scene file, or a mesh (.obj, .ply)", "SCENE|MESH");
  limn::add_reject_options(*reject, rejection);

  check_command(app, argc, argv);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? limn::kSuccess : limn::kBadInput;
  }
  common.defines = parse_defines(defines);
  comparison.command_line = rejection.command_line = command_line(argc, argv);
  if (info->parsed()) return limn::run_info(common);
  if (render->parsed()) return limn::run_render(common, command.output);
  if (gradient->parsed()) return limn::run_gradient(common, command);
  if (compare->parsed()) return limn::run_compare(common, comparison);
  if (reject->parsed()) return limn::run_reject(common, rejection);
  return limn::run_check(common, command);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const limn::InputError& error) {
    fmt::print(stderr, "{}\n", error.what());
  } catch (const std::exception& error) {
    fmt::print(stderr, "error: {}\n", error.what());
  }
  return limn::kBadInput;
}
