// Everything that the library can do, once, with figures that are the same in every language.
//
//   c++ -std=c++17 every_call.cpp $(pkg-config --cflags --libs trued_client) && ./a.out CELL [TARGETS]
//
// The cell: six joints, `run --lockstep`, mode "full", force of 3 channels at 10 kHz with the vibration watch.
#include <algorithm>
#include <array>
#include <chrono>
#include <cinttypes>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <thread>
#include <trued.hpp>
#include <vector>

using namespace std::chrono_literals;

static constexpr unsigned joints = 6, blocks = 350, block = 100;

// The path: numbers that every language writes with the same bits.
static std::array<double, joints> target_of(unsigned k) {
    constexpr std::array<int, joints> base{200000, 300000, -200000, 300000, 800000, 100000};
    std::array<double, joints> q{};
    for (unsigned i = 0; i < joints; i++) {
        const int turn = static_cast<int>((k + 500 * i) % 4000) - 2000;
        q[i] = (base[i] + 20 * std::abs(turn)) / 1048576.0;
    }
    return q;
}

// FNV-1a over the bits of numbers.
static std::uint64_t hashed(std::uint64_t hash, const double *numbers, unsigned count) {
    for (unsigned i = 0; i < count; i++) {
        std::uint64_t bits;
        std::memcpy(&bits, &numbers[i], sizeof bits);
        for (int byte = 0; byte < 8; byte++) hash = (hash ^ ((bits >> (8 * byte)) & 0xff)) * 0x100000001b3u;
    }
    return hash;
}

// Commands a path, and takes each answer.
static void correct(trued::client &client, unsigned targets) {
    std::uint64_t hash = 0xcbf29ce484222325u;
    std::vector<double> took_us(targets);
    unsigned corrected = 0;
    client.start_anew();
    for (unsigned k = 0; k < targets; k++) {
        const auto q = target_of(k);
        const auto start = trued::monotonic_ns();
        const auto sent = client.send(trued::setpoint(q).at_ns((k + 1) * std::uint64_t{1000000}));
        if (!sent) throw trued::error(sent.result, trued::last_error());
        const auto answer = client.wait_corrected(sent.seq, 10s);
        if (!answer) throw std::runtime_error("no answer");
        took_us[k] = static_cast<double>(trued::monotonic_ns() - start) * 1e-3;
        hash = hashed(hash, answer->correction, answer->joints);
        corrected += answer->status == TRUED_CORRECTION_STATUS_CORRECTED;
        client.target_for(q);
    }
    std::sort(took_us.begin(), took_us.end());
    std::printf("targets %u\ncorrected %u\nhash %016" PRIx64 "\n", targets, corrected, hash);
    std::printf("round_trip_us_p50 %.3f\nround_trip_us_p99 %.3f\n", took_us[targets / 2], took_us[targets * 99ull / 100]);
}

// Waits until something holds.
template <typename Holds> static bool comes_to(Holds holds) {
    for (int look = 0; look < 10000; look++) {
        if (holds()) return true;
        std::this_thread::sleep_for(1ms);
    }
    return false;
}

// Sends noise, then a tone of 72 Hz on y; the watch says what rings.
static void listen(trued::force_source &force, trued::monitor &monitor) {
    std::optional<trued::vibration> ringing;
    const auto hear = [&] {
        while (const auto said = monitor.vibration()) {
            if (said->state == TRUED_VIBRATION_STATE_CONFIRMED) ringing = said;
        }
        return ringing.has_value();
    };
    // The first status comes a moment after connecting.
    if (!comes_to([&] { return monitor.status().has_value(); })) throw std::runtime_error("no status came");
    const auto blocks_taken = [&] { return monitor.status().value().force_blocks; };
    const auto before = blocks_taken();
    const auto taken = [&](unsigned count) {
        const auto enough = [&] { return blocks_taken() >= before + count; };
        if (!comes_to(enough)) throw std::runtime_error("the daemon does not take the force blocks");
    };
    std::uint64_t chance = 11;
    const auto start = trued::monotonic_ns();
    std::vector<double> samples(3 * block);
    for (unsigned k = 0; k < blocks; k++) {
        for (unsigned i = 0; i < 3 * block; i++) {
            chance = chance * 6364136223846793005u + 1442695040888963407u;
            const double t_s = (block * k + i / 3) * 1e-4;
            const double tone = i % 3 == 1 && k > 200 ? 4.0 * std::sin(6.283185307179586 * 72.0 * t_s) : 0.0;
            samples[i] = static_cast<double>(chance >> 11) / 9007199254740992.0 - 0.5 + tone;
        }
        const auto sent = force.send(start + k * std::uint64_t{10000000}, 10000.0, 3, samples);
        if (sent != trued::code::ok) throw trued::error(sent, trued::last_error());
        if (k % 32 == 31) taken(k + 1);
        hear();
    }
    taken(blocks);
    comes_to(hear);
    std::printf("force_blocks %u\nforce_lost %" PRIu64 "\n", blocks, force.lost());
    std::printf("rings_hz %.0f\nrings_axis %u\n", ringing ? ringing->frequency_hz : NAN, ringing ? ringing->axis : 9);
}

// Asks for everything that may be asked for.
static void ask(trued::client &client, trued::monitor &monitor) {
    const auto before = client.status().value();
    const auto bypassed_is = [&](unsigned on) {
        return comes_to([&] { return client.status().value().bypassed == on; });
    };
    client.ping(10s);
    client.bypass(true, 10s);
    bool bypassed = bypassed_is(1);
    monitor.bypass(false, 10s);
    bypassed &= bypassed_is(0);
    client.reload(nullptr, 10s);
    bool refused = false;
    try {
        monitor.reload("/nowhere/model.toml", 10s);
    } catch (const trued::error &e) {
        refused = e.why() == trued::code::refused;
    }
    trued::process process;
    process.spindle_rpm = 12000.0;
    process.teeth = 2;
    client.process_state(process, 10s);
    auto state = trued::made<trued::robot_state>();
    state.joints = joints;
    state.flags = TRUED_STATE_HAS_Q;
    state.t_ns = trued::monotonic_ns();
    client.send_state(state);
    // The setpoints after the next command: more than are sent.
    std::vector<std::array<double, joints>> ahead;
    for (unsigned k = 1; k <= TRUED_HORIZON_POINTS_MAX + 2; k++) ahead.push_back(target_of(k));
    const auto horizon = client.set_horizon(ahead);
    if (!horizon) throw trued::error(horizon.result, trued::last_error());
    std::printf("joints %u\nmode %u\nbypassed %d\nreload_refused %d\n", before.joints, before.mode, bypassed, refused);
    std::printf("horizon %" PRIu32 "\n", horizon.points);
}

// Changes the mode and the recording, and back.
static void steer(trued::client &client, trued::monitor &monitor) {
    using trued::mode;
    using trued::recorder_action;
    const auto is = [&](trued_mode mode, trued_recorder_state recorder) {
        return comes_to([&] {
            const auto status = client.status().value();
            return status.mode == mode && status.recorder == recorder;
        });
    };
    bool done = is(TRUED_MODE_FULL, TRUED_RECORDER_STATE_RECORDING);
    client.mode(mode::limited, 10s);
    done &= is(TRUED_MODE_LIMITED, TRUED_RECORDER_STATE_RECORDING);
    monitor.mode(mode::shadow, 10s);
    client.mark("part 7", 10s);
    monitor.mark("part 8", 10s);
    client.record(recorder_action::keep, 10s);
    monitor.record(recorder_action::stop, 10s);
    done &= is(TRUED_MODE_SHADOW, TRUED_RECORDER_STATE_STOPPED);
    bool refused = false;
    try {
        monitor.mark("part 9", 10s);
    } catch (const trued::error &e) {
        refused = e.why() == trued::code::refused;
    }
    client.record(recorder_action::start, 10s);
    monitor.arm(true, 10s);
    done &= is(TRUED_MODE_FULL, TRUED_RECORDER_STATE_RECORDING);
    std::printf("steered %d\nmark_refused %d\n", done, refused);
}

// Sends measured points of the tool. The cell has no [measured]: they are taken, and nothing is trimmed.
static void measure(const char *cell, trued::client &client) {
    trued::instrument instrument(cell, 10s);
    const std::array<double, 3> point_m{1.0, 0.5, 0.25};
    unsigned sent = instrument.send(point_m) == trued::code::ok;
    sent += instrument.send(point_m, trued::monotonic_ns()) == trued::code::ok;
    const auto status = client.status().value();
    std::printf("points_sent %u\npoints_lost %llu\n", sent, static_cast<unsigned long long>(instrument.lost()));
    std::printf("trim_state %u\ntrim_points %llu\n", status.trim_state, static_cast<unsigned long long>(status.trim_measurements));
}

int main(int argc, char **argv) try {
    const char *cell = argc > 1 ? argv[1] : "cell-1";
    trued::client client(cell, 10s);
    trued::monitor monitor(cell, 10s);
    trued::force_source force(cell, 10s);
    correct(client, argc > 2 ? static_cast<unsigned>(std::atoi(argv[2])) : 10000);
    listen(force, monitor);
    ask(client, monitor);
    steer(client, monitor);
    measure(cell, client);
} catch (const std::exception &e) {
    std::fprintf(stderr, "%s\n", e.what());
    return 1;
}
