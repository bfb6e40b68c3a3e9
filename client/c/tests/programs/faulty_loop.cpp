// A robot's loop with random faults: what it commands and would send to the robot is written to a file, one record per cycle,
// for the test that judges it.
//
//   faulty_loop CELL FILE CYCLES CALM SEED: CYCLES cycles with random faults, then CALM cycles without.
#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <optional>
#include <random>
#include <stdexcept>
#include <thread>
#include <trued.hpp>

using namespace std::chrono_literals;

static constexpr std::size_t joint_count = 6;
using joints = std::array<double, joint_count>;

struct record {
    std::uint64_t now_ns, stamp_ns;
    std::uint32_t mode, source;
    double angle, rate, jerk;
    joints command, sent;
};
static_assert(sizeof(record) == 144, "as tests/src/loop_records.rs reads it");

static std::mt19937_64 generator;

static std::uint64_t below(std::uint64_t n) { return generator() % n; }

static joints path(double t_s) {
    joints q{0.2, 0.3, -0.2, 0.3, 0.8, 0.1};
    for (std::size_t i = 0; i < joint_count; i++) q[i] += 0.05 * std::sin(6.283185307179586 * (t_s / 5.0 + 0.1 * static_cast<double>(i)));
    return q;
}

// A NaN or infinite command has to return an error and change nothing.
static void no_number(trued::client &client) {
    constexpr double inf = std::numeric_limits<double>::infinity();
    const auto before = client.last_target();
    joints q = path(0.0);
    q[below(joint_count)] = std::array<double, 3>{std::nan(""), inf, -inf}[below(3)];
    try {
        client.target_for(q);
    } catch (const trued::error &) {
        const auto after = client.last_target();
        if (before.has_value() != after.has_value()) throw std::runtime_error("what was sent last has changed");
        for (std::size_t i = 0; before && i < joint_count; i++) {
            if (before->q[i] != after->q[i]) throw std::runtime_error("what was sent last has changed");
        }
        return;
    }
    throw std::runtime_error("no number was answered");
}

// The faults of the loop itself, one cycle after the other.
struct faults {
    std::int64_t clock_ns = 0;
    double phase_s = 0.0;
    std::size_t joint = 0;
    std::uint64_t outside = 0;
    bool is_silent = false, jumps = false;

    void strike(trued::client &client) {
        const auto fault = below(10000);
        is_silent = fault >= 20 && fault < 40;
        jumps = fault == 6;
        if (fault < 3) std::this_thread::sleep_for(std::chrono::nanoseconds(below(300000000)));
        if (fault == 3) phase_s += 1e-3 * static_cast<double>(below(2000));
        if (fault == 4) clock_ns = std::array<std::int64_t, 5>{0, 300000000, 600000000, 2000000000, 3600000000000}[below(5)];
        if (fault == 5) client.start_anew();
        if (fault >= 10 && fault < 14) no_number(client);
        if (fault >= 14 && fault < 17) joint = below(joint_count), outside = 1 + below(1000);
    }

    void end() {
        clock_ns = 0, outside = 0;
        is_silent = jumps = false;
    }

    joints command() {
        joints q = path(1e-9 * static_cast<double>(trued::monotonic_ns()) + phase_s);
        if (jumps) q[below(joint_count)] += 1.0;
        if (outside > 0) q[joint] += 7.0, outside--;
        return q;
    }
};

static void cycle(trued::client &client, faults &wrong, std::uint64_t due_ns, record &now) {
    now.command = wrong.command();
    if (!wrong.is_silent) {
        // Of the cycle, as a cell's own clock would stamp it.
        const auto t_ns = static_cast<std::uint64_t>(static_cast<std::int64_t>(due_ns) + wrong.clock_ns);
        const auto sent = client.send(trued::setpoint(now.command).at_ns(t_ns));
        if (sent || sent.result == trued::code::message_lost) now.stamp_ns = t_ns;
        if (sent) client.wait_corrected(sent.seq, 500us);
    }
    now.now_ns = trued::monotonic_ns();
    const auto target = client.target_for(now.command, now.now_ns);
    if (const auto status = client.status()) {
        now.mode = status->mode;
        now.angle = status->correction_max[0];
        now.rate = status->correction_rate_max[0];
        now.jerk = status->correction_jerk_max[0];
    }
    now.source = target.source;
    for (std::size_t i = 0; i < joint_count; i++) now.sent[i] = target.q[i];
}

int main(int argc, char **argv) {
    if (argc != 6) return 2;
    const std::uint64_t faulty = std::strtoull(argv[3], nullptr, 10), cycles = faulty + std::strtoull(argv[4], nullptr, 10);
    generator.seed(std::strtoull(argv[5], nullptr, 10));
    try {
        std::ofstream file(argv[2], std::ios::binary);
        trued::client client(argv[1], 10s);
        auto due_ns = trued::monotonic_ns();
        faults wrong;
        record now{};
        for (std::uint64_t k = 0; k < cycles; k++) {
            if (k < faulty) wrong.strike(client);
            if (k == faulty) wrong.end();
            due_ns = std::max(due_ns + 1000000, trued::monotonic_ns());
            for (std::uint64_t at_ns; (at_ns = trued::monotonic_ns()) < due_ns;) {
                std::this_thread::sleep_for(std::chrono::nanoseconds(due_ns - at_ns));
            }
            cycle(client, wrong, due_ns, now);
            if (!file.write(reinterpret_cast<const char *>(&now), sizeof now)) throw std::runtime_error("cannot write");
        }
    } catch (const std::exception &fault) {
        std::fprintf(stderr, "%s\n", fault.what());
        return 1;
    }
}
