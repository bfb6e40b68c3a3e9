// See the header.
#include "trued_ros2/trued_controller.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include "pluginlib/class_list_macros.hpp"
#include "rclcpp/logging.hpp"

namespace trued_ros2 {

using controller_interface::CallbackReturn;
using controller_interface::interface_configuration_type;
using controller_interface::InterfaceConfiguration;
using controller_interface::return_type;

static const char *const POSITION = "position";

CallbackReturn TruedController::on_init() {
    auto_declare<std::vector<std::string>>("joints", {});
    auto_declare<std::string>("cell", "cell");
    auto_declare<std::string>("runtime_dir", "");
    auto_declare<double>("connect_timeout_s", 2.0);
    return CallbackReturn::SUCCESS;
}

CallbackReturn TruedController::on_configure(const rclcpp_lifecycle::State &) {
    joints_ = get_node()->get_parameter("joints").as_string_array();
    if (joints_.empty() || joints_.size() > TRUED_JOINTS_MAX) {
        RCLCPP_ERROR(get_node()->get_logger(), "`joints` has %zu names, expected 1 to %d, in the model's order", joints_.size(), TRUED_JOINTS_MAX);
        return CallbackReturn::FAILURE;
    }
    return CallbackReturn::SUCCESS;
}

std::vector<std::string> TruedController::positions() const {
    std::vector<std::string> names;
    for (const auto &joint : joints_) names.push_back(joint + "/" + POSITION);
    return names;
}

InterfaceConfiguration TruedController::command_interface_configuration() const {
    return {interface_configuration_type::INDIVIDUAL, positions()};
}

InterfaceConfiguration TruedController::state_interface_configuration() const {
    return {interface_configuration_type::NONE, {}};
}

std::vector<hardware_interface::CommandInterface> TruedController::on_export_reference_interfaces() {
    // Their place must not change any more: the interfaces point into it.
    reference_interfaces_.assign(joints_.size(), std::numeric_limits<double>::quiet_NaN());
    std::vector<hardware_interface::CommandInterface> interfaces;
    for (std::size_t i = 0; i < joints_.size(); i++) {
        interfaces.emplace_back(get_node()->get_name(), joints_[i] + "/" + POSITION, &reference_interfaces_[i]);
    }
    return interfaces;
}

// Waits, as connecting may: the lifecycle is no real-time business.
CallbackReturn TruedController::on_activate(const rclcpp_lifecycle::State &) {
    const auto cell = get_node()->get_parameter("cell").as_string();
    const auto folder = get_node()->get_parameter("runtime_dir").as_string();
    const std::chrono::duration<double> limit(get_node()->get_parameter("connect_timeout_s").as_double());
    std::fill(reference_interfaces_.begin(), reference_interfaces_.end(), std::numeric_limits<double>::quiet_NaN());
    try {
        client_.emplace(cell, std::chrono::duration_cast<trued::nanoseconds>(limit), folder.empty() ? nullptr : folder.c_str());
    } catch (const trued::error &fault) {
        RCLCPP_ERROR(get_node()->get_logger(), "%s", fault.what());
        return CallbackReturn::FAILURE;
    }
    return CallbackReturn::SUCCESS;
}

CallbackReturn TruedController::on_deactivate(const rclcpp_lifecycle::State &) {
    client_.reset();
    return CallbackReturn::SUCCESS;
}

// Outside a chain nobody commands: the references stay what they are, and nothing is written before there are any.
return_type TruedController::update_reference_from_subscribers(const rclcpp::Time &, const rclcpp::Duration &) {
    return return_type::OK;
}

return_type TruedController::update_and_write_commands(const rclcpp::Time &, const rclcpp::Duration &) {
    const auto known = [](double q) { return std::isfinite(q); };
    if (!client_ || !std::all_of(reference_interfaces_.begin(), reference_interfaces_.end(), known)) return return_type::OK;
    try {
        client_->send_joints(reference_interfaces_); // can fail without a daemon; the next line still works
        const trued::target target = client_->target_for(reference_interfaces_);
        bool written = true;
        for (std::size_t i = 0; i < joints_.size(); i++) written &= command_interfaces_[i].set_value(target.q[i]);
        return written ? return_type::OK : return_type::ERROR;
    } catch (const trued::error &) {
        // Only a wrong call is thrown, as a number of joints that is not the model's.
        return return_type::ERROR;
    }
}

} // namespace trued_ros2

PLUGINLIB_EXPORT_CLASS(trued_ros2::TruedController, controller_interface::ChainableControllerInterface)
