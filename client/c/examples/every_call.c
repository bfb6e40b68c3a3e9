/* Everything that the library can do, once, with figures that are the same in every language.
 *
 *   cc every_call.c $(pkg-config --cflags --libs trued_client) -lm && ./a.out CELL [TARGETS]
 *
 * The cell: six joints, `run --lockstep`, mode "full", force of 3 channels at 10 kHz with the vibration watch.
 */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <trued.h>

enum { JOINTS = 6, BLOCKS = 350, BLOCK = 100 };
static const uint64_t SECOND = 1000000000;

/* Ends the program where a call fails that may not. */
static void must(const char *what, trued_code code) {
    if (code != TRUED_OK) {
        fprintf(stderr, "%s: %s: %s\n", what, trued_code_name(code), trued_last_error());
        exit(1);
    }
}

/* The path: numbers that every language writes with the same bits. */
static void target_of(unsigned k, double q[JOINTS]) {
    const int base[JOINTS] = {200000, 300000, -200000, 300000, 800000, 100000};
    for (int i = 0; i < JOINTS; i++) {
        int turn = (int)((k + 500u * (unsigned)i) % 4000u) - 2000;
        q[i] = (base[i] + 20 * abs(turn)) / 1048576.0;
    }
}

/* FNV-1a over the bits of numbers. */
static uint64_t hashed(uint64_t hash, const double *numbers, unsigned count) {
    for (unsigned i = 0; i < count; i++) {
        uint64_t bits;
        memcpy(&bits, &numbers[i], sizeof bits);
        for (int byte = 0; byte < 8; byte++) {
            hash = (hash ^ ((bits >> (8 * byte)) & 0xff)) * 0x100000001b3u;
        }
    }
    return hash;
}

static int by_size(const void *a, const void *b) {
    uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return (x > y) - (x < y);
}

/* Commands a path, and takes each answer. */
static void correct(trued_client *client, unsigned targets) {
    uint64_t hash = 0xcbf29ce484222325u, *took = calloc(targets, sizeof *took);
    unsigned corrected = 0;
    if (took == NULL) exit(1);
    must("start anew", trued_client_start_anew(client));
    for (unsigned k = 0; k < targets; k++) {
        trued_setpoint setpoint = TRUED_INIT(trued_setpoint);
        setpoint.joints = JOINTS;
        setpoint.t_ns = (k + 1) * (uint64_t)1000000;
        target_of(k, setpoint.q);
        uint64_t seq, start = trued_monotonic_ns();
        must("send", trued_client_send(client, &setpoint, &seq));
        trued_corrected answer = TRUED_INIT(trued_corrected);
        must("answer", trued_client_wait_corrected(client, seq, 10 * SECOND, &answer));
        took[k] = trued_monotonic_ns() - start;
        hash = hashed(hash, answer.correction, answer.joints);
        corrected += answer.status == TRUED_CORRECTION_STATUS_CORRECTED;
        trued_target target = TRUED_INIT(trued_target);
        must("target", trued_client_target(client, setpoint.q, JOINTS, trued_monotonic_ns(), &target));
    }
    qsort(took, targets, sizeof *took, by_size);
    printf("targets %u\ncorrected %u\nhash %016" PRIx64 "\n", targets, corrected, hash);
    printf("round_trip_us_p50 %.3f\nround_trip_us_p99 %.3f\n", (double)took[targets / 2] * 1e-3,
           (double)took[targets * 99ull / 100] * 1e-3);
    free(took);
}

static void nap(void) {
    nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL);
}

/* How many force blocks the daemon has taken since it started. The first status comes a moment after connecting. */
static uint64_t blocks_taken(trued_monitor *monitor) {
    trued_status status = TRUED_INIT(trued_status);
    for (int look = 0; look < 10000; look++) {
        if (trued_monitor_status(monitor, &status) == TRUED_OK) return status.force_blocks;
        nap();
    }
    fprintf(stderr, "no status came\n");
    exit(1);
}

/* Waits until the daemon has taken so many blocks. */
static void taken(trued_monitor *monitor, uint64_t blocks) {
    for (int look = 0; look < 10000; look++) {
        if (blocks_taken(monitor) >= blocks) return;
        nap();
    }
    fprintf(stderr, "the daemon does not take the force blocks\n");
    exit(1);
}

/* The last confirmed verdict since. */
static int heard(trued_monitor *monitor, trued_vibration *confirmed) {
    int found = 0;
    trued_vibration vibration = TRUED_INIT(trued_vibration);
    while (trued_monitor_vibration(monitor, &vibration) == TRUED_OK) {
        if (vibration.state == TRUED_VIBRATION_STATE_CONFIRMED) {
            *confirmed = vibration;
            found = 1;
        }
    }
    return found;
}

/* Sends noise, then a tone of 72 Hz on y; the watch says what rings. */
static void listen(trued_force *force, trued_monitor *monitor) {
    uint64_t chance = 11, start = trued_monotonic_ns(), before = blocks_taken(monitor), lost = 0;
    double samples[3 * BLOCK];
    trued_vibration ringing = TRUED_INIT(trued_vibration);
    int found = 0;
    for (unsigned k = 0; k < BLOCKS; k++) {
        for (unsigned i = 0; i < 3 * BLOCK; i++) {
            chance = chance * 6364136223846793005u + 1442695040888963407u;
            double t_s = (BLOCK * k + i / 3) * 1e-4;
            double tone = i % 3 == 1 && k > 200 ? 4.0 * sin(6.283185307179586 * 72.0 * t_s) : 0.0;
            samples[i] = (double)(chance >> 11) / 9007199254740992.0 - 0.5 + tone;
        }
        trued_force_samples block = TRUED_INIT(trued_force_samples);
        block.channels = 3;
        block.count = BLOCK;
        block.t_ns = start + k * (uint64_t)10000000;
        block.rate_hz = 10000.0;
        block.doubles = samples;
        must("force", trued_force_send(force, &block));
        if (k % 32 == 31) taken(monitor, before + k + 1);
        found |= heard(monitor, &ringing);
    }
    taken(monitor, before + BLOCKS);
    for (int look = 0; look < 2000 && !found; look++) {
        nap();
        found = heard(monitor, &ringing);
    }
    must("lost", trued_force_lost(force, &lost));
    printf("force_blocks %d\nforce_lost %" PRIu64 "\n", BLOCKS, lost);
    printf("rings_hz %.0f\nrings_axis %u\n", found ? ringing.frequency_hz : NAN, ringing.axis);
    if (found) fprintf(stderr, "%s\n", ringing.sentence);
}

/* Whether the status comes to say so, within seconds. */
static int comes_to(trued_client *client, uint64_t model_epoch, uint32_t bypassed) {
    for (int look = 0; look < 5000; look++) {
        trued_status status = TRUED_INIT(trued_status);
        if (trued_client_status(client, &status) == TRUED_OK && status.bypassed == bypassed &&
            status.model_epoch >= model_epoch) {
            return 1;
        }
        nap();
    }
    return 0;
}

/* Whether the status comes to say so of mode and recorder, within seconds. */
static int steered(trued_client *client, trued_mode mode, trued_recorder_state recorder) {
    for (int look = 0; look < 5000; look++) {
        trued_status status = TRUED_INIT(trued_status);
        if (trued_client_status(client, &status) == TRUED_OK && status.mode == mode && status.recorder == recorder) {
            return 1;
        }
        nap();
    }
    return 0;
}

/* Changes the mode and the recording, and back. */
static void steer(trued_client *client, trued_monitor *monitor) {
    const uint64_t limit = 10 * SECOND;
    int done = steered(client, TRUED_MODE_FULL, TRUED_RECORDER_STATE_RECORDING);
    must("mode", trued_client_mode(client, TRUED_MODE_LIMITED, limit, NULL));
    done &= steered(client, TRUED_MODE_LIMITED, TRUED_RECORDER_STATE_RECORDING);
    must("mode", trued_monitor_mode(monitor, TRUED_MODE_SHADOW, limit, NULL));
    must("mark", trued_client_mark(client, "part 7", limit, NULL));
    must("mark", trued_monitor_mark(monitor, "part 8", limit, NULL));
    must("keep", trued_client_record(client, TRUED_RECORDER_ACTION_KEEP, limit, NULL));
    must("stop", trued_monitor_record(monitor, TRUED_RECORDER_ACTION_STOP, limit, NULL));
    done &= steered(client, TRUED_MODE_SHADOW, TRUED_RECORDER_STATE_STOPPED);
    trued_code unrecorded = trued_monitor_mark(monitor, "part 9", limit, NULL);
    must("start", trued_client_record(client, TRUED_RECORDER_ACTION_START, limit, NULL));
    must("arm", trued_monitor_arm(monitor, 1, limit, NULL));
    done &= steered(client, TRUED_MODE_FULL, TRUED_RECORDER_STATE_RECORDING);
    trued_code unknown = trued_client_mode(client, 7, limit, NULL);
    printf("steered %d\nmark_refused %d\n", done && unknown == TRUED_ERROR_ARGUMENT, unrecorded == TRUED_ERROR_REFUSED);
}

/* Sends measured points of the tool. The cell has no [measured]: they are taken, and nothing is trimmed. */
static void measure(const char *cell, trued_client *client) {
    const double point_m[3] = {1.0, 0.5, 0.25};
    trued_instrument *instrument;
    must("connect", trued_instrument_connect(cell, NULL, 10 * SECOND, &instrument));
    must("point", trued_instrument_send(instrument, point_m, 0));
    must("point", trued_instrument_send(instrument, point_m, trued_monotonic_ns()));
    uint64_t lost = 7;
    must("lost", trued_instrument_lost(instrument, &lost));
    trued_connection connection = TRUED_INIT(trued_connection);
    must("connection", trued_instrument_connection(instrument, &connection));
    if (trued_instrument_next_event(instrument, &connection) < 0 || !connection.is_connected) {
        exit(1);
    }
    trued_status status = TRUED_INIT(trued_status);
    must("status", trued_client_status(client, &status));
    printf("points_sent 2\npoints_lost %llu\n", (unsigned long long)lost);
    printf("trim_state %u\ntrim_points %llu\n", status.trim_state, (unsigned long long)status.trim_measurements);
    must("close", trued_instrument_close(instrument));
}

/* Asks for everything that may be asked for. */
static void ask(trued_client *client, trued_monitor *monitor) {
    trued_status before = TRUED_INIT(trued_status);
    must("status", trued_client_status(client, &before));
    must("ping", trued_client_ping(client, 10 * SECOND, NULL));
    must("bypass", trued_client_bypass(client, 1, 10 * SECOND, NULL));
    int bypassed = comes_to(client, 0, 1);
    must("bypass", trued_monitor_bypass(monitor, 0, 10 * SECOND, NULL));
    bypassed &= comes_to(client, 0, 0);
    trued_answer answer = TRUED_INIT(trued_answer);
    must("reload", trued_client_reload(client, NULL, 10 * SECOND, &answer));
    trued_code refused = trued_monitor_reload(monitor, "/nowhere/model.toml", 10 * SECOND, &answer);
    trued_process process = TRUED_INIT(trued_process);
    process.spindle_rpm = 12000.0;
    process.feed_mm_s = NAN;
    process.teeth = 2;
    must("process state", trued_client_process_state(client, &process, 10 * SECOND, NULL));
    trued_robot_state state = TRUED_INIT(trued_robot_state);
    state.joints = JOINTS;
    state.flags = TRUED_STATE_HAS_Q;
    state.t_ns = trued_monotonic_ns();
    must("state", trued_client_send_state(client, &state));
    /* The setpoints after the next command: more than are sent. */
    double ahead[TRUED_HORIZON_POINTS_MAX + 2][JOINTS];
    uint32_t horizon = 0;
    for (unsigned k = 0; k < TRUED_HORIZON_POINTS_MAX + 2; k++) target_of(k + 1, ahead[k]);
    must("horizon", trued_client_set_horizon(client, ahead[0], JOINTS, TRUED_HORIZON_POINTS_MAX + 2, &horizon));
    printf("joints %u\nmode %u\nbypassed %d\n", before.joints, before.mode, bypassed);
    printf("reload_refused %d\n", refused == TRUED_ERROR_REFUSED);
    printf("horizon %" PRIu32 "\n", horizon);
}

int main(int argc, char **argv) {
    const char *cell = argc > 1 ? argv[1] : "cell-1";
    unsigned targets = argc > 2 ? (unsigned)atoi(argv[2]) : 10000;
    trued_client *client;
    trued_monitor *monitor;
    trued_force *force;
    must("connect", trued_client_connect(cell, NULL, 10 * SECOND, &client));
    must("connect", trued_monitor_connect(cell, NULL, 10 * SECOND, &monitor));
    must("connect", trued_force_connect(cell, NULL, 10 * SECOND, &force));
    correct(client, targets);
    listen(force, monitor);
    ask(client, monitor);
    steer(client, monitor);
    measure(cell, client);
    must("close", trued_force_close(force));
    must("close", trued_monitor_close(monitor));
    must("close", trued_client_close(client));
    return 0;
}
