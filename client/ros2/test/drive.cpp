// A controller manager in miniature: takes the controller through its life and updates it at 1 kHz until its standard input closes.
// Prints `corrected` once the correction stands, and `out` once it has gone again; then figures. See tests/it/clients/ros2.rs.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <thread>

#include "trued_ros2/trued_controller.hpp"

namespace {

constexpr std::size_t JOINTS = 6;

class Driven : public trued_ros2::TruedController {
public:
    bool start(const std::string &cell) {
        using controller_interface::CallbackReturn;
        if (on_init() != CallbackReturn::SUCCESS) return false;
        std::vector<std::string> joints;
        for (std::size_t i = 0; i < JOINTS; i++) joints.push_back("joint_" + std::to_string(i + 1));
        get_node()->values.at("cell") = cell;
        if (on_configure({}) != CallbackReturn::FAILURE) return false; // no joints yet
        get_node()->values.at("joints") = joints;
        if (on_configure({}) != CallbackReturn::SUCCESS) return false;
        const auto references = on_export_reference_interfaces();
        if (references.size() != JOINTS || references[0].get_name() != "trued/joint_1/position") return false;
        const auto names = command_interface_configuration().names;
        for (std::size_t i = 0; i < JOINTS; i++) command_interfaces_.emplace_back("robot", names[i], &commands[i]);
        return on_activate({}) == CallbackReturn::SUCCESS;
    }
    // One update; how far the robot's command is from the reference.
    double update(const std::vector<double> &q) {
        std::copy(q.begin(), q.end(), reference_interfaces_.begin());
        if (update_and_write_commands({}, {}) != controller_interface::return_type::OK) faults++;
        double off = 0;
        for (std::size_t i = 0; i < q.size(); i++) {
            if (!std::isfinite(commands[i])) faults++;
            off = std::max(off, std::abs(commands[i] - q[i]));
        }
        return off;
    }
    bool writes_nothing_without_references() {
        return update_and_write_commands({}, {}) == controller_interface::return_type::OK && commands[0] == 0;
    }
    void stop() { on_deactivate({}); }

    double commands[JOINTS] = {};
    unsigned faults = 0;
};

} // namespace

int main(int argc, char **argv) {
    Driven controller;
    if (!controller.start(argc > 1 ? argv[1] : "cell") || !controller.writes_nothing_without_references()) return 1;
    std::atomic<bool> over{false};
    std::thread ear([&over] {
        std::cin.get();
        over = true;
    });
    double before = 0, largest = 0, step = 0;
    for (unsigned cycle = 0; !over; cycle++) {
        const double x = 0.1 * std::sin(1e-3 * cycle);
        const double off = controller.update({x, -0.5 + x, 0.7, 0.0, 0.4, 0.0});
        largest = std::max(largest, off);
        step = std::max(step, std::abs(off - before));
        if (off > 1e-4 && before <= 1e-4) std::cout << "corrected" << std::endl;
        if (off == 0 && before > 0) std::cout << "out" << std::endl;
        before = off;
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    ear.join();
    controller.stop();
    std::cout << "largest " << largest << "\nstep " << step << "\nfaults " << controller.faults << std::endl;
}
