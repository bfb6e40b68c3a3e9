/* Everything that a C program may get wrong, against a running daemon: each is the right error, and nothing breaks.
 * Ends with 0 where all of it holds; else says what does not. */
#include <math.h>
#include <pthread.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <trued.h>

static int faults = 0;

#define IS(expected, call) is(expected, call, #call, __LINE__)
static void is(trued_code expected, trued_code got, const char *call, int line) {
    if (got != expected) {
        faults++;
        fprintf(stderr, "%d: %s: %s, expected %s (%s)\n", line, call, trued_code_name(got), trued_code_name(expected),
                trued_last_error());
    } else if (got < 0 && strlen(trued_last_error()) < 20) {
        faults++;
        fprintf(stderr, "%d: %s: no words\n", line, call);
    }
}

static const uint64_t SECOND = 1000000000;
static const double Q[TRUED_JOINTS_MAX + 1] = {0.2, 0.3, -0.2, 0.3, 0.8, 0.1};

/* Nothing where something has to be. */
static void null_pointers(const char *cell, trued_client *client, trued_force *force, trued_monitor *monitor) {
    trued_client *other;
    trued_target target = TRUED_INIT(trued_target);
    IS(TRUED_ERROR_NULL, trued_client_connect(cell, NULL, SECOND, NULL));
    IS(TRUED_ERROR_NULL, trued_client_connect(NULL, NULL, SECOND, &other));
    IS(TRUED_ERROR_NULL, trued_client_send(client, NULL, NULL));
    IS(TRUED_ERROR_NULL, trued_client_send_joints(client, NULL, 6, NULL));
    IS(TRUED_ERROR_NULL, trued_client_send_state(client, NULL));
    IS(TRUED_ERROR_NULL, trued_client_set_horizon(client, NULL, 6, 1, NULL));
    IS(TRUED_OK, trued_client_set_horizon(client, NULL, 6, 0, NULL));
    IS(TRUED_ERROR_NULL, trued_client_target(client, NULL, 6, 0, &target));
    IS(TRUED_ERROR_NULL, trued_client_target(client, Q, 6, 0, NULL));
    IS(TRUED_ERROR_NULL, trued_client_exchange(client, Q, 6, 0, NULL));
    IS(TRUED_ERROR_NULL, trued_client_newest(client, NULL));
    IS(TRUED_ERROR_NULL, trued_client_wait_corrected(client, 1, 0, NULL));
    IS(TRUED_ERROR_NULL, trued_client_status(client, NULL));
    IS(TRUED_ERROR_NULL, trued_client_vibration(client, NULL));
    IS(TRUED_ERROR_NULL, trued_client_connection(client, NULL));
    IS(TRUED_ERROR_NULL, trued_client_next_event(client, NULL));
    IS(TRUED_ERROR_NULL, trued_client_process_state(client, NULL, SECOND, NULL));
    IS(TRUED_ERROR_NULL, trued_client_measured(client, NULL, SECOND, NULL));
    IS(TRUED_ERROR_NULL, trued_monitor_status(monitor, NULL));
    IS(TRUED_ERROR_NULL, trued_force_send(force, NULL));
    IS(TRUED_ERROR_NULL, trued_force_lost(force, NULL));
    trued_force_samples block = TRUED_INIT(trued_force_samples);
    block.channels = 3;
    block.count = 1;
    IS(TRUED_ERROR_NULL, trued_force_send(force, &block));
    IS(TRUED_OK, trued_client_close(NULL));
    IS(TRUED_OK, trued_monitor_close(NULL));
    IS(TRUED_OK, trued_force_close(NULL));
    IS(TRUED_ERROR_CLOSED, trued_client_start_anew(NULL));
}

/* Sizes that no version of a struct has, and one of a version to come. */
static void sizes(trued_client *client) {
    trued_target target;
    memset(&target, 0, sizeof target);
    IS(TRUED_ERROR_STRUCT_SIZE, trued_client_target(client, Q, 6, 0, &target));
    target.struct_size = offsetof(trued_target, feed_override) - 1; /* less than the first version had */
    IS(TRUED_ERROR_STRUCT_SIZE, trued_client_target(client, Q, 6, 0, &target));
    target.struct_size = UINT32_MAX;
    IS(TRUED_ERROR_STRUCT_SIZE, trued_client_target(client, Q, 6, 0, &target));
    struct {
        trued_target target;
        double later[4];
    } newer;
    memset(&newer, 0xff, sizeof newer);
    newer.target.struct_size = sizeof newer;
    IS(TRUED_OK, trued_client_target(client, Q, 6, trued_monotonic_ns(), &newer.target));
    if (newer.target.struct_size != sizeof newer || newer.target.joints != 6 || newer.later[3] != 0.0) faults++;
    struct {
        trued_setpoint setpoint;
        double later;
    } asks;
    memset(&asks, 0, sizeof asks);
    asks.setpoint.struct_size = sizeof asks;
    asks.setpoint.joints = 6;
    IS(TRUED_OK, trued_client_send(client, &asks.setpoint, NULL));
    asks.later = 1.0;
    IS(TRUED_ERROR_STRUCT_SIZE, trued_client_send(client, &asks.setpoint, NULL));
}

/* Values that make no sense. */
static void values(const char *cell, trued_client *client, trued_force *force) {
    trued_client *other;
    trued_target target = TRUED_INIT(trued_target);
    IS(TRUED_ERROR_ARGUMENT, trued_client_connect("No Name", NULL, SECOND, &other));
    IS(TRUED_ERROR_ARGUMENT, trued_client_connect("\xff", NULL, SECOND, &other));
    IS(TRUED_ERROR_ARGUMENT, trued_client_connect(cell, "relative", SECOND, &other));
    IS(TRUED_ERROR_ARGUMENT, trued_client_connect(cell, NULL, UINT64_MAX, &other));
    IS(TRUED_ERROR_NO_DAEMON, trued_client_connect("nobody", NULL, SECOND / 100, &other));
    if (other != NULL) faults++;
    IS(TRUED_ERROR_ROLE_TAKEN, trued_client_connect(cell, NULL, SECOND / 10, &other));
    IS(TRUED_ERROR_ARGUMENT, trued_client_send_joints(client, Q, 0, NULL));
    IS(TRUED_ERROR_ARGUMENT, trued_client_send_joints(client, Q, 17, NULL));
    IS(TRUED_ERROR_ARGUMENT, trued_client_send_joints(client, Q, UINT32_MAX, NULL));
    IS(TRUED_ERROR_ARGUMENT, trued_client_target(client, Q, 17, 0, &target));
    IS(TRUED_ERROR_ARGUMENT, trued_client_exchange(client, Q, 6, UINT64_MAX, &target));
    IS(TRUED_ERROR_ARGUMENT, trued_client_set_fresh(client, UINT64_MAX));
    uint32_t sent = 7;
    double points[2][6] = {{0.2, 0.3, -0.2, 0.3, 0.8, 0.1}, {0.2, 0.3, -0.2, 0.3, 0.8, 0.1}};
    IS(TRUED_ERROR_ARGUMENT, trued_client_set_horizon(client, points[0], 0, 2, &sent));
    IS(TRUED_ERROR_ARGUMENT, trued_client_set_horizon(client, points[0], 17, 2, &sent));
    points[1][5] = NAN;
    IS(TRUED_ERROR_ARGUMENT, trued_client_set_horizon(client, points[0], 6, 2, &sent));
    if (sent != 7 || strstr(trued_last_error(), "joint 6 of point 2") == NULL) faults++;
    IS(TRUED_OK, trued_client_set_horizon(client, points[0], 6, 1, &sent));
    if (sent != 1) faults++;
    static double many[TRUED_HORIZON_POINTS_MAX][1];
    IS(TRUED_OK, trued_client_set_horizon(client, many[0], 1, UINT32_MAX, &sent));
    if (sent != TRUED_HORIZON_POINTS_MAX) faults++;
    trued_setpoint setpoint = TRUED_INIT(trued_setpoint);
    setpoint.joints = 6;
    setpoint.flags = 1u << 31;
    IS(TRUED_ERROR_ARGUMENT, trued_client_send(client, &setpoint, NULL));
    trued_process process = TRUED_INIT(trued_process);
    process.in_cut = 3;
    IS(TRUED_ERROR_ARGUMENT, trued_client_process_state(client, &process, SECOND, NULL));
    char path[300];
    memset(path, 'a', sizeof path);
    path[sizeof path - 1] = 0;
    IS(TRUED_ERROR_ARGUMENT, trued_client_reload(client, path, SECOND, NULL));
    IS(TRUED_ERROR_REFUSED, trued_client_reload(client, "/nowhere", 10 * SECOND, NULL));
    trued_corrected corrected = TRUED_INIT(trued_corrected);
    IS(TRUED_ERROR_TIMED_OUT, trued_client_wait_corrected(client, UINT64_MAX, SECOND / 100, &corrected));
    trued_force_samples block = TRUED_INIT(trued_force_samples);
    float one[3] = {0};
    block.channels = 2;
    block.count = 1;
    block.floats = one;
    block.doubles = Q;
    IS(TRUED_ERROR_ARGUMENT, trued_force_send(force, &block));
    block.channels = 3;
    IS(TRUED_ERROR_ARGUMENT, trued_force_send(force, &block));
    block.doubles = NULL;
    block.count = 513;
    IS(TRUED_ERROR_ARGUMENT, trued_force_send(force, &block));
    block.count = UINT32_MAX;
    block.channels = UINT32_MAX;
    IS(TRUED_ERROR_ARGUMENT, trued_force_send(force, &block));
}

struct other_thread {
    trued_client *client;
    trued_code during;
    trued_code closing;
};

static void *from_another_thread(void *argument) {
    struct other_thread *other = argument;
    uint64_t end = trued_monotonic_ns() + 10 * SECOND;
    trued_connection connection = TRUED_INIT(trued_connection);
    do {
        other->during = trued_client_connection(other->client, &connection);
    } while (other->during == TRUED_OK && trued_monotonic_ns() < end);
    other->closing = trued_client_close(other->client);
    return NULL;
}

/* Two threads with one handle: the second is told at once, and cannot close it either. */
static void threads(trued_client *client) {
    struct other_thread other = {client, TRUED_OK, TRUED_OK};
    pthread_t thread;
    if (pthread_create(&thread, NULL, from_another_thread, &other) != 0) exit(2);
    trued_corrected corrected = TRUED_INIT(trued_corrected);
    uint64_t start = trued_monotonic_ns();
    while (other.during == TRUED_OK && trued_monotonic_ns() < start + 10 * SECOND) {
        trued_code waited = trued_client_wait_corrected(client, UINT64_MAX, SECOND, &corrected);
        if (waited == TRUED_ERROR_TIMED_OUT) break;
        if (waited != TRUED_ERROR_BUSY) IS(TRUED_ERROR_TIMED_OUT, waited);
    }
    pthread_join(thread, NULL);
    IS(TRUED_ERROR_BUSY, other.during);
    IS(TRUED_ERROR_BUSY, other.closing);
    IS(TRUED_OK, trued_client_start_anew(client));
}

/* A handle after its end, twice closed, and numbers that never were one. */
static void after_close(const char *cell, trued_client *client, trued_monitor *monitor, trued_force *force) {
    trued_status status = TRUED_INIT(trued_status);
    IS(TRUED_OK, trued_client_close(client));
    IS(TRUED_ERROR_CLOSED, trued_client_close(client));
    IS(TRUED_ERROR_CLOSED, trued_client_send_joints(client, Q, 6, NULL));
    IS(TRUED_ERROR_CLOSED, trued_client_set_horizon(client, Q, 6, 1, NULL));
    IS(TRUED_ERROR_CLOSED, trued_client_status(client, &status));
    trued_client *next;
    IS(TRUED_OK, trued_client_connect(cell, NULL, 10 * SECOND, &next));
    IS(TRUED_ERROR_CLOSED, trued_client_status(client, &status));
    IS(TRUED_OK, trued_client_close(next));
    IS(TRUED_ERROR_CLOSED, trued_client_start_anew((trued_client *)monitor));
    IS(TRUED_ERROR_CLOSED, trued_client_start_anew((trued_client *)(uintptr_t)0xdeadbeef));
    IS(TRUED_OK, trued_monitor_close(monitor));
    IS(TRUED_ERROR_CLOSED, trued_monitor_status(monitor, &status));
    IS(TRUED_OK, trued_force_close(force));
    IS(TRUED_ERROR_CLOSED, trued_force_close(force));
}

int main(int argc, char **argv) {
    const char *cell = argc > 1 ? argv[1] : "cell-1";
    trued_client *client;
    trued_monitor *monitor;
    trued_force *force;
    if (trued_abi_version() >> 16 != TRUED_ABI_VERSION >> 16 || strstr(trued_version(), "contract") == NULL) faults++;
    if (strlen(trued_last_error()) != 0 || strcmp(trued_code_name(7), "TRUED_UNKNOWN") != 0) faults++;
    IS(TRUED_OK, trued_client_connect(cell, NULL, 10 * SECOND, &client));
    IS(TRUED_OK, trued_monitor_connect(cell, NULL, 10 * SECOND, &monitor));
    IS(TRUED_OK, trued_force_connect(cell, NULL, 10 * SECOND, &force));
    null_pointers(cell, client, force, monitor);
    sizes(client);
    values(cell, client, force);
    threads(client);
    after_close(cell, client, monitor, force);
    printf("faults %d\n", faults);
    return faults == 0 ? 0 : 1;
}
