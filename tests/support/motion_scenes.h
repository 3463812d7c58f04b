#pragma once
// Scenes in which something moves while the shutter is open, from 0 to 1.
#include <fmt/format.h>

#include <string>

#include "support/scenes.h"

namespace limn {

// The transform of a shape's (or a scene's first) text, as an animation: at time 1 it is followed
// by a turn about y through the origin [degrees], a scale and a shift.
inline std::string animated(std::string text, const Vec3d& shift, double angle = 0,
                            double scale = 1) {
  const std::string open = "<transform name=\"to_world\">", close = "</transform>";
  const size_t from = text.find(open), to = text.find(close, from);
  const std::string still = text.substr(from + open.size(), to - from - open.size());
  const std::string moving = fmt::format(
      R"(<animation name="to_world"><transform time="0">{0}</transform><transform time="1">{0}
      <rotate y="1" angle="{1}"/><scale value="{2}"/><translate x="{3}" y="{4}" z="{5}"/>
      </transform></animation>)",
      still, angle, scale, shift.x, shift.y, shift.z);
  return text.replace(from, to + close.size() - from, moving);
}

inline std::string with_shutter(const SceneParts& parts, double open, double close) {
  std::string text = scene_text(parts);
  const std::string sensor = "<sensor type=\"perspective\">";
  return text.insert(text.find(sensor) + sensor.size(),
                     fmt::format(R"(<float name="shutter_open" value="{}"/>
                                 <float name="shutter_close" value="{}"/>)",
                                 open, close));
}

inline Scene scene_of_text(const std::string& text) {
  return read_scene_text(text, "", {}, nullptr);
}

}  // namespace limn
