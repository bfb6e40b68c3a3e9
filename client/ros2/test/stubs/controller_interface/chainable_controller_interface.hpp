// Stands in for ROS 2: see ../README.md.
#pragma once
#include <map>
#include <memory>
#include <string>
#include <variant>
#include <vector>

namespace rclcpp {
class Time {};
class Duration {};
struct Logger {};
using Value = std::variant<std::string, double, std::vector<std::string>>;
class Parameter {
public:
    explicit Parameter(Value value) : value_(std::move(value)) {}
    std::string as_string() const { return std::get<std::string>(value_); }
    double as_double() const { return std::get<double>(value_); }
    std::vector<std::string> as_string_array() const { return std::get<std::vector<std::string>>(value_); }

private:
    Value value_;
};
} // namespace rclcpp

namespace rclcpp_lifecycle {
class State {};
class LifecycleNode {
public:
    const char *get_name() const { return "trued"; }
    rclcpp::Logger get_logger() const { return {}; }
    rclcpp::Parameter get_parameter(const std::string &name) const { return rclcpp::Parameter(values.at(name)); }
    std::map<std::string, rclcpp::Value> values;
};
} // namespace rclcpp_lifecycle

namespace hardware_interface {
class CommandInterface {
public:
    CommandInterface(const std::string &prefix, const std::string &name, double *value) : name_(prefix + "/" + name), value_(value) {}
    const std::string &get_name() const { return name_; }
    [[nodiscard]] bool set_value(double value) {
        *value_ = value;
        return true;
    }

private:
    std::string name_;
    double *value_;
};
using LoanedCommandInterface = CommandInterface;
} // namespace hardware_interface

namespace controller_interface {
enum class return_type : unsigned char { OK, ERROR };
enum class CallbackReturn : unsigned char { SUCCESS, FAILURE, ERROR };
enum class interface_configuration_type : unsigned char { ALL, INDIVIDUAL, NONE };
struct InterfaceConfiguration {
    interface_configuration_type type;
    std::vector<std::string> names;
};
class ChainableControllerInterface {
public:
    virtual ~ChainableControllerInterface() = default;
    virtual CallbackReturn on_init() = 0;
    virtual InterfaceConfiguration command_interface_configuration() const = 0;
    virtual InterfaceConfiguration state_interface_configuration() const = 0;
    virtual CallbackReturn on_configure(const rclcpp_lifecycle::State &) { return CallbackReturn::SUCCESS; }
    virtual CallbackReturn on_activate(const rclcpp_lifecycle::State &) { return CallbackReturn::SUCCESS; }
    virtual CallbackReturn on_deactivate(const rclcpp_lifecycle::State &) { return CallbackReturn::SUCCESS; }
    virtual return_type update_and_write_commands(const rclcpp::Time &, const rclcpp::Duration &) = 0;
    std::shared_ptr<rclcpp_lifecycle::LifecycleNode> get_node() const { return node_; }

protected:
    virtual std::vector<hardware_interface::CommandInterface> on_export_reference_interfaces() = 0;
    virtual return_type update_reference_from_subscribers(const rclcpp::Time &, const rclcpp::Duration &) = 0;
    template <typename T> void auto_declare(const std::string &name, const T &value) { node_->values.emplace(name, value); }

    std::vector<double> reference_interfaces_;
    std::vector<hardware_interface::LoanedCommandInterface> command_interfaces_;

private:
    std::shared_ptr<rclcpp_lifecycle::LifecycleNode> node_ = std::make_shared<rclcpp_lifecycle::LifecycleNode>();
};
} // namespace controller_interface
