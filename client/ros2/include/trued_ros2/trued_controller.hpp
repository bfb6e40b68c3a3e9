// A chainable controller of ros2_control that lets the trued daemon correct joint positions on their way to the robot.
//
// Promise: what goes on is the last correction by the daemon's own rule, whatever has become of the daemon; an update waits for nothing
// and throws nothing. Never: a rule of its own; that is the client library's.
#ifndef TRUED_ROS2_TRUED_CONTROLLER_HPP
#define TRUED_ROS2_TRUED_CONTROLLER_HPP

#include <optional>
#include <string>
#include <vector>

#include "controller_interface/chainable_controller_interface.hpp"
#include "trued.hpp"

namespace trued_ros2 {

// Reference interfaces: JOINT/position (rad, m), one for each joint, from the controller before. Command interfaces: the same, corrected.
//
// Parameters: `joints` (names, in the model's order), `cell` ("cell"), `runtime_dir` ("": by TRUED_RUNTIME_DIR), `connect_timeout_s` (2.0).
class TruedController : public controller_interface::ChainableControllerInterface {
public:
    controller_interface::CallbackReturn on_init() override;
    controller_interface::InterfaceConfiguration command_interface_configuration() const override;
    controller_interface::InterfaceConfiguration state_interface_configuration() const override;
    controller_interface::CallbackReturn on_configure(const rclcpp_lifecycle::State &previous) override;
    controller_interface::CallbackReturn on_activate(const rclcpp_lifecycle::State &previous) override;
    controller_interface::CallbackReturn on_deactivate(const rclcpp_lifecycle::State &previous) override;
    controller_interface::return_type update_and_write_commands(const rclcpp::Time &time, const rclcpp::Duration &period) override;

protected:
    std::vector<hardware_interface::CommandInterface> on_export_reference_interfaces() override;
    controller_interface::return_type update_reference_from_subscribers(const rclcpp::Time &time, const rclcpp::Duration &period) override;

private:
    // Names of the position interfaces of all joints.
    std::vector<std::string> positions() const;

    std::vector<std::string> joints_;
    std::optional<trued::client> client_;
};

} // namespace trued_ros2

#endif
