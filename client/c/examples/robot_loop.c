/* The robot's side of a cell in ten lines: what an integrator adds to a loop of his own.
 *
 *   cc robot_loop.c $(pkg-config --cflags --libs trued_client) && ./a.out CELL [CYCLES]
 */
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include <trued.h>

/* Stands for the cell's own path: joint 1 goes slowly to and fro. */
static void next_target(unsigned cycle, double q[6]) {
    const double rest[6] = {0.0, -0.5, 0.7, 0.0, 0.4, 0.0};
    for (int i = 0; i < 6; i++) q[i] = rest[i];
    unsigned step = cycle % 2000;
    q[0] = 0.0001 * (step < 1000 ? step : 2000 - step);
}

/* Stands for the robot's own interface. */
static void publish_to_robot(const double *q, unsigned joints) {
    (void)q;
    (void)joints;
}

static void wait_for_next_cycle(void) {
    nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL);
}

int main(int argc, char **argv) {
    const char *cell = argc > 1 ? argv[1] : "cell-1";
    unsigned cycles = argc > 2 ? (unsigned)atoi(argv[2]) : 10000;

    trued_client *trued;
    if (trued_client_connect(cell, NULL, 2000000000, &trued) < 0) {
        fprintf(stderr, "%s\n", trued_last_error());
        return 1;
    }
    for (unsigned cycle = 0; cycle < cycles; cycle++) {
        double q_cmd[6];
        next_target(cycle, q_cmd); /* rad */
        trued_client_send_joints(trued, q_cmd, 6, NULL); /* can fail without a daemon; the next line still works */
        trued_target target = TRUED_INIT(trued_target);
        trued_client_target(trued, q_cmd, 6, trued_monotonic_ns(), &target);
        publish_to_robot(target.q, target.joints);
        wait_for_next_cycle();
    }
    trued_client_close(trued);
    return 0;
}
