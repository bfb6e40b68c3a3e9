// What a loop is told when the daemon goes, comes back, is another one, or may not be joined; and that it goes on.
//
//   c++ -std=c++17 outage.cpp $(pkg-config --cflags --libs trued_client) && ./a.out CELL [SECONDS]
#include <array>
#include <chrono>
#include <cstdlib>
#include <iostream>
#include <optional>
#include <string>
#include <thread>
#include <trued.hpp>

using namespace std::chrono_literals;
using std::chrono::steady_clock;

// Prints what has changed.
static void tell(std::optional<trued::code> &said, trued::code told, const std::string &words) {
    if (said == told) return;
    std::cout << trued::name(told) << ": " << words << std::endl;
    said = told;
}

int main(int argc, char **argv) {
    const std::string cell = argc > 1 ? argv[1] : "cell-1";
    const auto end = steady_clock::now() + std::chrono::seconds(argc > 2 ? std::atoi(argv[2]) : 60);
    const std::array<double, 6> q_cmd{0.0, -0.5, 0.7, 0.0, 0.4, 0.0};
    std::optional<trued::client> client;
    std::optional<trued::code> said;
    while (steady_clock::now() < end) {
        try {
            if (!client) client.emplace(cell, 200ms);
            const trued::sent sent = client->send_joints(q_cmd);
            tell(said, sent.result, sent ? "" : trued::last_error());
            // Whatever is said: there is always something to publish.
            const trued::target publish = client->target_for(q_cmd);
            static_cast<void>(publish);
        } catch (const trued::error &e) {
            tell(said, e.why(), e.what());
        }
        std::this_thread::sleep_for(1ms);
    }
}
