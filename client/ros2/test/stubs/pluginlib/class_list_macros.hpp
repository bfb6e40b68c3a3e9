// Stands in for ROS 2: see ../README.md.
#pragma once
#include <type_traits>
#define PLUGINLIB_EXPORT_CLASS(derived, base) static_assert(std::is_base_of<base, derived>::value, "a plugin of its base");
