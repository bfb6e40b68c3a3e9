// The robot's side of a cell in ten lines: what an integrator adds to a loop of his own.
//
//   c++ -std=c++17 robot_loop.cpp $(pkg-config --cflags --libs trued_client) && ./a.out CELL [CYCLES]
#include <array>
#include <chrono>
#include <cstdlib>
#include <iostream>
#include <string>
#include <thread>
#include <trued.hpp>

using namespace std::chrono_literals;

// Stands for the cell's own path: joint 1 goes slowly to and fro.
static std::array<double, 6> next_target(unsigned cycle) {
    const unsigned step = cycle % 2000;
    return {0.0001 * (step < 1000 ? step : 2000 - step), -0.5, 0.7, 0.0, 0.4, 0.0};
}

// Stands for the robot's own interface.
static void publish_to_robot(const double *, unsigned) {}

static void run(const std::string &cell, unsigned cycles) {
    trued::client trued(cell, 2s);
    for (unsigned cycle = 0; cycle < cycles; cycle++) {
        const auto q_cmd = next_target(cycle); // rad
        trued.send_joints(q_cmd); // can fail without a daemon; the next line still works
        const trued::target target = trued.target_for(q_cmd);
        publish_to_robot(target.q, target.joints);
        std::this_thread::sleep_for(1ms);
    }
}

int main(int argc, char **argv) try {
    run(argc > 1 ? argv[1] : "cell-1", argc > 2 ? static_cast<unsigned>(std::atoi(argv[2])) : 10000);
} catch (const trued::error &e) {
    std::cerr << e.what() << '\n';
    return 1;
}
