/* The events of a running gestured, from its Unix socket: connects, subscribes, and connects again.
 *
 * For programs in C99 and C++11 on Linux. Nothing is allocated: a reader holds its longest line.
 *
 *     static struct gestured_events events;
 *     struct gestured_event event;
 *     gestured_open(&events, "/run/gestured/events.sock", "{\"types\":[\"gesture\",\"unknown\"]}");
 *     while (gestured_next(&events, &event, -1) == GESTURED_EVENT)
 *         if (!strcmp(event.type, "gesture")) puts(event.gesture);
 *     fputs(events.error, stderr);
 *
 * What an event says beyond the fields of its struct is found by gestured_text, gestured_number and gestured_true in
 * event.json, its whole line, which docs/wire.md of gestured describes. They know the outermost object alone: for `where`
 * or `scores` use a JSON library.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef GESTURED_EVENTS_H
#define GESTURED_EVENTS_H

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

#ifndef CLOCK_MONOTONIC
#error "define _POSIX_C_SOURCE as 200809L before the first #include, or use a dialect such as -std=gnu11"
#endif

#ifdef __cplusplus
extern "C" {
#endif

#ifndef GESTURED_LINE
#define GESTURED_LINE 65536 /* bytes of a line; a longer one is passed over */
#endif
#define GESTURED_GREETING_MS 10000 /* for the daemon's first line, which it sends at once */
#define GESTURED_FIRST_MS 100      /* between attempts to connect, doubled each time up to the longest */
#define GESTURED_LONGEST_MS 2000

enum gestured_result {
    GESTURED_REFUSED = -1, /* waiting does not help: `error` of the reader says why */
    GESTURED_TIMEOUT = 0,
    GESTURED_EVENT = 1
};

/* One event. A text is empty, and a number 0, where the event has none. Times are seconds since 1970. */
struct gestured_event {
    const char *json;                 /* the whole line, until the reader is called again */
    char type[16];                    /* gesture, unknown, cancelled, onset, release, provisional, status, lost, ... */
    char sensor[65];
    char gesture[65];
    double confidence;                /* 0 to 1 */
    int64_t id;                       /* numbers the sensor's contacts */
    int64_t sequence;                 /* numbers its gestures from 1, anew when `instance` of the reader changes */
    double onset, offset, decided;
};

/* A connection to a daemon, and the pause before the next one. */
struct gestured_events {
    const char *path, *subscribe; /* as given to gestured_open: they are not copied */
    int fd;                       /* -1 where nobody is there; may be polled beside other descriptors */
    char instance[65];            /* changes at each start of the daemon; empty before its first line */
    char error[256];              /* why nobody is there, or why it was refused */
    unsigned long passed;         /* lines that were no events, or too long */
    int refused, greeted, cut;    /* cut: the rest of a line that is too long is still to come */
    int64_t due;                  /* ms: when to connect, or by when the first line must have come */
    int64_t pause;                /* ms */
    size_t begin, end;            /* what of the buffer is not read yet */
    char buffer[GESTURED_LINE + 1];
};

/* --- JSON: the values of the outermost object of a line --- */

static inline const char *gestured_past_spaces(const char *at) {
    while (*at == ' ' || *at == '\t' || *at == '\r') ++at;
    return at;
}

/* Behind the string that begins at `at`, with its quotation mark. */
static inline const char *gestured_past_string(const char *at) {
    for (++at; *at && *at != '"'; ++at)
        if (*at == '\\' && at[1]) ++at;
    return *at ? at + 1 : at;
}

static inline const char *gestured_past_value(const char *at) {
    int depth = 0;
    for (; *at; ++at) {
        if (*at == '"') at = gestured_past_string(at) - 1;
        else if (*at == '{' || *at == '[') ++depth;
        else if ((*at == '}' || *at == ']') && depth) --depth;
        else if (!depth && (*at == ',' || *at == '}')) break;
    }
    return at;
}

/* Where the value of a key begins; NULL where there is none. */
static inline const char *gestured_find(const char *json, const char *key) {
    const size_t length = strlen(key);
    const char *at = gestured_past_spaces(json);
    if (*at != '{') return NULL;
    do {
        const char *name = gestured_past_spaces(at + 1);
        if (*name != '"') return NULL;
        at = gestured_past_string(name);
        const int here = (size_t)(at - name) == length + 2 && !strncmp(name + 1, key, length);
        at = gestured_past_spaces(at);
        if (*at != ':') return NULL;
        at = gestured_past_spaces(at + 1);
        if (here) return at;
        at = gestured_past_value(at);
    } while (*at == ',');
    return NULL;
}

static inline long gestured_hex(const char *digits) {
    long value = 0;
    for (int n = 0; n < 4; ++n) {
        const char c = digits[n];
        const int digit = c >= '0' && c <= '9' ? c - '0' : c >= 'a' && c <= 'f' ? c - 'a' + 10 :
                          c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
        if (digit < 0) return -1;
        value = value * 16 + digit;
    }
    return value;
}

/* The text of a key, as UTF-8 and cut to `room` bytes with the zero at its end. Gives 1; 0, and an empty text, where the
 * key has no text. */
static inline int gestured_text(const char *json, const char *key, char *out, size_t room) {
    const char *at = gestured_find(json, key);
    const char *const last = out + room - 1;
    *out = 0;
    if (!at || *at != '"') return 0;
    for (++at; *at && *at != '"' && out < last; ++at) {
        static const char from[] = "nrtbf", to[] = "\n\r\t\b\f";
        long code = 0;
        if (*at != '\\') {
            *out++ = *at;
            continue;
        }
        if (!*++at) break;
        if (*at != 'u') {
            const char *found = strchr(from, *at);
            *out++ = found ? to[found - from] : *at;
            continue;
        }
        if ((code = gestured_hex(at + 1)) < 0) break;
        at += 4;
        if (code >= 0xD800 && code < 0xDC00 && at[1] == '\\' && at[2] == 'u') {
            const long low = gestured_hex(at + 3);
            if (low >= 0xDC00 && low < 0xE000) code = 0x10000 + ((code - 0xD800) << 10) + (low - 0xDC00), at += 6;
        }
        const int more = code < 0x80 ? 0 : code < 0x800 ? 1 : code < 0x10000 ? 2 : 3;
        if (last - out <= more) break; /* no half of a character */
        static const int marks[] = {0, 0xC0, 0xE0, 0xF0};
        *out++ = (char)(marks[more] | (int)(code >> 6 * more));
        for (int n = more; n-- > 0;) *out++ = (char)(0x80 | (int)(code >> 6 * n & 0x3F));
    }
    *out = 0;
    return 1;
}

/* The number of a key, whatever the locale's decimal point. Gives 1; 0, and the number stays, where it has none. */
static inline int gestured_number(const char *json, const char *key, double *number) {
    const char *at = gestured_find(json, key);
    uint64_t digits = 0; /* as many as it holds; a double holds fewer */
    int exponent = 0, any = 0, given = 0, sign = 1;
    if (!at) return 0;
    const int negative = *at == '-';
    if (negative) ++at;
    for (int behind = 0; (*at >= '0' && *at <= '9') || (*at == '.' && !behind); ++at) {
        if (*at == '.') behind = 1;
        else if (digits < UINT64_MAX / 10 - 1) digits = digits * 10 + (uint64_t)(*at - '0'), exponent -= behind, any = 1;
        else exponent += !behind;
    }
    if (!any) return 0;
    if (*at == 'e' || *at == 'E') {
        if (*++at == '-' || *at == '+') sign = *at++ == '-' ? -1 : 1;
        for (; *at >= '0' && *at <= '9'; ++at) given = given < 1000 ? given * 10 + (*at - '0') : given;
    }
    exponent += sign * given;
    double value = (double)digits, power = 1;
    for (; exponent > 0; --exponent) value *= 10;
    for (; exponent < 0; ++exponent)
        if (power < 1e300) power *= 10;
        else value /= 10;
    *number = (negative ? -value : value) / power;
    return 1;
}

/* The whole number of a key; 0 where it has none, or one that not even a double holds exactly. */
static inline int64_t gestured_whole(const char *json, const char *key) {
    double number = 0;
    gestured_number(json, key, &number);
    return number > -9007199254740993.0 && number < 9007199254740993.0 ? (int64_t)number : 0;
}

/* Whether a key is true, as `own`, `degraded` and `test` may be. */
static inline int gestured_true(const char *json, const char *key) {
    const char *at = gestured_find(json, key);
    return at && !strncmp(at, "true", 4);
}

/* --- the connection --- */

static inline int64_t gestured_now_ms(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

/* Hear the daemon at `path`. `subscribe` is the JSON of docs/wire.md that says what it is to send, as in
 * "{\"types\":[\"gesture\"],\"sensors\":[\"armrest\"]}"; NULL is all gestures. It connects with the first gestured_next. */
static inline void gestured_open(struct gestured_events *events, const char *path, const char *subscribe) {
    memset(events, 0, offsetof(struct gestured_events, buffer));
    events->path = path;
    events->subscribe = subscribe;
    events->fd = -1;
    events->pause = GESTURED_FIRST_MS;
}

/* Hang up. */
static inline void gestured_close(struct gestured_events *events) {
    if (events->fd >= 0) close(events->fd);
    events->fd = -1;
    events->greeted = events->cut = 0;
    events->begin = events->end = 0;
}

/* Hang up, since waiting does not help. */
static inline enum gestured_result gestured_refuse(struct gestured_events *events, const char *why) {
    gestured_close(events);
    events->refused = 1;
    snprintf(events->error, sizeof events->error, "%.100s: %.150s", events->path, why);
    return GESTURED_REFUSED;
}

/* Nobody is there, or not any more: try again in a while. */
static inline void gestured_gone(struct gestured_events *events, const char *why) {
    gestured_close(events);
    snprintf(events->error, sizeof events->error, "%.100s: %.150s", events->path, why);
    events->due = gestured_now_ms() + events->pause;
    events->pause = events->pause * 2 < GESTURED_LONGEST_MS ? events->pause * 2 : GESTURED_LONGEST_MS;
}

static inline void gestured_call(struct gestured_events *events) {
    union {
        struct sockaddr any;
        struct sockaddr_un local;
    } address;
    int size = 0;
    memset(&address, 0, sizeof address);
    address.local.sun_family = AF_UNIX;
    if (strlen(events->path) >= sizeof address.local.sun_path) {
        gestured_refuse(events, "the path is too long for a socket");
        return;
    }
    strcpy(address.local.sun_path, events->path);
    if (events->subscribe) size = snprintf(events->buffer, GESTURED_LINE, "{\"subscribe\":%s}\n", events->subscribe);
    if (size < 0 || size >= GESTURED_LINE) {
        gestured_refuse(events, "the subscription is too long");
        return;
    }
    events->fd = socket(AF_UNIX, SOCK_STREAM, 0);
    if (events->fd < 0 || fcntl(events->fd, F_SETFD, FD_CLOEXEC) || fcntl(events->fd, F_SETFL, O_NONBLOCK) ||
        connect(events->fd, &address.any, sizeof address.local) ||
        (size && send(events->fd, events->buffer, (size_t)size, MSG_NOSIGNAL) != size)) {
        if (errno == EACCES) gestured_refuse(events, "it is for members of its group");
        else gestured_gone(events, strerror(errno));
        return;
    }
    events->due = gestured_now_ms() + GESTURED_GREETING_MS;
}

/* The next whole line; NULL where none has come yet. */
static inline const char *gestured_whole_line(struct gestured_events *events) {
    for (;;) {
        char *line = events->buffer + events->begin;
        char *newline = (char *)memchr(line, '\n', events->end - events->begin);
        if (!newline) break;
        *newline = 0;
        events->begin = (size_t)(newline + 1 - events->buffer);
        if (!events->cut) return line;
        events->cut = 0; /* this was the rest of a line that is too long */
    }
    if (events->cut) events->begin = events->end = 0;
    memmove(events->buffer, events->buffer + events->begin, events->end - events->begin);
    events->end -= events->begin;
    events->begin = 0;
    if (events->end < GESTURED_LINE) return NULL;
    events->cut = 1; /* what came of it is enough for a hello, and otherwise passed over */
    events->begin = events->end;
    events->buffer[events->end] = 0;
    return events->buffer;
}

/* What a line says: an event, nothing for the caller (GESTURED_TIMEOUT), or a refusal. */
static inline enum gestured_result gestured_read(struct gestured_events *events, const char *line,
                                                 struct gestured_event *event) {
    char reason[151];
    memset(event, 0, sizeof *event);
    event->json = line;
    gestured_text(line, "type", event->type, sizeof event->type);
    if (!strcmp(event->type, "error")) {
        gestured_text(line, "reason", reason, sizeof reason);
        if (events->greeted) return gestured_refuse(events, reason);
        gestured_gone(events, reason); /* it has no place for us now */
        return GESTURED_TIMEOUT;
    }
    if (!events->greeted) {
        if (strcmp(event->type, "hello") || gestured_whole(line, "protocol") != 1)
            return gestured_refuse(events, "it does not speak protocol 1 of gestured");
        gestured_text(line, "instance", events->instance, sizeof events->instance);
        events->greeted = 1;
        events->pause = GESTURED_FIRST_MS;
        events->error[0] = 0;
        return GESTURED_TIMEOUT;
    }
    if (events->cut || !event->type[0]) {
        ++events->passed;
        return GESTURED_TIMEOUT;
    }
    gestured_text(line, "sensor", event->sensor, sizeof event->sensor);
    gestured_text(line, "gesture", event->gesture, sizeof event->gesture);
    gestured_number(line, "confidence", &event->confidence);
    gestured_number(line, "onset", &event->onset);
    gestured_number(line, "offset", &event->offset);
    gestured_number(line, "decided", &event->decided);
    event->id = gestured_whole(line, "id");
    event->sequence = gestured_whole(line, "sequence");
    return GESTURED_EVENT;
}

static inline void gestured_receive(struct gestured_events *events) {
    const ssize_t got = recv(events->fd, events->buffer + events->end, GESTURED_LINE - events->end, 0);
    if (got > 0) events->end += (size_t)got;
    else if (!got) gestured_gone(events, "the daemon closed the connection");
    else if (errno != EAGAIN && errno != EINTR) gestured_gone(events, strerror(errno));
}

/* The next event, within `timeout_ms`; -1 waits for ever, 0 looks whether one is there. It connects, and connects again,
 * by itself. No signal ends the wait: where a handler sets a flag, give a timeout, and look at the flag after it. */
static inline enum gestured_result gestured_next(struct gestured_events *events, struct gestured_event *event,
                                                 int timeout_ms) {
    const int64_t end = timeout_ms < 0 ? INT64_MAX : gestured_now_ms() + timeout_ms;
    for (int last = 0;;) {
        const char *line;
        while (!events->refused && (line = gestured_whole_line(events))) {
            const enum gestured_result found = gestured_read(events, line, event);
            if (found != GESTURED_TIMEOUT) return found;
        }
        if (events->refused) return GESTURED_REFUSED;
        if (last) return GESTURED_TIMEOUT;
        int64_t now = gestured_now_ms();
        if (now >= events->due && events->fd >= 0 && !events->greeted)
            gestured_gone(events, "it says nothing: it hangs, or this is not its event socket");
        else if (now >= events->due && events->fd < 0)
            gestured_call(events);
        if (events->refused) continue;
        const int64_t until = events->greeted || end < events->due ? end : events->due;
        const int64_t wait = until > now ? until - now : 0;
        struct pollfd looked;
        looked.fd = events->fd; /* a negative one is passed over */
        looked.events = POLLIN;
        looked.revents = 0;
        if (poll(&looked, 1, until == INT64_MAX ? -1 : wait < 60000 ? (int)wait : 60000) > 0) gestured_receive(events);
        last = gestured_now_ms() >= end;
    }
}

#ifdef __cplusplus
}
#endif
#endif
