/* gestured_frames.h for tests/deploy/test_c.py, which loads this as a library. */
#include "gestured_frames.h"

struct bytes {
    uint8_t *at;
    size_t room, used;
};

static void put(void *to, uint8_t byte) {
    struct bytes *bytes = (struct bytes *)to;
    if (bytes->used++ < bytes->room) bytes->at[bytes->used - 1] = byte;
}

/* The frame in the form 'o' (OSC), 's' (SLIP), 'l' (a line) or 'p' (a packet in a buffer): how many bytes that takes,
 * of which at most `room` are written. A negative counter is none. SIZE_MAX where the header gave another size. */
size_t written(char form, const char *sensor, int kind, const void *values, uint16_t taxels, int64_t counter,
               uint8_t *out, size_t room);
size_t written(char form, const char *sensor, int kind, const void *values, uint16_t taxels, int64_t counter,
               uint8_t *out, size_t room) {
    struct bytes bytes = {out, room, 0};
    struct gestured_frame frame = kind == GESTURED_UINT8    ? gestured_uint8(sensor, (const uint8_t *)values, taxels)
                                  : kind == GESTURED_UINT16 ? gestured_uint16(sensor, (const uint16_t *)values, taxels)
                                                            : gestured_floats(sensor, (const float *)values, taxels);
    if (counter >= 0) gestured_count(&frame, (uint32_t)counter);
    if (form == 'p') return gestured_packet(&frame, out, room);
    if (form == 'o' && gestured_osc(&frame, put, &bytes) != bytes.used) return SIZE_MAX;
    if (form == 's' && !gestured_slip(&frame, put, &bytes) != !bytes.used) return SIZE_MAX;
    if (form == 'l' && !gestured_line(&frame, put, &bytes) != !bytes.used) return SIZE_MAX;
    return bytes.used;
}
