// Stands in for ROS 2: see ../README.md.
#pragma once
#include <cstdio>
#define RCLCPP_ERROR(logger, ...) ((void)(logger), std::fprintf(stderr, __VA_ARGS__), std::fputc('\n', stderr))
