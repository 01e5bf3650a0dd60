/* Xsens' binary protocol: messages out of a stream of bytes, and what MTData2 holds. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "imu/mtdata2.h"

static uint8_t data[2048];
static size_t used;

static void put_big(uint64_t value, size_t bytes) {
    for (size_t i = bytes; i-- > 0;) data[used++] = (uint8_t)(value >> (8 * i));
}

static void put_number(unsigned format, double value) {
    float single = (float)value;
    uint32_t bits32;
    uint64_t bits64;
    switch (format) {
    case 0:
        memcpy(&bits32, &single, 4);
        put_big(bits32, 4);
        break;
    case 1: put_big((uint32_t)(int32_t)lrint(value * 1048576), 4); break;
    case 2:
        put_big((uint32_t)((value - floor(value)) * 4294967296.0), 4);
        put_big((uint16_t)(int16_t)floor(value), 2);
        break;
    default:
        memcpy(&bits64, &value, 8);
        put_big(bits64, 8);
        break;
    }
}

static void item(unsigned id, int count, const double *values) {
    static const uint8_t sizes[4] = {4, 4, 6, 8};
    put_big(id, 2);
    data[used++] = (uint8_t)(sizes[id & 3] * count);
    for (int i = 0; i < count; i++) put_number(id & 3, values[i]);
}

static void begin(uint16_t packet, uint32_t ticks) {
    used = 0;
    put_big(0x1020, 2);
    put_big(2, 1);
    put_big(packet, 2);
    put_big(0x1060, 2);
    put_big(4, 1);
    put_big(ticks, 4);
}

static const double gyro[3] = {0.125, -1.5, 2.25}, accel[3] = {-0.5, 9.8125, 3.0625};

static void every_number_format(void **state) {
    (void)state;
    for (unsigned format = 0; format < 4; format++)
        for (unsigned axes = 0; axes <= 8; axes += 4) {
            mtdata2_state s = {0};
            imu_reading r;
            begin(7, 1000);
            item(0x8020 | format | axes, 3, gyro);
            item(0x4020 | format | axes, 3, accel);
            assert_int_equal(mtdata2_read(&s, data, used, 1, &r), MTDATA2_READING);
            assert_true(r.has_gyro && r.has_accel);
            for (int i = 0; i < 3; i++) {
                assert_true(fabs(r.gyro[0][i] - gyro[i]) < 1e-6);
                assert_true(fabs(r.accel[0][i] - accel[i]) < 1e-6);
            }
            assert_int_equal(r.times, 1);
            assert_int_equal(r.device_ns[0], 100000000);
        }
}

static void counters_and_time(void **state) {
    (void)state;
    mtdata2_state s = {0};
    imu_reading r;
    int64_t last = 0, lost = 0;
    for (uint32_t n = 0; n < 70000; n++) { /* both the counter and the time wrap */
        const uint32_t ticks = 0xFFFFFF00u + 25 * n;
        if (n % 100 == 50) continue; /* lost */
        begin((uint16_t)(65000 + n), ticks);
        item(0x8020, 3, gyro);
        assert_int_equal(mtdata2_read(&s, data, used, 1 + (int64_t)n * 2500000, &r), MTDATA2_READING);
        assert_false(r.has_accel);
        if (n) assert_int_equal(r.device_ns[0] - last, (n % 100 == 51 ? 2 : 1) * 2500000);
        last = r.device_ns[0];
        lost += r.lost;
    }
    assert_int_equal(lost, 700);
}

static void increments_become_rates(void **state) {
    (void)state;
    mtdata2_state s = {0};
    imu_reading r;
    const double angle = sqrt(gyro[0] * gyro[0] + gyro[1] * gyro[1] + gyro[2] * gyro[2]) * 0.01;
    double q[4] = {cos(angle / 2)}, v[3];
    for (int i = 0; i < 3; i++) {
        q[1 + i] = gyro[i] * 0.01 / angle * sin(angle / 2);
        v[i] = accel[i] * 0.01;
    }
    for (int round = 0; round < 3; round++) {
        begin((uint16_t)round, (uint32_t)(1000 + 100 * round)); /* 10 ms apart */
        item(0x8033, 4, q);
        item(0x4013, 3, v);
        const mtdata2_result result = mtdata2_read(&s, data, used, 1 + round * 10000000, &r);
        assert_int_equal(result,
                         round ? MTDATA2_READING : MTDATA2_OTHER); /* the first has no time before it */
        if (!round) continue;
        for (int i = 0; i < 3; i++) {
            assert_true(fabs(r.gyro[0][i] - gyro[i]) < 1e-9);
            assert_true(fabs(r.accel[0][i] - accel[i]) < 1e-9);
        }
        assert_int_equal(r.device_ns[0], 100000000 + round * 10000000 - 5000000);
        for (int i = 0; i < 4; i++) q[i] = -q[i]; /* the same turn */
    }
    begin(3, 1300);
    item(0x8033, 4, (double[]){1, 1, 0, 0});
    assert_int_equal(mtdata2_read(&s, data, used, 1, &r), MTDATA2_OTHER); /* no rotation */
}

/* An increment is over one period, however many messages are missing before it. */
static void after_a_lost_message_increments_keep_their_rate(void **state) {
    (void)state;
    mtdata2_state s = {0};
    imu_reading r;
    const uint16_t packets[] = {0, 1, 3, 6, 7};
    const double turn = 0.02, q[4] = {cos(turn / 2), 0, 0, sin(turn / 2)}, v[3] = {0, 0, 0.098};
    for (int i = 0; i < 5; i++) {
        begin(packets[i], (uint32_t)(1000 + 100 * packets[i])); /* 10 ms apart */
        item(0x8033, 4, q);
        item(0x4013, 3, v);
        const mtdata2_result result = mtdata2_read(&s, data, used, 1 + packets[i] * 10000000, &r);
        assert_int_equal(result, i ? MTDATA2_READING : MTDATA2_OTHER);
        if (!i) continue;
        assert_int_equal(r.lost, packets[i] - packets[i - 1] - 1);
        assert_true(fabs(r.gyro[0][2] - 2) < 1e-9);
        assert_true(fabs(r.accel[0][2] - 9.8) < 1e-9);
        assert_int_equal(r.device_ns[0], 100000000 + packets[i] * 10000000 - 5000000);
    }
}

static void broken_data_is_refused(void **state) {
    (void)state;
    mtdata2_state s = {0};
    imu_reading r;
    begin(1, 1);
    item(0x8020, 3, gyro);
    item(0x4020, 3, accel);
    for (size_t cut = 1; cut < used; cut++) {
        uint8_t *bytes = malloc(cut);
        memcpy(bytes, data, cut);
        const mtdata2_result result = mtdata2_read(&s, bytes, cut, 1, &r);
        const bool between = cut == 5 || cut == 12 || cut == 27; /* items end here */
        assert_int_equal(result, !between ? MTDATA2_MALFORMED : cut == 27 ? MTDATA2_READING : MTDATA2_OTHER);
        free(bytes);
    }
    begin(1, 1);
    item(0x8020, 2, gyro);
    assert_int_equal(mtdata2_read(&s, data, used, 1, &r), MTDATA2_MALFORMED);
    begin(1, 1);
    item(0x8020, 3, (double[]){0, NAN, 0});
    assert_int_equal(mtdata2_read(&s, data, used, 1, &r), MTDATA2_MALFORMED);
    assert_int_equal(mtdata2_read(&s, data, 0, 1, &r), MTDATA2_OTHER);
}

/* ---- the stream of messages ---- */

static uint8_t stream[1 << 18];

static void messages_in_any_pieces(void **state) {
    (void)state;
    size_t length = 0;
    const int messages = 300;
    for (int i = 0; i < messages; i++) {
        uint8_t payload[2048];
        const size_t size = i % 3 ? (size_t)i % 40 : (size_t)(i * 7 % 1500);
        for (size_t k = 0; k < size; k++)
            payload[k] = (uint8_t)(k % 5 ? i + (int)k : 0xFA); /* preambles within */
        length += xbus_build(stream + length, sizeof stream - length, (uint8_t)i, payload, size);
        if (i % 4 == 0) { /* noise between */
            stream[length++] = 0xFA;
            stream[length++] = 0x12;
        }
    }
    srand(9);
    for (int round = 0; round < 20; round++) {
        xbus_parser *p = calloc(1, sizeof *p);
        int next = 0;
        for (size_t at = 0; at < length;) {
            size_t piece = (size_t)(rand() % (round ? 600 : 1)) + 1;
            if (piece > length - at) piece = length - at;
            for (size_t taken = 0;;) {
                xbus_message message;
                bool whole;
                taken += xbus_take(p, stream + at + taken, piece - taken, &message, &whole);
                if (!whole) {
                    assert_int_equal(taken, piece);
                    break;
                }
                assert_int_equal(message.id, (uint8_t)next);
                assert_int_equal(message.length, next % 3 ? next % 40 : next * 7 % 1500);
                next++;
            }
            at += piece;
        }
        assert_int_equal(next, messages);
        assert_int_equal(p->skipped, 2 * 75);
        free(p);
    }
}

static void damaged_messages_cost_only_themselves(void **state) {
    (void)state;
    uint8_t payload[30] = {0};
    size_t length = 0, size = 0;
    for (int i = 0; i < 1000; i++) {
        size = xbus_build(stream + length, sizeof stream - length, XBUS_MTDATA2, payload, sizeof payload);
        length += size;
    }
    int damaged = 0;
    srand(4);
    for (size_t i = 0; i < 1000; i++)
        if (rand() % 10 == 0) {
            stream[i * size + (size_t)rand() % size] ^= 0x41;
            damaged++;
        }
    xbus_parser *p = calloc(1, sizeof *p);
    int whole_ones = 0;
    for (size_t taken = 0;;) {
        xbus_message message;
        bool whole;
        taken += xbus_take(p, stream + taken, length - taken, &message, &whole);
        if (!whole) break;
        whole_ones++;
    }
    assert_in_range(whole_ones, 1000 - damaged - 1, 1000 - damaged);
    assert_true(p->broken > 0 && p->broken <= damaged);
    free(p);
}

static void building_has_limits(void **state) {
    (void)state;
    uint8_t out[16];
    assert_int_equal(xbus_build(out, sizeof out, XBUS_GO_TO_MEASUREMENT, NULL, 0), 5);
    assert_memory_equal(out, ((uint8_t[]){0xFA, 0xFF, 0x10, 0x00, 0xF1}), 5); /* the manual's own example */
    assert_int_equal(xbus_build(out, sizeof out, 1, data, 12), 0);
    assert_int_equal(xbus_build(stream, sizeof stream, 1, data, XBUS_MOST_DATA + 1), 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_number_format),     cmocka_unit_test(counters_and_time),
        cmocka_unit_test(increments_become_rates), cmocka_unit_test(broken_data_is_refused),
        cmocka_unit_test(messages_in_any_pieces),  cmocka_unit_test(damaged_messages_cost_only_themselves),
        cmocka_unit_test(after_a_lost_message_increments_keep_their_rate),
        cmocka_unit_test(building_has_limits),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
