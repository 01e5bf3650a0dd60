/* A phone by UDP: lines of both formats, good and bad, and datagrams over the loopback. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>

#include <cmocka.h>

#include <arpa/inet.h>
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <stdatomic.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "fathom_drivers.h"
#include "monotonic.h"
#include "imu/udp_lines.h"
#include "source_contract.h"

/* ---- the kernel, where the tests need another one: a clock that is ahead, datagrams that it dropped ---- */

static atomic_llong ahead_ns, standing_ns; /* standing_ns: what the clock shows, where it stands; 0: it runs */
static atomic_int dealt_with;               /* datagrams that the driver has taken and handed on */

int clock_gettime(clockid_t clock, struct timespec *time) {
    const int result = (int)syscall(SYS_clock_gettime, clock, time);
    time->tv_sec += ahead_ns / 1000000000;
    if (clock == CLOCK_MONOTONIC && standing_ns)
        *time = (struct timespec){.tv_sec = standing_ns / 1000000000, .tv_nsec = standing_ns % 1000000000};
    return result;
}

static atomic_uint overflows; /* as SO_RXQ_OVFL counts them; 0: says nothing */

ssize_t recvmsg(int socket, struct msghdr *message, int flags) {
    static _Thread_local bool took;
    dealt_with += took;
    const ssize_t length = syscall(SYS_recvmsg, socket, message, flags);
    took = length >= 0;
    assert_true((uintptr_t)message->msg_control % _Alignof(struct cmsghdr) == 0);
    if (length < 0 || !overflows) return length;
    const unsigned count = overflows;
    struct cmsghdr *header = message->msg_control;
    *header = (struct cmsghdr){.cmsg_len = CMSG_LEN(sizeof count), .cmsg_level = SOL_SOCKET, .cmsg_type = SO_RXQ_OVFL};
    memcpy(CMSG_DATA(header), &count, sizeof count);
    message->msg_controllen = CMSG_SPACE(sizeof count);
    return length;
}

/* ---- lines ---- */

static udp_line line;

static udp_line_result parse(udp_format format, const char *text) {
    const size_t length = strlen(text);
    char *exact = malloc(length ? length : 1); /* no 0 at its end */
    memcpy(exact, text, length);
    const udp_line_result result = udp_line_parse(format, exact, length, &line);
    free(exact);
    return result;
}

static void comma_separated_lines(void **state) {
    (void)state;
    assert_int_equal(
        parse(UDP_FORMAT_ANY, "890.715, 3, -0.07, 9.19, 2.47, 4, 0.01,-0.03, 0.5, 5, 12.1, -3.0, 40.2\r"),
        UDP_LINE_READING);
    assert_true(line.has_gyro && line.has_accel && !line.has_count);
    assert_true(line.time == 890.715 && line.accel[1] == 9.19 && line.gyro[1] == -0.03 &&
                line.gyro[2] == 0.5);
    assert_int_equal(parse(UDP_FORMAT_CSV, "1,85,1013.2,4,1,2,3,86,31"), UDP_LINE_READING);
    assert_true(line.has_gyro && !line.has_accel);
    assert_int_equal(parse(UDP_FORMAT_ANY, "1e3, 3, 1, 2, 3"), UDP_LINE_READING);
    assert_true(line.time == 1000);
    assert_int_equal(parse(UDP_FORMAT_ANY, "12.5, 5, 1, 2, 3"), UDP_LINE_OTHER);
    assert_int_equal(parse(UDP_FORMAT_ANY, "12.5"), UDP_LINE_OTHER);
    assert_int_equal(parse(UDP_FORMAT_ANY, " \r"), UDP_LINE_OTHER);
    static const char *const wrong[] = {
        "hello",       "1,",           "1,3",           "1,3,1,2",       "1,3,1,2,",    "1,3,1,2,nan",
        "1,3,1,2,inf", "1,3,1,2,0x10", "1,3,1,2,1e999", "1,3.5,1,2,3",   "1,3,1,2,3,",  "1,3,1,2,3 4",
        "1;3;1;2;3",   "nan,3,1,2,3",  "--1,3,1,2,3",   "1,99999,1,2,3", "1,3,1,2,3,4", "1,3,,2,3"};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        if (parse(UDP_FORMAT_ANY, wrong[i]) != UDP_LINE_MALFORMED) fail_msg("'%s' was taken", wrong[i]);
        assert_false(line.has_gyro || line.has_accel);
    }
    assert_int_equal(parse(UDP_FORMAT_CSV, "{\"t\":1,\"gyro\":[1,2,3]}"), UDP_LINE_MALFORMED);
}

static void json_lines(void **state) {
    (void)state;
    assert_int_equal(parse(UDP_FORMAT_ANY,
                           " {\"t\": 890.715, \"gyro\": [0.01, -0.03, 0.5], \"accel\":[1,2,3], \"n\": 17 } "),
                     UDP_LINE_READING);
    assert_true(line.has_gyro && line.has_accel && line.has_count);
    assert_true(line.time == 890.715 && line.gyro[1] == -0.03 && line.accel[2] == 3 && line.count == 17);
    assert_int_equal(
        parse(UDP_FORMAT_JSON,
              "{\"gyro\":[1,2,3],\"extra\":{\"a\":[1,\"}\\\"\",true,null,{}],\"b\":[]},\"t\":4}"),
        UDP_LINE_READING);
    assert_int_equal(parse(UDP_FORMAT_JSON, "{\"t\":1,\"name\":\"phone\"}"), UDP_LINE_OTHER);
    assert_int_equal(parse(UDP_FORMAT_JSON, "{}"), UDP_LINE_OTHER);
    static const char *const wrong[] = {"{",
                                        "{\"t\":1",
                                        "{\"t\":1}}",
                                        "{\"t\":1,}",
                                        "{t:1}",
                                        "{\"gyro\":[1,2,3]}", /* no time */
                                        "{\"t\":1,\"gyro\":[1,2]}",
                                        "{\"t\":1,\"gyro\":[1,2,3,4]}",
                                        "{\"t\":1,\"gyro\":[1,2,null]}",
                                        "{\"t\":\"1\",\"gyro\":[1,2,3]}",
                                        "{\"t\":1,\"gyro\":[1,2,3],\"n\":1.5}",
                                        "{\"t\":1,\"x\":\"abc}",
                                        "{\"t\":1,\"x\":\"abc\\",
                                        "{\"t\":1 \"gyro\":[1,2,3]}",
                                        "{\"t\":1,\"x\":[[[[[[[[[[[[[[[[[[[[[[[[]]]]]]]]]]]]]]]]]]]]]]]]}",
                                        "{\"t\":1,\"x\":yes}",
                                        "[1]"};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++)
        if (parse(UDP_FORMAT_JSON, wrong[i]) != UDP_LINE_MALFORMED) fail_msg("'%s' was taken", wrong[i]);
    char large[UDP_LINE_MOST + 2];
    memset(large, ' ', sizeof large);
    assert_int_equal(udp_line_parse(UDP_FORMAT_ANY, large, sizeof large, &line), UDP_LINE_MALFORMED);
    assert_int_equal(udp_line_parse(UDP_FORMAT_ANY, large, UDP_LINE_MOST + 1, &line), UDP_LINE_MALFORMED);
    assert_int_equal(udp_line_parse(UDP_FORMAT_ANY, large, UDP_LINE_MOST, &line), UDP_LINE_OTHER);
    memcpy(large + UDP_LINE_MOST - 9, "1,3,1,2,3", 9); /* as long as may be, to the last character */
    assert_int_equal(udp_line_parse(UDP_FORMAT_ANY, large, UDP_LINE_MOST, &line), UDP_LINE_READING);
    assert_true(line.accel[2] == 3);
    assert_int_equal(udp_line_parse(UDP_FORMAT_ANY, "1,3,\0,2,3", 9, &line), UDP_LINE_MALFORMED);
}

static void damaged_lines_are_harmless(void **state) {
    (void)state;
    static const char *const good[] = {
        "890.715, 3, -0.07, 9.19, 2.47, 4, 0.01,-0.03, 0.5",
        "{\"t\": 890.715, \"gyro\": [0.01, -0.03, 0.5], \"accel\":[1,2,3], \"x\":[{}]}"};
    srand(2);
    for (int round = 0; round < 20000; round++) {
        const char *from = good[round % 2];
        const size_t length = (size_t)rand() % (strlen(from) + 1);
        char *text = malloc(length + 1);
        memcpy(text, from, length);
        for (int i = rand() % 4; i > 0 && length; i--) text[(size_t)rand() % length] = (char)(rand() % 256);
        if (udp_line_parse(UDP_FORMAT_ANY, text, length, &line) == UDP_LINE_READING)
            for (int i = 0; i < 3; i++) assert_true(isfinite(line.gyro[i]) && isfinite(line.accel[i]));
        free(text);
    }
}

/* ---- datagrams ---- */

static char errors[1024];

static void keep_log(void *user, fathom_log_level level, const char *text) {
    (void)user;
    if (level == FATHOM_LOG_ERROR) snprintf(errors, sizeof errors, "%s", text);
}

/* A port that is free now. */
static int free_port(void) {
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t length = sizeof at;
    const int s = socket(AF_INET, SOCK_DGRAM, 0);
    assert_int_equal(bind(s, (struct sockaddr *)&at, length), 0);
    assert_int_equal(getsockname(s, (struct sockaddr *)&at, &length), 0);
    close(s);
    return ntohs(at.sin_port);
}

static int port;

static int phone(void) {
    struct sockaddr_in to = {
        .sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK), .sin_port = htons((uint16_t)port)};
    const int s = socket(AF_INET, SOCK_DGRAM, 0);
    assert_int_equal(connect(s, (struct sockaddr *)&to, sizeof to), 0);
    return s;
}

static void say(int s, const char *text) {
    assert_int_equal(send(s, text, strlen(text), 0), (ssize_t)strlen(text));
}

static fathom_source *listen_with(const char *settings) {
    char uri[128];
    fathom_source *source;
    const fathom_source_options options = {.struct_size = sizeof options, .log = keep_log};
    port = free_port();
    snprintf(uri, sizeof uri, "udp:127.0.0.1:%d%s", port, settings);
    assert_int_equal(fathom_source_open(&source, uri, &options), FATHOM_OK);
    assert_int_equal(fathom_source_start(source), FATHOM_OK);
    return source;
}

static fathom_source_status status_of(fathom_source *source) {
    fathom_source_status status = FATHOM_STRUCT(fathom_source_status);
    assert_int_equal(fathom_source_get_status(source, &status), FATHOM_OK);
    return status;
}

/* Waits up to two seconds for so many samples and malformed ones. */
static fathom_source_status settle(fathom_source *source, int64_t samples, int64_t malformed) {
    fathom_source_status s = status_of(source);
    for (int i = 0; i < 200 && (s.samples < samples || s.malformed < malformed); i++) {
        usleep(10000);
        s = status_of(source);
    }
    return s;
}

static void a_phone_that_streams(void **state) {
    (void)state;
    fathom_source *source = listen_with("");
    const int s = phone();
    char text[256];
    fathom_imu_sample got[256];
    int n = 0, most = 200;
    const int64_t start_ns = monotonic_now_ns();
    for (int i = 0; i < most; i++) { /* its clock shows 50000 s more, and stamps are 3 ms old when sent */
        const int64_t now_ns = monotonic_now_ns();
        snprintf(text, sizeof text, "%.6f, 3, 0.1, 0.2, 9.8, 4, %.6f, 0, 0",
                 50000 + (double)(now_ns - start_ns) * 1e-9 - 0.003, (double)(now_ns - start_ns) * 1e-9);
        say(s, text);
        usleep(5000);
        while (fathom_source_wait(source, 0) == FATHOM_OK)
            n += fathom_source_read_imu(source, got + n, 256 - n);
    }
    while (n < most && fathom_source_wait(source, 500) == FATHOM_OK)
        n += fathom_source_read_imu(source, got + n, 256 - n);
    assert_int_equal(n, most);
    double worst = 0;
    for (int i = 20; i < n; i++) {
        const double error = (double)(got[i].timestamp_ns - start_ns) * 1e-9 - got[i].gyro[0];
        worst = fmax(worst, fabs(error));
        assert_true(got[i].timestamp_ns > got[i - 1].timestamp_ns);
        assert_true(fabsf(got[i].accel[2] - 9.8f) < 1e-5f);
    }
    const fathom_source_status status = status_of(source);
    print_message("# 200 datagrams: stamps within %.2f ms, %.0f a second, offset %.4f s\n", 1e3 * worst,
                  status.rate_hz, status.clock_offset_s);
    assert_true(worst < 0.01);
    assert_int_equal(status.samples, most);
    assert_int_equal(status.malformed, 0);
    assert_int_equal(status.kinds, FATHOM_SOURCE_IMU);
    assert_int_equal(status.state, FATHOM_SOURCE_RUNNING);
    usleep(700000);
    assert_int_equal(status_of(source).state, FATHOM_SOURCE_STALLED);
    assert_int_equal(fathom_source_wait(source, 50), FATHOM_ERROR_TIMEOUT);
    close(s);
    fathom_source_close(source);
}

static void units_and_signs_are_settings(void **state) {
    (void)state;
    fathom_source *source = listen_with("?format=json&time=ms&gyro=deg&accel=g&sign=gravity");
    const int s = phone();
    say(s, "{\"t\":1000,\"gyro\":[180,0,0],\"accel\":[0,0,-1]}\n{\"t\":1005,\"gyro\":[180,0,0],\"accel\":[0,"
           "0,-1]}\n");
    assert_int_equal(settle(source, 2, 0).samples, 2);
    fathom_imu_sample got[2];
    assert_int_equal(fathom_source_read_imu(source, got, 2), 2);
    assert_true(fabs(got[1].gyro[0] - M_PI) < 1e-6 && fabs(got[1].accel[2] - 9.80665) < 1e-5);
    close(s);
    fathom_source_close(source);
}

static void lines_of_one_sensor_each(void **state) {
    (void)state;
    fathom_source *source = listen_with("");
    const int s = phone();
    char text[128];
    /* A clock that the test moves, so that a busy machine changes nothing. */
    standing_ns = monotonic_now_ns();
    dealt_with = 0;
    for (int i = 0; i < 100; i++) { /* the values are the times; the accelerometer's is 2 ms later */
        const double t = 0.005 * i;
        snprintf(text, sizeof text, "{\"t\":%.6f,\"gyro\":[%.6f,0,0],\"n\":%d}", 7 + t, t, 2 * i);
        say(s, text);
        snprintf(text, sizeof text, "{\"t\":%.6f,\"accel\":[%.6f,0,0],\"n\":%d}", 7.002 + t, 0.002 + t,
                 2 * i + 1);
        if (i != 50) say(s, text); /* that one gets lost */
        const int sent = 2 * (i + 1) - (i >= 50);
        for (int k = 0; k < 5000 && dealt_with < sent; k++) usleep(1000);
        standing_ns += 5000000;
    }
    const fathom_source_status status = settle(source, 100, 0);
    assert_int_equal(status.samples, 100);
    assert_int_equal(status.lost, 1);
    fathom_imu_sample got[128];
    assert_int_equal(fathom_source_read_imu(source, got, 128), 100);
    for (int i = 10; i < 99; i++)
        assert_true(fabsf(got[i].accel[0] - got[i].gyro[0]) < 1e-3f); /* brought to one time */
    standing_ns = 0;
    close(s);
    fathom_source_close(source);
}

static void what_makes_no_sense_is_counted(void **state) {
    (void)state;
    fathom_source *source = listen_with("");
    const int s = phone();
    say(s, "1.0, 3, 1, 2, 3, 4, 1, 2, 3");
    say(s, "garbage");
    say(s, "1.005, 3, 1, 2, 3, 4, 1, 2");
    say(s, "{\"t\":}");
    say(s, "1.005, 5, 1, 2, 3"); /* another sensor's: nothing wrong */
    say(s, "");
    char *large = malloc(20000);
    memset(large, '1', 20000);
    assert_int_equal(send(s, large, 20000, 0), 20000);
    free(large);
    say(s, "1.000, 3, 1, 2, 3, 4, 1, 2, 3"); /* again */
    say(s, "1.010, 3, 1, 2, 3, 4, 1, 2, 3\nnonsense\n1.015, 3, 1, 2, 3, 4, 1, 2, 3\n");
    const fathom_source_status status = settle(source, 3, 6);
    assert_int_equal(status.samples, 3);
    assert_int_equal(status.malformed, 6);
    close(s);
    fathom_source_close(source);
}

static void one_phone_at_a_time(void **state) {
    (void)state;
    fathom_source *source = listen_with("");
    const int first = phone(), second = phone();
    for (int i = 0; i < 20; i++) {
        char text[64];
        snprintf(text, sizeof text, "%.3f, 3, 1, 2, 3, 4, 1, 2, 3", 1 + 0.005 * i);
        say(first, text);
        snprintf(text, sizeof text, "%.3f, 3, 9, 9, 9, 4, 9, 9, 9", 500 + 0.005 * i);
        say(second, text);
        usleep(1000);
    }
    fathom_source_status status = settle(source, 20, 20);
    assert_int_equal(status.samples, 20);
    assert_int_equal(status.malformed, 20);
    fathom_imu_sample got[64];
    const int n = fathom_source_read_imu(source, got, 64);
    for (int i = 0; i < n; i++) assert_true(got[i].gyro[0] == 1);
    ahead_ns += 3000000000; /* the first has gone silent: the second may take its place */
    say(second, "600.000, 3, 9, 9, 9, 4, 9, 9, 9");
    assert_int_equal(settle(source, 21, 20).samples, 21);
    close(first);
    close(second);
    fathom_source_close(source);

    source = listen_with("?from=127.0.0.2");
    const int other = phone();
    say(other, "1.0, 3, 1, 2, 3, 4, 1, 2, 3");
    status = settle(source, 1, 1);
    assert_int_equal(status.samples, 0);
    assert_int_equal(status.malformed, 1);
    close(other);
    fathom_source_close(source);
}

static void a_new_senders_numbers_begin_anew(void **state) {
    (void)state;
    fathom_source *source = listen_with("");
    const int first = phone(), second = phone();
    say(first, "{\"t\":1.0,\"gyro\":[1,2,3],\"accel\":[1,2,3],\"n\":5}");
    say(first, "{\"t\":1.1,\"gyro\":[1,2,3],\"accel\":[1,2,3],\"n\":7}");
    assert_int_equal(settle(source, 2, 0).lost, 1);
    ahead_ns += 3000000000;
    say(second, "{\"t\":9.0,\"gyro\":[1,2,3],\"accel\":[1,2,3],\"n\":90}");
    say(second, "{\"t\":9.1,\"gyro\":[1,2,3],\"accel\":[1,2,3],\"n\":91}");
    const fathom_source_status status = settle(source, 4, 0);
    assert_int_equal(status.samples, 4);
    assert_int_equal(status.lost, 1);
    close(first);
    close(second);
    fathom_source_close(source);
}

static void datagrams_that_the_kernel_dropped_are_counted_as_lost(void **state) {
    (void)state;
    fathom_source *source = listen_with("");
    const int s = phone();
    const unsigned counts[] = {0, 5, 5, 7};
    for (int i = 0; i < 4; i++) {
        char text[64];
        overflows = counts[i];
        snprintf(text, sizeof text, "%d.5, 3, 1, 2, 3, 4, 1, 2, 3", i);
        say(s, text);
        assert_int_equal(settle(source, i + 1, 0).samples, i + 1);
    }
    assert_int_equal(status_of(source).lost, 7);
    overflows = 0;
    close(s);
    fathom_source_close(source);
}

/* Its lines are all good, but where it was cut a number may be another one. */
static void a_datagram_that_was_cut_is_refused_whole(void **state) {
    (void)state;
    fathom_source *source = listen_with("");
    const int s = phone();
    static char text[9000];
    size_t length = 0;
    for (int i = 0; length < sizeof text - 64; i++)
        length += (size_t)snprintf(text + length, 64, "%d.5, 3, 1, 2, 3, 4, 1, 2, 3\n", i);
    assert_true(length > 8192);
    say(s, text);
    assert_int_equal(settle(source, 0, 1).malformed, 1);
    assert_int_equal(status_of(source).samples, 0);
    close(s);
    fathom_source_close(source);
}

static void *cancel_soon(void *source) {
    usleep(100000);
    fathom_source_cancel(source);
    return NULL;
}

static void waiting_can_be_cancelled_and_begun_again(void **state) {
    (void)state;
    fathom_source *source = listen_with("");
    pthread_t thread;
    const int64_t start_ns = monotonic_now_ns();
    pthread_create(&thread, NULL, cancel_soon, source);
    assert_int_equal(fathom_source_wait(source, 10000), FATHOM_ERROR_CANCELLED);
    assert_true(monotonic_now_ns() - start_ns < 1000000000);
    pthread_join(thread, NULL);
    const int s = phone();
    for (int round = 0; round < 3; round++) {
        assert_int_equal(fathom_source_stop(source), FATHOM_OK);
        assert_int_equal(fathom_source_stop(source), FATHOM_OK);
        say(s, "1.0, 3, 7, 7, 7, 4, 7, 7, 7"); /* while nobody listens */
        usleep(20000);
        assert_int_equal(fathom_source_start(source), FATHOM_OK);
        say(s, "1.1, 3, 1, 2, 3, 4, 1, 2, 3");
        assert_int_equal(fathom_source_wait(source, 2000), FATHOM_OK);
        fathom_imu_sample got[4];
        assert_int_equal(fathom_source_read_imu(source, got, 4), 1);
        assert_true(got[0].gyro[0] == 1);
    }
    close(s);
    fathom_source_close(source);
}

static void refused(const char *uri, int error, const char *why) {
    fathom_source *source = (fathom_source *)uri;
    const fathom_source_options options = {.struct_size = sizeof options, .log = keep_log};
    errors[0] = 0;
    assert_int_equal(fathom_source_open(&source, uri, &options), error);
    assert_null(source);
    if (!strstr(errors, why)) fail_msg("%s: '%s' doesn't say '%s'", uri, errors, why);
}

static void uris_that_are_wrong(void **state) {
    (void)state;
    refused("udp:nowhere", FATHOM_ERROR_ARGUMENT, "udp:ADDRESS:PORT");
    refused("udp:localhost:5555", FATHOM_ERROR_ARGUMENT, "in numbers");
    refused("udp:127.0.0.1:99999", FATHOM_ERROR_ARGUMENT, "udp:ADDRESS:PORT");
    refused("udp:127.0.0.1:", FATHOM_ERROR_ARGUMENT, "udp:ADDRESS:PORT");
    refused("udp:[::1", FATHOM_ERROR_ARGUMENT, "udp:ADDRESS:PORT");
    refused("udp:192.0.2.1:5555", FATHOM_ERROR_NO_DEVICE, "not an address of this machine");
    refused("udp:127.0.0.1:5555?format=xml", FATHOM_ERROR_ARGUMENT, "any, csv, json");
    refused("udp:127.0.0.1:5555?colour=red", FATHOM_ERROR_ARGUMENT, "colour");
    refused("udp:127.0.0.1:5555?from=me", FATHOM_ERROR_ARGUMENT, "from=me");
    char uri[64];
    fathom_source *source = listen_with("");
    snprintf(uri, sizeof uri, "udp:127.0.0.1:%d", port);
    refused(uri, FATHOM_ERROR_BUSY, "another program listens");
    fathom_source_close(source);
}

static int count_remarks(void *user, const fathom_source_info *info) {
    *(int *)user += info->kinds == 0 && strstr(info->problem, "127.0.0.1") != NULL;
    return 0;
}

static void enumerating_names_this_machines_addresses(void **state) {
    (void)state;
    int remarks = 0;
    assert_int_equal(fathom_sources_enumerate("udp", count_remarks, &remarks, NULL, NULL), 0);
    assert_int_equal(remarks, 1);
}

static int calling;

static void call(void) {
    static int n;
    char text[64];
    snprintf(text, sizeof text, "%d.5, 3, 1, 2, 3, 4, 1, 2, 3", n++);
    if (send(calling, text, strlen(text), 0) < 0) { /* nobody listens yet */
    }
}

static void a_second_start_is_refused_and_the_source_goes_on(void **state) {
    (void)state;
    char uri[64];
    port = free_port();
    calling = phone();
    snprintf(uri, sizeof uri, "udp:127.0.0.1:%d", port);
    check_source_contract(uri, call);
    close(calling);
}

/* Who was listened to before the stop has no claim to the next start. */
static void after_a_stop_any_phone_may_begin(void **state) {
    (void)state;
    fathom_source *source = listen_with("");
    for (int i = 0; i < 2; i++) {
        const int s = phone();
        say(s, "1.0, 3, 0.1, 0.2, 9.8, 4, 0.5, 0, 0");
        assert_int_equal(settle(source, i + 1, 0).samples, i + 1);
        close(s);
        assert_int_equal(fathom_source_stop(source), FATHOM_OK);
        assert_int_equal(fathom_source_start(source), FATHOM_OK);
    }
    fathom_source_close(source);
}

/* A queue needs a descriptor to wait on. */
static void a_source_without_a_descriptor_left_is_refused(void **state) {
    (void)state;
    struct rlimit usual;
    fathom_source *source = (fathom_source *)&usual;
    assert_int_equal(getrlimit(RLIMIT_NOFILE, &usual), 0);
    const struct rlimit none = {0, usual.rlim_max};
    assert_int_equal(setrlimit(RLIMIT_NOFILE, &none), 0);
    const int e = fathom_source_open(&source, "udp:0", NULL);
    assert_int_equal(setrlimit(RLIMIT_NOFILE, &usual), 0);
    assert_int_equal(e, FATHOM_ERROR_MEMORY);
    assert_null(source);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(comma_separated_lines),
        cmocka_unit_test(json_lines),
        cmocka_unit_test(damaged_lines_are_harmless),
        cmocka_unit_test(a_phone_that_streams),
        cmocka_unit_test(units_and_signs_are_settings),
        cmocka_unit_test(lines_of_one_sensor_each),
        cmocka_unit_test(what_makes_no_sense_is_counted),
        cmocka_unit_test(one_phone_at_a_time),
        cmocka_unit_test(a_new_senders_numbers_begin_anew),
        cmocka_unit_test(datagrams_that_the_kernel_dropped_are_counted_as_lost),
        cmocka_unit_test(a_datagram_that_was_cut_is_refused_whole),
        cmocka_unit_test(waiting_can_be_cancelled_and_begun_again),
        cmocka_unit_test(uris_that_are_wrong),
        cmocka_unit_test(a_second_start_is_refused_and_the_source_goes_on),
        cmocka_unit_test(after_a_stop_any_phone_may_begin),
        cmocka_unit_test(a_source_without_a_descriptor_left_is_refused),
        cmocka_unit_test(enumerating_names_this_machines_addresses),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
