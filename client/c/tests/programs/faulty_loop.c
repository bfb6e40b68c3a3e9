/* A robot's loop with random faults: what it commands and would send to the robot is written to a file, one record per cycle,
 * for the test that judges it.
 *
 *   faulty_loop CELL FILE CYCLES CALM SEED: CYCLES cycles with random faults, then CALM cycles without.
 */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <trued.h>

enum { JOINTS = 6 };

typedef struct {
    uint64_t now_ns, stamp_ns;
    uint32_t mode, source;
    double angle, rate, jerk;
    double command[JOINTS], sent[JOINTS];
} record;

_Static_assert(sizeof(record) == 144, "as tests/src/loop_records.rs reads it");

static uint64_t state;

static uint64_t below(uint64_t n) {
    state ^= state >> 12;
    state ^= state << 25;
    state ^= state >> 27;
    return (state * 2685821657736338717u >> 16) % n;
}

static void wait_ns(uint64_t ns) {
    nanosleep(&(struct timespec){.tv_sec = (time_t)(ns / 1000000000u), .tv_nsec = (long)(ns % 1000000000u)}, NULL);
}

static void path(double t_s, double q[JOINTS]) {
    const double middle[JOINTS] = {0.2, 0.3, -0.2, 0.3, 0.8, 0.1};
    for (int i = 0; i < JOINTS; i++) q[i] = middle[i] + 0.05 * sin(6.283185307179586 * (t_s / 5.0 + 0.1 * i));
}

static void fail(const char *words) {
    fprintf(stderr, "%s: %s\n", words, trued_last_error());
    exit(1);
}

/* A NaN or infinite command has to return an error and change nothing. */
static void no_number(trued_client *client, const double *before) {
    double q[JOINTS];
    path(0.0, q);
    q[below(JOINTS)] = (double[]){NAN, INFINITY, -INFINITY}[below(3)];
    trued_target target = TRUED_INIT(trued_target);
    if (trued_client_send_joints(client, q, JOINTS, NULL) == TRUED_OK) fail("no number was sent");
    if (trued_client_target(client, q, JOINTS, trued_monotonic_ns(), &target) >= 0) fail("no number was answered");
    trued_target last = TRUED_INIT(trued_target);
    if (before == NULL) return;
    if (trued_client_last_target(client, &last) < 0) fail("nothing was sent last");
    if (memcmp(last.q, before, JOINTS * sizeof(double)) != 0) fail("what was sent last has changed");
}

int main(int argc, char **argv) {
    if (argc != 6) return 2;
    uint64_t faulty = strtoull(argv[3], NULL, 10), cycles = faulty + strtoull(argv[4], NULL, 10);
    state = strtoull(argv[5], NULL, 10) * 2 + 1;
    FILE *file = fopen(argv[2], "wb");
    trued_client *client = NULL;
    if (file == NULL || trued_client_connect(argv[1], NULL, 10000000000u, &client) < 0) fail("cannot begin");
    uint64_t due_ns = trued_monotonic_ns(), outside = 0;
    int64_t clock_ns = 0;
    double phase_s = 0.0;
    int joint = 0, is_begun = 0;
    record now = {0};
    for (uint64_t cycle = 0; cycle < cycles; cycle++) {
        uint64_t fault = cycle < faulty ? below(10000) : 10000;
        if (cycle == faulty) clock_ns = 0, outside = 0;
        if (fault < 3) wait_ns(below(300000000));
        if (fault == 3) phase_s += 1e-3 * (double)below(2000);
        if (fault == 4) clock_ns = (int64_t[]){0, 300000000, 600000000, 2000000000, 3600000000000}[below(5)];
        if (fault == 5) trued_client_start_anew(client);
        if (fault >= 10 && fault < 14) no_number(client, is_begun ? now.sent : NULL);
        if (fault >= 14 && fault < 17) joint = (int)below(JOINTS), outside = 1 + below(1000);
        due_ns = due_ns + 1000000 > trued_monotonic_ns() ? due_ns + 1000000 : trued_monotonic_ns();
        for (uint64_t at_ns; (at_ns = trued_monotonic_ns()) < due_ns;) wait_ns(due_ns - at_ns);

        path(1e-9 * (double)trued_monotonic_ns() + phase_s, now.command);
        if (fault == 6) now.command[below(JOINTS)] += 1.0;
        if (outside > 0) now.command[joint] += 7.0, outside--;
        trued_setpoint setpoint = TRUED_INIT(trued_setpoint);
        setpoint.joints = JOINTS;
        setpoint.t_ns = (uint64_t)((int64_t)due_ns + clock_ns); /* of the cycle, as a cell's own clock would stamp it */
        memcpy(setpoint.q, now.command, sizeof now.command);
        uint64_t seq = 0;
        trued_code code = fault >= 20 && fault < 40 ? TRUED_NOTHING : trued_client_send(client, &setpoint, &seq);
        if (code == TRUED_OK || code == TRUED_ERROR_MESSAGE_LOST) now.stamp_ns = setpoint.t_ns;
        trued_corrected corrected = TRUED_INIT(trued_corrected);
        if (code == TRUED_OK) trued_client_wait_corrected(client, seq, 500000, &corrected);
        trued_target target = TRUED_INIT(trued_target);
        now.now_ns = trued_monotonic_ns();
        if (trued_client_target(client, now.command, JOINTS, now.now_ns, &target) < 0) fail("no target");
        trued_status status = TRUED_INIT(trued_status);
        if (trued_client_status(client, &status) == TRUED_OK) {
            now.mode = status.mode;
            now.angle = status.correction_max[0];
            now.rate = status.correction_rate_max[0];
            now.jerk = status.correction_jerk_max[0];
        }
        now.source = target.source;
        memcpy(now.sent, target.q, sizeof now.sent);
        is_begun = 1;
        if (fwrite(&now, sizeof now, 1, file) != 1) fail("cannot write");
    }
    trued_client_close(client);
    return fclose(file);
}
