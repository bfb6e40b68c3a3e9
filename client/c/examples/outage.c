/* What a loop is told when the daemon goes, comes back, is another one, or may not be joined; and that it goes on.
 *
 *   cc outage.c $(pkg-config --cflags --libs trued_client) && ./a.out CELL [SECONDS]
 */
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include <trued.h>

int main(int argc, char **argv) {
    const char *cell = argc > 1 ? argv[1] : "cell-1";
    uint64_t end_ns = trued_monotonic_ns() + (uint64_t)(argc > 2 ? atoi(argv[2]) : 60) * 1000000000u;
    const double q_cmd[6] = {0.0, -0.5, 0.7, 0.0, 0.4, 0.0};
    trued_client *client = NULL;
    trued_code said = TRUED_NOTHING;
    while (trued_monotonic_ns() < end_ns) {
        trued_code told;
        if (client == NULL) {
            told = trued_client_connect(cell, NULL, 200000000, &client);
            if (told == TRUED_OK) continue;
        } else {
            told = trued_client_send_joints(client, q_cmd, 6, NULL);
            /* Whatever is said: there is always something to publish. */
            trued_target publish = TRUED_INIT(trued_target);
            trued_client_target(client, q_cmd, 6, trued_monotonic_ns(), &publish);
        }
        if (told != said) {
            printf("%s: %s\n", trued_code_name(told), told == TRUED_OK ? "" : trued_last_error());
            fflush(stdout);
            said = told;
        }
        nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL);
    }
    trued_client_close(client);
    return 0;
}
