/* Prints what gestured_events.h says, for tests/deploy/test_c.py: events PATH SUBSCRIPTION [TIMEOUT_MS] */
#include "gestured_events.h"

#include <stdlib.h>

int main(int argc, char **argv) {
    static struct gestured_events events;
    struct gestured_event event;
    enum gestured_result found;
    gestured_open(&events, argc > 1 ? argv[1] : "", argc > 2 && *argv[2] ? argv[2] : NULL);
    while ((found = gestured_next(&events, &event, argc > 3 ? atoi(argv[3]) : -1)) != GESTURED_REFUSED) {
        if (found == GESTURED_TIMEOUT) printf("nothing yet: %s\n", events.error);
        else
            printf("%s|%s|%s|%.17g|%lld|%lld|%.17g|%.17g|%.17g|%s|%d|%lu\n", event.type, event.sensor, event.gesture,
                   event.confidence, (long long)event.id, (long long)event.sequence, event.onset, event.offset,
                   event.decided, events.instance, gestured_true(event.json, "test"), events.passed);
        fflush(stdout);
    }
    printf("refused: %s\n", events.error);
    gestured_close(&events);
    return 1;
}

/* The parser alone, for a library. */
int text(const char *json, char *out, size_t room);
int number(const char *json, double *out);
int text(const char *json, char *out, size_t room) { return gestured_text(json, "key", out, room); }
int number(const char *json, double *out) { return gestured_number(json, "key", out); }
