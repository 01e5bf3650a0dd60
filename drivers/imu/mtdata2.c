#include "imu/mtdata2.h"

#include <math.h>
#include <string.h>

enum { PREAMBLE = 0xFA, BUS_ID = 0xFF, EXTENDED = 0xFF };

/* ---- messages: FA FF id length data checksum; length FF is followed by two bytes of length ---- */

static size_t header_length(const uint8_t *bytes) {
    return bytes[3] == EXTENDED ? 6 : 4;
}

static size_t data_length(const uint8_t *bytes) {
    return bytes[3] == EXTENDED ? (size_t)(bytes[4] << 8 | bytes[5]) : bytes[3];
}

/* Drops the first byte and what follows up to the next preamble. */
static void drop(xbus_parser *p) {
    size_t next = 1;
    while (next < p->have && p->bytes[next] != PREAMBLE) next++;
    p->have -= next;
    memmove(p->bytes, p->bytes + next, p->have);
    p->skipped += (int64_t)next;
}

/* 1: a complete message is at the front; 0: bytes are missing; -1: no message. */
static int look(const xbus_parser *p) {
    const uint8_t *b = p->bytes;
    if (p->have >= 1 && b[0] != PREAMBLE) return -1;
    if (p->have >= 2 && b[1] != BUS_ID) return -1;
    if (p->have < 4 || p->have < header_length(b)) return 0;
    if (data_length(b) > XBUS_MOST_DATA) return -1;
    const size_t whole = header_length(b) + data_length(b) + 1;
    if (p->have < whole) return 0;
    uint8_t sum = 0;
    for (size_t i = 1; i < whole; i++) sum = (uint8_t)(sum + b[i]);
    return sum == 0 ? 1 : -1;
}

size_t xbus_take(xbus_parser *p, const uint8_t *bytes, size_t length, xbus_message *message, bool *whole) {
    size_t taken = 0;
    *whole = false;
    /* The message returned last is still at the front. */
    if (p->have > 0 && look(p) > 0) {
        const size_t size = header_length(p->bytes) + data_length(p->bytes) + 1;
        p->have -= size;
        memmove(p->bytes, p->bytes + size, p->have);
    }
    for (;;) {
        int found = p->have ? look(p) : 0;
        if (found > 0) {
            *message = (xbus_message){p->bytes[2], p->bytes + header_length(p->bytes), data_length(p->bytes)};
            *whole = true;
            return taken;
        }
        if (found < 0) {
            if (p->have >= 4) p->broken++;
            drop(p);
            continue;
        }
        if (taken == length) return taken;
        p->bytes[p->have++] = bytes[taken++];
    }
}

size_t xbus_build(uint8_t *out, size_t capacity, uint8_t id, const uint8_t *data, size_t length) {
    const size_t header = length < EXTENDED ? 4 : 6;
    if (length > XBUS_MOST_DATA || capacity < header + length + 1) return 0;
    out[0] = PREAMBLE;
    out[1] = BUS_ID;
    out[2] = id;
    out[3] = (uint8_t)(header == 4 ? length : EXTENDED);
    if (header == 6) {
        out[4] = (uint8_t)(length >> 8);
        out[5] = (uint8_t)length;
    }
    if (length) memcpy(out + header, data, length);
    uint8_t sum = 0;
    for (size_t i = 1; i < header + length; i++) sum = (uint8_t)(sum + out[i]);
    out[header + length] = (uint8_t)-sum;
    return header + length + 1;
}

/* ---- MTData2: items of a 16-bit identifier, a length and big-endian data ---- */

enum { /* identifiers without the bits of format and axes */
       PACKET_COUNTER = 0x1020,
       SAMPLE_TIME_FINE = 0x1060,
       DELTA_V = 0x4010,
       ACCELERATION = 0x4020,
       ACCELERATION_HR = 0x4040,
       RATE_OF_TURN = 0x8020,
       DELTA_Q = 0x8030,
       RATE_OF_TURN_HR = 0x8040,
       FORMAT = 0x3,
       AXES = 0xC
};

#define TICK_NS 100000 /* of SampleTimeFine */

static uint64_t big(const uint8_t *bytes, size_t count) {
    uint64_t value = 0;
    for (size_t i = 0; i < count; i++) value = value << 8 | bytes[i];
    return value;
}

/* Reads count numbers in the format of an identifier; false: the length doesn't fit, or one isn't finite. */
static bool numbers(unsigned format, const uint8_t *data, size_t length, int count, double *out) {
    static const size_t sizes[4] = {4, 4, 6, 8}; /* float32, 12.20, 16.32, float64 */
    const size_t size = sizes[format];
    if (length != size * (size_t)count) return false;
    for (int i = 0; i < count; i++, data += size) {
        const uint64_t raw = big(data, size);
        float single;
        const uint32_t low = (uint32_t)raw;
        switch (format) {
        case 0:
            memcpy(&single, &low, sizeof single);
            out[i] = single;
            break;
        case 1: out[i] = ldexp((int32_t)low, -20); break;
        case 2: /* the fraction comes first */
            out[i] = (int16_t)(raw & 0xFFFF) + ldexp((double)(raw >> 16), -32);
            break;
        default: memcpy(&out[i], &raw, sizeof raw); break;
        }
        if (!isfinite(out[i])) return false;
    }
    return true;
}

typedef struct {
    bool rate, acceleration, delta_q, delta_v, time, counter;
    double gyro[3], accel[3], q[4], v[3];
    uint32_t ticks;
    uint16_t packet;
} contents;

static bool take_item(contents *c, unsigned id, const uint8_t *data, size_t length) {
    const unsigned format = id & FORMAT;
    switch (id & ~(unsigned)(FORMAT | AXES)) {
    case PACKET_COUNTER:
        if (length != 2) return false;
        c->counter = true;
        c->packet = (uint16_t)big(data, 2);
        return true;
    case SAMPLE_TIME_FINE:
        if (length != 4) return false;
        c->time = true;
        c->ticks = (uint32_t)big(data, 4);
        return true;
    case ACCELERATION:
    case ACCELERATION_HR: return c->acceleration = numbers(format, data, length, 3, c->accel);
    case RATE_OF_TURN:
    case RATE_OF_TURN_HR: return c->rate = numbers(format, data, length, 3, c->gyro);
    case DELTA_V: return c->delta_v = numbers(format, data, length, 3, c->v);
    case DELTA_Q: return c->delta_q = numbers(format, data, length, 4, c->q);
    }
    return true; /* orientation, magnetic field, status: not used */
}

static bool take_items(contents *c, const uint8_t *data, size_t length) {
    while (length) {
        if (length < 3 || length - 3 < data[2]) return false;
        const size_t size = data[2];
        if (!take_item(c, (unsigned)big(data, 2), data + 3, size)) return false;
        data += 3 + size;
        length -= 3 + size;
    }
    return true;
}

/* The rate whose turn over seconds is the quaternion w x y z. */
static bool rate_of(const double q[4], double seconds, double rate[3]) {
    const double sine = sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    const double norm = sqrt(q[0] * q[0] + sine * sine);
    if (!(fabs(norm - 1) < 0.01)) return false;
    const double sign = q[0] < 0 ? -1 : 1;
    const double scale = sine > 1e-12 ? sign * 2 * atan2(sine, fabs(q[0])) / sine : 2;
    for (int i = 0; i < 3; i++) rate[i] = scale * q[1 + i] / seconds;
    return true;
}

mtdata2_result mtdata2_read(mtdata2_state *state, const uint8_t *data, size_t length, int64_t arrival_ns,
                            imu_reading *reading) {
    contents c = {0};
    if (!take_items(&c, data, length)) return MTDATA2_MALFORMED;
    *reading = (imu_reading){.samples = 1};
    double seconds = 0;
    int64_t steps = 1;
    if (c.counter) {
        const uint16_t step = (uint16_t)(c.packet - state->counter);
        if (state->counting && step > 1) reading->lost = step - 1;
        steps = state->counting && step ? step : 1;
        state->counting = true;
        state->counter = c.packet;
    }
    if (c.time) {
        const uint64_t ticks = whole_counter_next(&state->clock, c.ticks, 32, TICK_NS, arrival_ns);
        if (ticks > INT64_MAX / 2 / TICK_NS) return MTDATA2_MALFORMED;
        const int64_t now_ns = (int64_t)ticks * TICK_NS;
        if (state->has_last) seconds = (double)(now_ns - state->last_ns) * 1e-9 / (double)steps;
        state->last_ns = now_ns;
        state->has_last = true;
        reading->device_ns[0] = now_ns;
        reading->times = 1;
    }
    /* Deltas are means over the time since the previous message, so their stamp is its middle. */
    const bool deltas = seconds > 0 && seconds < 1;
    bool middle = false;
    if (!c.rate && c.delta_q && deltas) middle = c.rate = rate_of(c.q, seconds, c.gyro);
    if (!c.acceleration && c.delta_v && deltas) {
        middle = c.acceleration = true;
        for (int i = 0; i < 3; i++) c.accel[i] = c.v[i] / seconds;
    }
    if (!c.rate && !c.acceleration) return MTDATA2_OTHER;
    if (middle) reading->device_ns[0] -= (int64_t)(0.5e9 * seconds);
    reading->has_gyro = c.rate;
    reading->has_accel = c.acceleration;
    memcpy(reading->gyro[0], c.gyro, sizeof c.gyro);
    memcpy(reading->accel[0], c.accel, sizeof c.accel);
    return MTDATA2_READING;
}
