#pragma once
// Python's side of the table of options (limn/integrators/options.h): what a function takes, from
// which its signature, its documentation and the reading of a call are made.
#include <functional>
#include <string>
#include <type_traits>
#include <vector>

#include "limn/integrators/fit_options.h"
#include "limn/integrators/options.h"
#include "tools/python/bindings.h"

namespace limn::python {

struct Argument {
  std::string name;
  std::string type;      // as a signature has it
  std::string standard;  // that stands where none is given; "" of one that must be given
  std::string help = "";
  std::function<void(nb::handle)> set = nullptr;  // nb::cast_error for another type
  bool hidden = false;                            // not in the signature
  bool given = false;
};

template <class T>
constexpr const char* type_text() {
  if (std::same_as<T, int>) return "int";
  if (std::same_as<T, double>) return "float";
  if (std::same_as<T, std::vector<std::string>>) return "collections.abc.Sequence[str]";
  return std::same_as<T, std::vector<int64_t>> ? "collections.abc.Sequence[int]" : "int | None";
}

class Arguments {
 public:
  explicit Arguments(std::string function) : function_(std::move(function)) {}

  void add(Argument argument) { list_.push_back(std::move(argument)); }
  template <class T>
  void add(const char* name, const char* type, const char* standard, T& value,
           const char* help = "") {
    add({name, type, standard, help, [&value](nb::handle given) { value = nb::cast<T>(given); }});
  }
  // As earlier versions called it: InputError that says what to write instead.
  void add_former(const char* name, const char* instead);
  // What follows is given by its name alone.
  void end_positional() { positional_ = list_.size(); }

  // Rows of options, whose defaults are the fields' values.
  void operator()(Method& method, const Option& option);
  template <class T>
  void operator()(T& value, const Option& option) {
    std::string standard = "None";
    if constexpr (std::is_arithmetic_v<T>)
      standard = nb::cast<std::string>(nb::str(nb::cast(value)));
    if constexpr (requires { value.empty(); }) standard = "()";
    add_row(option, type_text<T>(), standard,
            [&value](nb::handle given) { value = nb::cast<T>(given); });
  }
  template <Choice T>
  void operator()(T& value, const Option& option) {
    add_choice(option, word_of(value, option), [&value, option](nb::handle given) {
      if constexpr (std::same_as<T, bool>) {
        if (option.flag) return void(value = nb::cast<bool>(given));
      }
      set_word(value, option, nb::cast<std::string>(given));
    });
  }

  // "def NAME(...) -> RESULT", of a method with self, and what the arguments mean, a line each.
  std::string signature(const std::string& result) const {
    return "def " + function_ + "(" + list() + ") -> " + result;
  }
  std::string method_signature(const std::string& method, const std::string& result) const {
    return "def " + method + "(self, " + list() + ") -> " + result;
  }
  std::string documentation() const;
  // Sets what is given. TypeError for other types, and for what is unknown, missing or given twice.
  void read(const nb::args& positional, const nb::kwargs& named);
  // InputError where faces have no use for an argument that is given, of `names` and all rows that
  // are of samples.
  void refuse_samples(FilmPoints points, const std::vector<std::string>& names = {}) const;

 private:
  std::string list() const;
  void add_row(const Option& option, const char* type, std::string standard,
               std::function<void(nb::handle)> set);
  void add_choice(const Option& option, const std::string& standard,
                  std::function<void(nb::handle)> set);
  void set(Argument& argument, nb::handle value) const;

  std::string function_;
  std::vector<Argument> list_;
  std::vector<std::string> of_samples_;
  size_t positional_ = 0;
};

// spp and seed as the last that may be given by their places, then threads, progress and, where
// `seconds`, the limit of time.
void add_run(Arguments& arguments, RunRequest& run, nb::object& progress, bool seconds = false);

void add_scene(Arguments& arguments, const SceneHandle*& scene);
// The store of a run in parts, which limn/parts.py gives.
void add_store(Arguments& arguments, RunRequest& run);
// "auto", "uniform" or counts; uniform: null where all pixels are alike anyway.
void add_samples(Arguments& arguments, std::optional<SampleCounts>& counts,
                 bool* uniform = nullptr);

// What calls that compute have.
struct RunCall {
  const SceneHandle* scene = nullptr;
  RunRequest request;
  nb::object progress = nb::none();

  // job(scene, settings) of the scene as it is, see run_job; what it returns.
  template <class Job>
  auto result_of(const Job& job) const {
    const auto shared = scene->share();
    std::invoke_result_t<Job, const Scene&, const RunSettings&> result;
    run_job(settings_of(request, *shared), progress,
            [&](const RunSettings& settings) { result = job(*shared, settings); });
    return result;
  }
  const Film& film() const { return scene->get().film; }
};

inline constexpr const char* kNamesType = "str | collections.abc.Sequence[str]";
inline constexpr const char* kNamesOrNoneType = "str | collections.abc.Sequence[str] | None";
inline constexpr const char* kArrayType = "numpy.typing.ArrayLike";
inline constexpr const char* kArrayOrNoneType = "numpy.typing.ArrayLike | None";

// Binds a function by the struct of a call: `take(Arguments&)` says what it takes, and
// `run(const Arguments&)` computes the result.
template <class Call, class Module>
void def(Module& m, const char* name, const char* result, const std::string& about) {
  Call example;
  Arguments arguments(name);
  example.take(arguments);
  const std::string signature = arguments.signature(result);
  const std::string documentation = about + "\n\n" + arguments.documentation();
  m.def(
      name,
      [name](const nb::args& positional, const nb::kwargs& named) {
        Call call;
        Arguments given(name);
        call.take(given);
        given.read(positional, named);
        return call.run(given);
      },
      nb::sig(signature.c_str()), documentation.c_str());
}

}  // namespace limn::python
