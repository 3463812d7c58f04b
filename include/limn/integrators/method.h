#pragma once
// A method as options hold it: its row of the table in methods.h, found when it is named.
#include <memory>
#include <string>

namespace limn {

struct MethodType;

// What methods compute. Fits go by the derivatives of kBackward.
enum class Task { kImage, kGradient, kBackward, kFit, kCompare };
inline constexpr const char* kTaskNames[] = {"image", "gradient", "backward", "fit", "compare"};

class Method {
 public:
  // The default of a task.
  explicit Method(Task task);
  // A name with or without settings, as "forest:width=4". InputError that lists the known names,
  // settings or values, and for a name of earlier versions states today's.
  Method(const std::string& name);  // NOLINT: options are given names
  Method(const char* name) : Method(std::string(name)) {}

  const MethodType& operator*() const { return *type_; }
  const MethodType* operator->() const { return type_.get(); }
  const std::string& name() const;  // with the settings that are not the defaults

 private:
  std::shared_ptr<const MethodType> type_;
};

// InputError that lists the methods which do the task, unless this one does.
void check_task(const Method& method, Task task);

}  // namespace limn
