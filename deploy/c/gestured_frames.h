/* Pressure frames for gestured: OSC messages, OSC framed by SLIP, and lines of numbers.
 *
 * For firmware and for programs, in C99 and C++11. Nothing is allocated and a frame is never copied: each byte goes to a
 * function of yours as soon as it is made, so that a controller with 2 KiB of memory can send 16 x 16 taxels.
 *
 *     static void put(void *to, uint8_t byte) { ... }        // to a serial port, say
 *
 *     uint16_t counts[81];                                   // row by row, the top row first; more pressure = larger
 *     struct gestured_frame frame = gestured_uint16("armrest", counts, 81);
 *     gestured_count(&frame, number++);                      // so that the daemon knows which frames were lost
 *     gestured_slip(&frame, put, 0);                         // gestured-bridge serial --protocol osc-slip
 *
 * Over UDP a frame is the OSC message alone, made in a buffer by gestured_packet.
 *
 * The message is /{sensor}/pressure with an optional counter, then the values: as many floats, or one blob of big-endian
 * uint16 or uint8. docs/wire.md of gestured has the format to the letter.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef GESTURED_FRAMES_H
#define GESTURED_FRAMES_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#ifdef __cplusplus
extern "C" {
#endif

#define GESTURED_MOST_TAXELS 4096 /* 64 x 64 */

enum gestured_kind { GESTURED_UINT8, GESTURED_UINT16, GESTURED_FLOATS };

/* One frame. It points to the values, which must stay as they are until it is written. */
struct gestured_frame {
    const char *sensor; /* 1 to 64 of A-Z a-z 0-9 _ - */
    const void *values;
    uint16_t taxels; /* rows times columns */
    enum gestured_kind kind;
    uint8_t counted;  /* whether the counter is sent */
    uint32_t counter; /* rises by one from frame to frame; it may overflow */
};

/* Where bytes go, one by one; `to` is handed on as it was given. */
typedef void (*gestured_put)(void *to, uint8_t byte);

static inline struct gestured_frame gestured_frame_of(const char *sensor, const void *values, uint16_t taxels,
                                                      enum gestured_kind kind) {
    struct gestured_frame frame;
    frame.sensor = sensor;
    frame.values = values;
    frame.taxels = taxels;
    frame.kind = kind;
    frame.counted = 0;
    frame.counter = 0;
    return frame;
}

static inline struct gestured_frame gestured_uint8(const char *sensor, const uint8_t *counts, uint16_t taxels) {
    return gestured_frame_of(sensor, counts, taxels, GESTURED_UINT8);
}

static inline struct gestured_frame gestured_uint16(const char *sensor, const uint16_t *counts, uint16_t taxels) {
    return gestured_frame_of(sensor, counts, taxels, GESTURED_UINT16);
}

static inline struct gestured_frame gestured_floats(const char *sensor, const float *values, uint16_t taxels) {
    return gestured_frame_of(sensor, values, taxels, GESTURED_FLOATS);
}

/* Send this number with the frame. */
static inline void gestured_count(struct gestured_frame *frame, uint32_t counter) {
    frame->counted = 1;
    frame->counter = counter;
}

/* The length of a sensor's name; 0 where the daemon would not take it. */
static inline size_t gestured_name_length(const char *sensor) {
    size_t length;
    if (!sensor) return 0;
    for (length = 0; sensor[length]; ++length) {
        const char c = sensor[length];
        const int letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
        if (length == 64 || !(letter || (c >= '0' && c <= '9') || c == '_' || c == '-')) return 0;
    }
    return length;
}

static inline size_t gestured_value_size(enum gestured_kind kind) {
    return kind == GESTURED_UINT8 ? 1 : kind == GESTURED_UINT16 ? 2 : 4;
}

/* An OSC string ends in one to four zero bytes, so that its size is a multiple of four. */
static inline size_t gestured_string_size(size_t length) { return (length / 4 + 1) * 4; }

/* How many bytes the frame's OSC message has; 0 where the name or the number of taxels cannot be. */
static inline size_t gestured_osc_size(const struct gestured_frame *frame) {
    const size_t name = gestured_name_length(frame->sensor);
    const size_t bytes = frame->taxels * gestured_value_size(frame->kind);
    const size_t tags = 1u + frame->counted + (frame->kind == GESTURED_FLOATS ? frame->taxels : 1u);
    if (!name || !frame->taxels || frame->taxels > GESTURED_MOST_TAXELS) return 0;
    return gestured_string_size(name + 10) + gestured_string_size(tags) + (frame->counted ? 4u : 0u) +
           (frame->kind == GESTURED_FLOATS ? bytes : 4 + (bytes + 3) / 4 * 4);
}

static inline void gestured_put_uint32(uint32_t number, gestured_put put, void *to) {
    put(to, (uint8_t)(number >> 24));
    put(to, (uint8_t)(number >> 16 & 255));
    put(to, (uint8_t)(number >> 8 & 255));
    put(to, (uint8_t)(number & 255));
}

static inline void gestured_put_text(const char *text, gestured_put put, void *to) {
    while (*text) put(to, (uint8_t)*text++);
}

static inline void gestured_put_zeros(size_t count, gestured_put put, void *to) {
    while (count--) put(to, 0);
}

static inline void gestured_put_value(const struct gestured_frame *frame, uint16_t taxel, gestured_put put, void *to) {
    if (frame->kind == GESTURED_FLOATS) {
        uint32_t bits; /* of an IEEE 754 binary32, which a float is wherever this compiles: see below */
        memcpy(&bits, (const float *)frame->values + taxel, sizeof bits);
        gestured_put_uint32(bits, put, to);
    } else if (frame->kind == GESTURED_UINT16) {
        const uint16_t count = ((const uint16_t *)frame->values)[taxel];
        put(to, (uint8_t)(count >> 8));
        put(to, (uint8_t)(count & 255));
    } else {
        put(to, ((const uint8_t *)frame->values)[taxel]);
    }
}

/* A compiler whose float is not four bytes long stops here. */
typedef char gestured_float_has_four_bytes[sizeof(float) == 4 ? 1 : -1];

/* Write the frame as one OSC message. Gives its size in bytes; 0, and nothing is written, where gestured_osc_size is 0. */
static inline size_t gestured_osc(const struct gestured_frame *frame, gestured_put put, void *to) {
    const size_t size = gestured_osc_size(frame);
    const size_t length = gestured_name_length(frame->sensor) + 10;
    const size_t bytes = frame->taxels * gestured_value_size(frame->kind);
    const size_t values = frame->kind == GESTURED_FLOATS ? frame->taxels : 1u;
    const size_t tags = 1u + frame->counted + values;
    if (!size) return 0;
    put(to, '/');
    gestured_put_text(frame->sensor, put, to);
    gestured_put_text("/pressure", put, to);
    gestured_put_zeros(gestured_string_size(length) - length, put, to);
    put(to, ',');
    if (frame->counted) put(to, 'i');
    for (size_t n = 0; n < values; ++n) put(to, frame->kind == GESTURED_FLOATS ? 'f' : 'b');
    gestured_put_zeros(gestured_string_size(tags) - tags, put, to);
    if (frame->counted) gestured_put_uint32(frame->counter, put, to);
    if (frame->kind != GESTURED_FLOATS) gestured_put_uint32((uint32_t)bytes, put, to);
    for (uint16_t taxel = 0; taxel < frame->taxels; ++taxel) gestured_put_value(frame, taxel, put, to);
    gestured_put_zeros((4 - bytes % 4) % 4, put, to);
    return size;
}

static inline void gestured_put_buffer(void *to, uint8_t byte) {
    uint8_t **next = (uint8_t **)to;
    *(*next)++ = byte;
}

/* The frame's OSC message in a buffer of `room` bytes, for a UDP packet. Gives its size; 0 where it cannot be or has no
 * room. 9 x 9 taxels and a short name: 196 bytes as counted uint16, 432 as counted floats. */
static inline size_t gestured_packet(const struct gestured_frame *frame, uint8_t *out, size_t room) {
    return gestured_osc_size(frame) <= room ? gestured_osc(frame, gestured_put_buffer, &out) : 0;
}

struct gestured_escaper {
    gestured_put put;
    void *to;
};

/* RFC 1055: END and ESC are replaced inside a packet. */
static inline void gestured_put_escaped(void *to, uint8_t byte) {
    const struct gestured_escaper *escaper = (const struct gestured_escaper *)to;
    if (byte == 0xC0 || byte == 0xDB) {
        escaper->put(escaper->to, 0xDB);
        byte = byte == 0xC0 ? 0xDC : 0xDD;
    }
    escaper->put(escaper->to, byte);
}

/* Write the frame's OSC message framed by SLIP, for a serial line: gestured-bridge serial --protocol osc-slip. Gives the
 * message's size; 0, and nothing is written, where the frame cannot be. */
static inline size_t gestured_slip(const struct gestured_frame *frame, gestured_put put, void *to) {
    struct gestured_escaper escaper;
    size_t size;
    escaper.put = put;
    escaper.to = to;
    if (!gestured_osc_size(frame)) return 0;
    put(to, 0xC0); /* ends whatever noise came before */
    size = gestured_osc(frame, gestured_put_escaped, &escaper);
    put(to, 0xC0);
    return size;
}

static inline void gestured_put_decimal(uint32_t number, gestured_put put, void *to) {
    char digits[11];
    char *at = digits + sizeof digits - 1;
    *at = 0;
    do {
        *--at = (char)('0' + number % 10);
        number /= 10;
    } while (number);
    gestured_put_text(at, put, to);
}

/* Write the frame as a line of numbers that a person can read, the counter first: gestured-bridge serial --protocol csv.
 * Gives 1; 0, and nothing is written, where the frame cannot be, or holds floats: a controller would need a library for
 * their digits. */
static inline int gestured_line(const struct gestured_frame *frame, gestured_put put, void *to) {
    if (!gestured_osc_size(frame) || frame->kind == GESTURED_FLOATS) return 0;
    if (frame->counted) {
        gestured_put_decimal(frame->counter, put, to);
        put(to, ',');
    }
    for (uint16_t taxel = 0; taxel < frame->taxels; ++taxel) {
        if (taxel) put(to, ',');
        gestured_put_decimal(frame->kind == GESTURED_UINT16 ? ((const uint16_t *)frame->values)[taxel]
                                                            : ((const uint8_t *)frame->values)[taxel],
                             put, to);
    }
    put(to, '\n');
    return 1;
}

#ifdef __cplusplus
}
#endif
#endif
